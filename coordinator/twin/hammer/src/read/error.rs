//! Why a file of a hammer test is refused.

use tracktwin_parameters::QuantityError;

/// A line that cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct ReadError {
    /// The line, from 1.
    pub line: u64,
    /// What is wrong.
    pub fault: ReadFault,
}

/// What is wrong with a line; each ends with the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReadFault {
    /// The rows are not those of a table.
    #[error("not a table of comma-separated values ({reason}); write one row a line")]
    Table {
        /// What the parser says.
        reason: String,
    },
    /// A column whose meaning is not known.
    #[error("column `{name}` is not known; the columns are {known}")]
    UnknownColumn {
        /// Its name.
        name: String,
        /// Names of the known ones.
        known: String,
    },
    /// A column is missing.
    #[error("column `{name}` is missing; the columns are {known}")]
    MissingColumn {
        /// Its name.
        name: &'static str,
        /// Names of all columns.
        known: String,
    },
    /// Two columns have one name.
    #[error("column `{name}` is there twice; leave one out")]
    RepeatedColumn {
        /// Their name.
        name: String,
    },
    /// A position that cannot be.
    #[error(transparent)]
    Place(#[from] QuantityError),
    /// A text stands where a number must stand.
    #[error("{column}: `{text}` is not a finite number")]
    Number {
        /// The column or field.
        column: &'static str,
        /// The beginning of the text.
        text: String,
    },
    /// A number is not one of its kind.
    #[error("{column} is {value}; it must be {form}")]
    Value {
        /// The column or field.
        column: &'static str,
        /// The value.
        value: f64,
        /// What it must be.
        form: &'static str,
    },
    /// Frequencies or times do not ascend.
    #[error("{column} {value} does not ascend; sort the rows of a receptance or a hit")]
    NotAscending {
        /// The column.
        column: &'static str,
        /// The value.
        value: f64,
    },
    /// Time steps differ.
    #[error("the time step is {step_s} s, the usual one is {usual_s} s; sample in equal steps")]
    UnevenTime {
        /// The step here in s.
        step_s: f64,
        /// The usual step, or that of the first hit, in s.
        usual_s: f64,
    },
    /// A hit is too short, or there is none.
    #[error("a hit of {samples} samples is too short; record at least {least} samples a hit")]
    ShortHit {
        /// Its samples.
        samples: usize,
        /// Least samples.
        least: usize,
    },
    /// A hit without force.
    #[error("the force of the hit is zero; check the channel of the hammer")]
    NoForce,
    /// A hit without response.
    #[error("the acceleration of all hits is zero; check the channel of the sensor")]
    NoResponse,
    /// A file without a receptance.
    #[error("the file holds no receptance; {remedy}")]
    Nothing {
        /// What to do.
        remedy: &'static str,
    },
    /// The file ends within a dataset.
    #[error("the file ends within dataset {dataset}; export it again")]
    Truncated {
        /// Type of the dataset.
        dataset: u32,
    },
    /// A binary dataset.
    #[error("the dataset is binary (58b); export it as ASCII (58)")]
    Binary,
    /// Units other than those of the SI.
    #[error("the units are those of code {code} (dataset 164); export in SI units, code 1")]
    Units {
        /// The code.
        code: u64,
    },
    /// A response function that is no point receptance.
    #[error("{what}; {remedy}")]
    Function {
        /// What it is.
        what: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A node without a place.
    #[error("node {node} has no position; add dataset 15 to the file or give --node {node}=METRES")]
    Node {
        /// Its number.
        node: u64,
    },
}

impl ReadError {
    /// The error of a table's parser.
    pub(super) fn of_table(error: &csv::Error) -> Self {
        let line = error.position().map_or(1, csv::Position::line);
        Self { line, fault: ReadFault::Table { reason: error.to_string() } }
    }
}
