//! Columns of numbers in files.

/// A column of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// Name of the column in the file, or `column-1`, `column-2` ... if the file has no names.
    pub name: String,
    /// Values of the column; NaN where the file has no number.
    pub values: Vec<f64>,
    /// Reason why the column is not numeric, if it is not.
    pub oddity: Option<Oddity>,
    /// Unit of the column, if the file states one.
    pub unit: Option<String>,
}

/// Reason why a column is not numeric.
#[derive(Clone, Debug, PartialEq)]
pub enum Oddity {
    /// The first value that is not a number.
    Value {
        /// Its row, counted from 1.
        row: usize,
        /// Its text.
        text: String,
    },
    /// The whole column holds something else, such as complex numbers.
    Kind(String),
}

/// Content of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Content {
    /// Columns in the order of the file.
    pub columns: Vec<Column>,
    /// Assumptions made while reading, one sentence each.
    pub notes: Vec<String>,
    /// The line of a text file that was taken as the header.
    pub header: Option<u64>,
}

impl From<Vec<Column>> for Content {
    fn from(columns: Vec<Column>) -> Self {
        Self { columns, ..Self::default() }
    }
}

/// Columns of a matrix by their numbers, or the single one under the name itself.
///
/// `value` gives row and column. A matrix that is wider than high is taken to lie on its side.
pub(super) fn matrix(
    name: &str,
    rows: usize,
    columns: usize,
    value: impl Fn(usize, usize) -> f64,
) -> Vec<Column> {
    let lying = columns > rows;
    let (length, width) = if lying { (columns, rows) } else { (rows, columns) };
    let at =
        |row: usize, column: usize| if lying { value(column, row) } else { value(row, column) };
    let column = |index: usize| Column {
        name: if width == 1 { name.to_owned() } else { format!("{name}-{}", index + 1) },
        values: (0..length).map(|row| at(row, index)).collect(),
        ..Column::default()
    };
    (0..width).map(column).collect()
}

/// A column that holds something else than real numbers.
pub(super) fn other(name: &str, kind: impl Into<String>) -> Column {
    let oddity = Some(Oddity::Kind(kind.into()));
    Column { name: name.to_owned(), oddity, ..Column::default() }
}
