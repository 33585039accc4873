//! What may be wrong with a recording: file, field, what, and how to mend it, on one line.

use std::path::Path;
use tracktwin_parameters::QuantityError;

/// A recording that cannot be used, in one line: `FILE: FIELD: what; how to mend`.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {field}: {fault}")]
pub struct RecordingError {
    /// The file that is at fault.
    pub file: String,
    /// The field, column or row of that file.
    pub field: String,
    /// What is wrong with it.
    pub fault: Fault,
}

impl RecordingError {
    pub(super) fn new(file: &Path, field: impl Into<String>, fault: Fault) -> Self {
        Self { file: file.display().to_string(), field: field.into(), fault }
    }
}

/// What is wrong with a field of a recording, and how to mend it.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// Nothing lies where a file should.
    #[error("there is no such file; put it there or correct its name")]
    NoSuchFile,
    /// The operating system or the decoder refuses the file.
    #[error("cannot be read ({reason}); write it anew from its source")]
    Unreadable {
        /// The words of the operating system or of the decoder.
        reason: String,
    },
    /// A number can't be what it is given for.
    #[error("{0}")]
    OutOfRange(QuantityError),
    /// A file has more numbers than are held in memory.
    #[error(
        "has {:.1} GB of numbers, and {:.1} GB are the most that is held at once; split it into passes",
        1e-9 * *bytes as f64, 1e-9 * *most as f64
    )]
    TooLarge {
        /// Bytes of its numbers.
        bytes: u64,
        /// The most.
        most: u64,
    },
    /// A pass's file lies outside the recording's folder.
    #[error("{reason}")]
    OtherFolder {
        /// What is wrong with the name.
        reason: String,
    },
    /// `recording.json` is not JSON.
    #[error("is not JSON ({reason}); mend the text there")]
    NotJson {
        /// The parser's words, with line and column.
        reason: String,
    },
    /// The format's name is absent or another one.
    #[error("says {found}; this program reads \"{expected}\"")]
    WrongFormat {
        /// What stands there, as JSON.
        found: String,
        /// The name that is understood.
        expected: &'static str,
    },
    /// A field that is needed is absent.
    #[error("is missing; add {expected}")]
    NoField {
        /// What should stand there.
        expected: String,
    },
    /// A field holds another kind of value.
    #[error("is {found}; give {expected}")]
    WrongValue {
        /// What stands there, as JSON.
        found: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// Two sleepers bear one name.
    #[error("the id {id} stands twice; give every sleeper its own")]
    SleeperTwice {
        /// The name.
        id: String,
    },
    /// A file stands where a folder should.
    #[error("is a file; a recording is a folder, and `tracktwin import` makes one")]
    NoFolder,
    /// Columns of a CSV file are separated by something else than commas.
    #[error("its columns are not separated by commas; do so, or run `tracktwin import`")]
    Separator,
    /// The kind of file is not one that is read.
    #[error("its name ends in neither .parquet nor .csv; convert it to one of these")]
    UnknownKind,
    /// The kind of table is not one that can be imported.
    #[error(
        "its name ends in none of .csv .txt .tsv .dat .parquet .npy .npz .mat; convert it to one of these"
    )]
    UnknownTable,
    /// A column that is needed is absent.
    #[error("there is no such column; name it so (the file has {})", present.join(", "))]
    NoColumn {
        /// The columns that are there.
        present: Vec<String>,
    },
    /// A column holds something else than numbers.
    #[error("holds {kind}; store it as numbers")]
    NotNumeric {
        /// What it holds.
        kind: String,
    },
    /// A value is not a finite number; rows count from 1, the first row of data.
    #[error("row {row} is {value}; drop or mend that stretch")]
    NotFinite {
        /// The row, counted from 1.
        row: usize,
        /// The value, as written.
        value: String,
    },
    /// The file has no rows, or a single one.
    #[error("has {rows} row{}; a pass needs at least two", if *rows == 1 { "" } else { "s" })]
    Empty {
        /// How many there are.
        rows: usize,
    },
    /// Columns of one file differ in length.
    #[error("has {rows} rows where the file's other columns have {others}; write them alike")]
    LengthMismatch {
        /// Rows of this column.
        rows: usize,
        /// Rows of the others.
        others: usize,
    },
    /// The sample rate disagrees with the times.
    #[error(
        "is {declared} Hz but `time_s` of {file} advances at {observed:.6} Hz; correct one of them"
    )]
    WrongSampleRate {
        /// The declared rate in Hz.
        declared: f64,
        /// The rate in Hz that the times say.
        observed: f64,
        /// The file of the times.
        file: String,
    },
    /// A step in time differs from the sample interval.
    #[error(
        "steps by {step:.3e} s to row {row} where {expected:.3e} s is expected; resample evenly or split the pass there"
    )]
    UnevenTime {
        /// The row, counted from 1, that the step leads to.
        row: usize,
        /// The step in s.
        step: f64,
        /// The sample interval in s.
        expected: f64,
    },
    /// The position decreases.
    #[error(
        "runs back from {before} m to {after} m at row {row}; positions must not decrease (turn a backward pass round)"
    )]
    RunsBack {
        /// The row, counted from 1, where it does.
        row: usize,
        /// The position in m one row earlier.
        before: f64,
        /// The position in m of that row.
        after: f64,
    },
    /// The nominal speed disagrees with position and time.
    #[error(
        "is {declared} km/h but `position_m` of {file} advances at {observed:.3} km/h; correct one of them"
    )]
    WrongSpeed {
        /// The declared speed in km/h.
        declared: f64,
        /// The mean speed in km/h that the positions say.
        observed: f64,
        /// The file of the positions.
        file: String,
    },
    /// The positions advance at a speed that no train has.
    #[error(
        "advance at {observed:.1} km/h, which no pass does; check their unit, and turn a backward pass round"
    )]
    Impossible {
        /// The mean speed in km/h that the positions say.
        observed: f64,
    },
    /// The pass is shorter than a sleeper's window.
    #[error("covers {length_m:.4} m; one sleeper's window needs {spacing_m} m, record more")]
    TooShort {
        /// The distance covered in m.
        length_m: f64,
        /// The spacing of the sleepers in m.
        spacing_m: f64,
    },
    /// No sleeper has its window inside any pass.
    #[error(
        "none lies inside a pass (passes cover {from_m} to {to_m} m); give them on the scale of `position_m`"
    )]
    NoSleeperInside {
        /// Where the passes begin, in m.
        from_m: f64,
        /// Where they end, in m.
        to_m: f64,
    },
}
