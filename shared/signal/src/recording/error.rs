//! Errors of a recording: file, field, fault and remedy, on one line.

use super::motion::MotionFault;
use super::selection::SelectionFault;
use std::path::Path;
use tracktwin_number::{rounded, significant};
use tracktwin_parameters::QuantityError;

/// A recording that cannot be used, in one line: `FILE: FIELD: what; how to remedy`.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {field}: {fault}")]
pub struct RecordingError {
    /// The file that is at fault.
    pub file: String,
    /// The field, column or row of that file.
    pub field: String,
    /// What is wrong with it.
    pub fault: Box<Fault>,
}

impl RecordingError {
    pub(super) fn new(file: &Path, field: impl Into<String>, fault: Fault) -> Self {
        Self { file: file.display().to_string(), field: field.into(), fault: Box::new(fault) }
    }
}

/// Faults of a field of a recording, with the remedy.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The file does not exist.
    #[error("the file does not exist; add it or correct its name")]
    NoSuchFile,
    /// The operating system or the decoder refuses the file.
    #[error("unreadable ({reason}); generate it again from its source")]
    Unreadable {
        /// Message of the operating system or of the decoder.
        reason: String,
    },
    /// A Parquet file has a compression that this program does not contain.
    #[error("its compression is not supported; write it with zstd, snappy or none")]
    Compression,
    /// A number is outside the limits of its quantity.
    #[error("{0}")]
    OutOfRange(QuantityError),
    /// A file has more numbers than fit into memory.
    #[error(
        "has {:.1} GB of numbers, but the limit is {:.1} GB; split it into passes",
        1e-9 * *bytes as f64, 1e-9 * *most as f64
    )]
    TooLarge {
        /// Bytes of its numbers.
        bytes: u64,
        /// Largest allowed number of bytes.
        most: u64,
    },
    /// A pass's file lies outside the recording's folder.
    #[error("{reason}")]
    OtherFolder {
        /// What is wrong with the name.
        reason: String,
    },
    /// `recording.json` is not JSON.
    #[error("is not valid JSON ({reason}); correct the text there")]
    NotJson {
        /// Message of the parser, with line and column.
        reason: String,
    },
    /// The format's name is absent or another one.
    #[error("is {found}; this program reads \"{expected}\"")]
    WrongFormat {
        /// The value found, as JSON.
        found: String,
        /// The name that is understood.
        expected: &'static str,
    },
    /// A field that is needed is absent.
    #[error("is missing; {remedy}")]
    NoField {
        /// How to state it.
        remedy: String,
    },
    /// A field holds another kind of value.
    #[error("is {found}; give {expected}")]
    WrongValue {
        /// The value found, as JSON.
        found: String,
        /// The expected value.
        expected: &'static str,
    },
    /// The selection of rail and axle selects no passes, or those of several rails.
    #[error(transparent)]
    Selection(SelectionFault),
    /// Two sleepers have the same name.
    #[error("duplicate sleeper id {id}; give every sleeper a unique id")]
    SleeperTwice {
        /// The name.
        id: String,
    },
    /// The path of a recording is not a folder with `recording.json`.
    #[error("{0}")]
    NoRecording(&'static str),
    /// The columns of a CSV file are not separated by commas.
    #[error("the columns are not separated by commas; convert the file with `tracktwin import`")]
    Separator,
    /// The file format is unknown.
    #[error("the extension is neither .parquet nor .csv; convert the file to one of these formats")]
    UnknownKind,
    /// The format of the table cannot be imported.
    #[error(
        "the extension is not one of .csv .txt .tsv .dat .parquet .npy .npz .mat; convert \
             the file to one of these formats"
    )]
    UnknownTable,
    /// The file has a known format that is not supported.
    #[error("is {kind}, which is not supported; {remedy}")]
    Foreign {
        /// What it is.
        kind: &'static str,
        /// How to convert the file to a supported format.
        remedy: &'static str,
    },
    /// A text table contains bytes that are not text.
    #[error("is not text (byte {byte} is {value:#04x}); export the data as CSV")]
    NoText {
        /// The place of the first such byte, counted from 1.
        byte: usize,
        /// The byte.
        value: u8,
    },
    /// A line has another number of fields than the others.
    #[error(
        "line {line} has {fields} field{} where {expected} belong; complete or delete it, begin lines that are no rows with #, and separate decimal commas by another sign{}",
        if *fields == 1 { "" } else { "s" }, taken_as_header(*header)
    )]
    Fields {
        /// The line of the file, counted from 1.
        line: u64,
        /// How many fields it has.
        fields: usize,
        /// How many the others have.
        expected: usize,
        /// The line that was taken as the header, or as the first row, if this line is the next one.
        header: Option<u64>,
    },
    /// The rows have a field more than the head has names, and the first one is no row name.
    #[error(
        "the header has {names} names, but the rows have {} fields, and the first field is \
             not a row number; name every column{}",
        names + 1, taken_as_header(Some(*line))
    )]
    ShortHead {
        /// How many names there are.
        names: usize,
        /// The line of the header, counted from 1.
        line: u64,
    },
    /// Two columns have the same name.
    #[error("columns {} have this name; give each column a unique name", list(places))]
    ColumnTwice {
        /// Their columns, counted from 1.
        places: Vec<usize>,
    },
    /// The name or the file states a unit that is unknown for such a column.
    #[error("the unit is \"{unit}\", but must be one of {known}; {remedy}")]
    UnknownUnit {
        /// Unit in the file.
        unit: String,
        /// The units that are known.
        known: String,
        /// How to state the unit.
        remedy: &'static str,
    },
    /// A column that is needed is absent.
    #[error(
        "the column is missing; rename one of the file's columns: {}{}",
        present.join(", "), taken_as_header(*header)
    )]
    NoColumn {
        /// The existing columns.
        present: Vec<String>,
        /// The line of a text file that was taken as the header.
        header: Option<u64>,
    },
    /// A column is not numeric.
    #[error("holds {kind}; store it as numbers")]
    NotNumeric {
        /// What it holds.
        kind: String,
    },
    /// A value is not a finite number; rows count from 1, the first row of data.
    #[error("row {row} is {value}; leave that row out, and split the pass there into two files")]
    NotFinite {
        /// The row, counted from 1.
        row: usize,
        /// The value, as written.
        value: String,
    },
    /// Many values are missing: a position or speed that is sampled more slowly than the accelerations.
    #[error("{missing} of {rows} rows are empty or not finite numbers; {FINER}")]
    Sparse {
        /// How many values are missing.
        missing: usize,
        /// How many rows there are.
        rows: usize,
    },
    /// A code for a missing value.
    #[error(
        "row {row} is {value}, far from all other values: probably a code for a missing value; \
             leave that row out, and split the pass there into two files"
    )]
    Missing {
        /// The row, counted from 1.
        row: usize,
        /// The value.
        value: f64,
    },
    /// A column of speeds that goes to and fro between two values.
    #[error(
        "alternates {changes} times between {} and {}: these are tachometer pulses, not \
             speeds; multiply the cumulated pulses by the distance per pulse and import the \
             result as position",
        rounded(*low, 3), rounded(*high, 3)
    )]
    Pulses {
        /// How often it changes from one to the other.
        changes: usize,
        /// The lower value.
        low: f64,
        /// The upper value.
        high: f64,
    },
    /// The file has no rows, or a single one.
    #[error(
        "has {rows} row{}; a pass needs at least two: remove the pass, or export it again",
        if *rows == 1 { "" } else { "s" }
    )]
    Empty {
        /// How many there are.
        rows: usize,
    },
    /// Columns of one file differ in length.
    #[error("has {rows} rows, but the other columns of the file have {others}; {FINER}")]
    LengthMismatch {
        /// Rows of this column.
        rows: usize,
        /// Rows of the others.
        others: usize,
    },
    /// The sample rate disagrees with the times.
    #[error(
        "is {} Hz but `time_s` of {file} advances at {} Hz; correct one of them",
        rounded(*declared, 9), rounded(*observed, 7)
    )]
    WrongSampleRate {
        /// The declared rate in Hz.
        declared: f64,
        /// The sample rate of the times in Hz.
        observed: f64,
        /// The file of the times.
        file: String,
    },
    /// Two files of one recording have different sample rates.
    #[error(
        "is {} Hz, that of {file} is {} Hz; if one recorder made both, state its rate with `--sample-rate HZ`, else import \
             them separately",
        rounded(*rate, 7), rounded(*first, 7)
    )]
    OtherSampleRate {
        /// The sample rate of this file in Hz.
        rate: f64,
        /// The sample rate of the first file in Hz.
        first: f64,
        /// The first file.
        file: String,
    },
    /// A step in time differs from the sample interval.
    #[error(
        "the step to row {row} is {} s, but {} s is expected; remove repeated rows, or split \
             the pass at a gap{alternative}",
        rounded(*step, 3),
        rounded(*expected, 3)
    )]
    UnevenTime {
        /// The row, counted from 1, that the step leads to.
        row: usize,
        /// The step in s.
        step: f64,
        /// The sample interval in s.
        expected: f64,
        /// A further remedy.
        alternative: &'static str,
    },
    /// The positions are no motion of a wheel.
    #[error(transparent)]
    Motion(#[from] MotionFault),
    /// A pass is a copy of another pass.
    #[error(
        "is a copy of {of}{}; a copy is no second pass: remove one of the two",
        if (*factor - 1.0).abs() < 1e-6 { String::new() } else { format!(", times {}", significant(*factor, 4)) }
    )]
    Copy {
        /// The other pass's file.
        of: String,
        /// Factor between the samples of the two passes.
        factor: f64,
    },
    /// Two statements about one thing disagree.
    #[error("{says}, but {but}; correct one of them, or omit one")]
    Contradiction {
        /// One of them.
        says: String,
        /// The other one.
        but: String,
    },
    /// The nominal speed disagrees with position and time.
    #[error(
        "is {} km/h but `position_m` of {file} advances at {} km/h; correct one of them",
        rounded(*declared, 5), rounded(*observed, 4)
    )]
    WrongSpeed {
        /// The declared speed in km/h.
        declared: f64,
        /// The mean speed of the positions in km/h.
        observed: f64,
        /// The file of the positions.
        file: String,
    },
    /// The speed of the positions is not plausible for a train.
    #[error(
        "advances at {} km/h in {unit}, which no pass does; {remedy}",
        rounded(*observed, 3)
    )]
    Impossible {
        /// The mean speed of the positions in km/h.
        observed: f64,
        /// The assumed unit.
        unit: &'static str,
        /// Remedy.
        remedy: String,
    },
    /// The sample rate of the times is not plausible for accelerations.
    #[error(
        "advances at {} Hz in {unit}, at which no acceleration is recorded; {remedy}",
        rounded(*observed, 3)
    )]
    ImpossibleRate {
        /// The sample rate of the times in Hz.
        observed: f64,
        /// The assumed unit.
        unit: &'static str,
        /// Remedy.
        remedy: String,
    },
    /// The pass is shorter than a sleeper's window.
    #[error(
        "covers {} m; the window of one sleeper needs {} m: record a longer stretch",
        significant(*length_m, 3), rounded(*spacing_m, 6)
    )]
    TooShort {
        /// The distance covered in m.
        length_m: f64,
        /// The spacing of the sleepers in m.
        spacing_m: f64,
    },
    /// The sleeper that an import states is far from all passes.
    #[error(
        "is {} m, but the passes cover {} to {} m; give the position in m of a sleeper inside \
             them{}",
        rounded(*stated_m, 9), rounded(*from_m, 9), rounded(*to_m, 9),
        guess.map_or_else(String::new, |(x_m, when)| format!(": {} m {when}", rounded(x_m, 9)))
    )]
    SleeperOutside {
        /// The stated position in m.
        stated_m: f64,
        /// Where the passes begin, in m.
        from_m: f64,
        /// Where they end, in m.
        to_m: f64,
        /// A position inside the passes, and when it would be the stated one.
        guess: Option<(f64, &'static str)>,
    },
    /// No sleeper has its window inside any pass.
    #[error(
        "no sleeper lies inside a pass (the passes cover {} to {} m); give their positions \
             on the scale of `position_m`",
        rounded(*from_m, 9), rounded(*to_m, 9)
    )]
    NoSleeperInside {
        /// Where the passes begin, in m.
        from_m: f64,
        /// Where they end, in m.
        to_m: f64,
    },
}

/// What to do with a column that has fewer values than the accelerations.
const FINER: &str = "interpolate positions and speeds to the times of the accelerations (for example with \
                     numpy.interp), or import with --speed instead of this column; leave out rows without \
                     acceleration";

/// What to do if the header is no header.
fn taken_as_header(line: Option<u64>) -> String {
    line.map_or_else(String::new, |line| {
        format!(" (line {line} was taken as the header: delete a title, or begin it with #)")
    })
}

/// "2 and 4", "2, 4 and 5".
fn list(places: &[usize]) -> String {
    let texts: Vec<String> = places.iter().map(usize::to_string).collect();
    match texts.as_slice() {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => texts.concat(),
    }
}
