//! Columns of numbers as files hold them.

/// A column of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// Its name in the file, or `column-1`, `column-2` ... where the file has none.
    pub name: String,
    /// Its values; not-a-number where the file has something else.
    pub values: Vec<f64>,
    /// What in it is no number.
    pub oddity: Option<Oddity>,
    /// Its unit, if the file states it beside the name.
    pub unit: Option<String>,
}

/// Reason why a column is not numeric.
#[derive(Clone, Debug, PartialEq)]
pub enum Oddity {
    /// The first value that is no number.
    Value {
        /// Its row, counted from 1.
        row: usize,
        /// Its text.
        text: String,
    },
    /// The whole column holds something else, such as complex numbers.
    Kind(String),
}

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Content {
    /// Its columns, in the file's order.
    pub columns: Vec<Column>,
    /// What was assumed on reading it, a sentence each.
    pub notes: Vec<String>,
}

impl From<Vec<Column>> for Content {
    fn from(columns: Vec<Column>) -> Self {
        Self { columns, notes: Vec::new() }
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
