//! Errors of reading a file of a hammer test.

use tracktwin_parameters::QuantityError;

/// A line that cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct ReadError {
    /// Line number, from 1.
    pub line: u64,
    /// Fault in this line.
    pub fault: ReadFault,
}

/// Fault in a line; every message ends with the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReadFault {
    /// The rows do not form a table.
    #[error("not a table of comma-separated values ({reason}); write one row a line")]
    Table {
        /// Message of the CSV parser.
        reason: String,
    },
    /// A column name is unknown.
    #[error("column `{name}` is not known; the columns are {known}")]
    UnknownColumn {
        /// Name of the column.
        name: String,
        /// Names of the known columns.
        known: String,
    },
    /// A required column is missing.
    #[error("column `{name}` is missing; the columns are {known}")]
    MissingColumn {
        /// Name of the column.
        name: &'static str,
        /// Names of all columns.
        known: String,
    },
    /// Two columns have the same name.
    #[error("column `{name}` is there twice; leave one out")]
    RepeatedColumn {
        /// Name of the columns.
        name: String,
    },
    /// A position is outside its permitted range.
    #[error(transparent)]
    Place(#[from] QuantityError),
    /// A field that must be a number holds other text.
    #[error("{column}: `{text}` is not a finite number")]
    Number {
        /// The column or field.
        column: &'static str,
        /// The beginning of the text.
        text: String,
    },
    /// A number is outside its permitted range.
    #[error("{column} is {value}; it must be {form}")]
    Value {
        /// The column or field.
        column: &'static str,
        /// The value.
        value: f64,
        /// Permitted range.
        form: &'static str,
    },
    /// Frequencies or times are not ascending.
    #[error("{column} {value} does not ascend; sort the rows of a receptance or a hit")]
    NotAscending {
        /// The column.
        column: &'static str,
        /// The value.
        value: f64,
    },
    /// The time steps of a file are not equal.
    #[error("the time step is {step_s} s, the usual one is {usual_s} s; sample in equal steps")]
    UnevenTime {
        /// The time step at this line in s.
        step_s: f64,
        /// The median time step of the hit, or the time step of the first hit, in s.
        usual_s: f64,
    },
    /// A hit has too few samples.
    #[error("a hit of {samples} samples is too short; record at least {least} samples a hit")]
    ShortHit {
        /// Number of samples.
        samples: usize,
        /// Smallest number of samples.
        least: usize,
    },
    /// A hit is much shorter than the others at its place.
    #[error(
        "the hit has {samples} samples, the others at its place have more, and all would be cut to its length: leave it \
         out, or record at least {least} samples"
    )]
    CutHit {
        /// Number of samples.
        samples: usize,
        /// Smallest number of samples.
        least: usize,
    },
    /// The force of a hit is zero.
    #[error("the force of the hit is zero; check the channel of the hammer")]
    NoForce,
    /// The response to a hit is zero.
    #[error("the acceleration of all hits is zero; check the channel of the sensor")]
    NoResponse,
    /// The file contains no receptance.
    #[error("the file holds no receptance; {remedy}")]
    Nothing {
        /// Remedy.
        remedy: &'static str,
    },
    /// The file ends within a dataset.
    #[error("the file ends within dataset {dataset}; export it again")]
    Truncated {
        /// Number of the dataset type.
        dataset: u32,
    },
    /// The file contains a binary dataset.
    #[error("the dataset is binary (58b); export it as ASCII (58)")]
    Binary,
    /// The units are not SI units.
    #[error("the units are those of code {code} (dataset 164); export in SI units, code 1")]
    Units {
        /// Code of the units.
        code: u64,
    },
    /// A response function is not a point receptance.
    #[error("{what}; {remedy}")]
    Function {
        /// Description of the function.
        what: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// The position of a node is unknown.
    #[error("node {node} has no position; add dataset 15 to the file or give --node {node}=METRES")]
    Node {
        /// Number of the node.
        node: u64,
    },
}

impl ReadError {
    /// Converts an error of the CSV parser.
    pub(super) fn of_table(error: &csv::Error) -> Self {
        let line = error.position().map_or(1, csv::Position::line);
        Self { line, fault: ReadFault::Table { reason: error.to_string() } }
    }
}
