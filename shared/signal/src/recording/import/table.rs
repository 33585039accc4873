//! Named columns of numbers, whatever kind of file they come from.

use super::super::error::{Fault, RecordingError};
use super::super::{limits, parquet_file};
use super::{csv_table, matlab, numpy};
use std::path::{Path, PathBuf};

/// A column of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// Its name in the file, or `column-1`, `column-2` ... where the file has none.
    pub name: String,
    /// Its values; not-a-number where the file has something else.
    pub values: Vec<f64>,
    /// The first value that is no number, with its row counted from 1.
    pub oddity: Option<(usize, String)>,
}

/// A file's columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The file.
    pub path: PathBuf,
    /// Its columns, in the file's order.
    pub columns: Vec<Column>,
}

impl Table {
    /// Reads a `.csv`, `.txt`, `.parquet`, `.npy`, `.npz` or `.mat` file.
    ///
    /// # Errors
    /// [`Fault::NoSuchFile`], [`Fault::UnknownTable`] or [`Fault::Unreadable`].
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        if !path.is_file() {
            return Err(RecordingError::new(path, "file", Fault::NoSuchFile));
        }
        limits::file(path)?;
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let columns = match ending.to_ascii_lowercase().as_str() {
            "csv" | "txt" | "dat" | "tsv" => csv_table::read(path)?,
            "parquet" => parquet_file::read_all(path)?,
            "npy" => numpy::read_array(path)?,
            "npz" => numpy::read_archive(path)?,
            "mat" => matlab::read(path)?,
            _ => return Err(RecordingError::new(path, "file", Fault::UnknownTable)),
        };
        Ok(Self { path: path.to_owned(), columns })
    }

    /// The column of that name: all finite, at least two values.
    ///
    /// # Errors
    /// [`Fault::NoColumn`] with the names there are, [`Fault::NotFinite`] with the row, or
    /// [`Fault::Empty`].
    pub fn column(&self, name: &str) -> Result<&[f64], RecordingError> {
        let fault = |fault| RecordingError::new(&self.path, name, fault);
        let column = self.columns.iter().find(|column| column.name == name).ok_or_else(|| {
            let present = self.columns.iter().map(|column| column.name.clone()).collect();
            fault(Fault::NoColumn { present })
        })?;
        if let Some((row, value)) = &column.oddity {
            return Err(fault(Fault::NotFinite { row: *row, value: format!("\"{value}\"") }));
        }
        if column.values.len() < 2 {
            return Err(fault(Fault::Empty { rows: column.values.len() }));
        }
        match column.values.iter().position(|value| !value.is_finite()) {
            Some(row) => {
                let value = column.values[row].to_string();
                Err(fault(Fault::NotFinite { row: row + 1, value }))
            }
            None => Ok(&column.values),
        }
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
        oddity: None,
    };
    (0..width).map(column).collect()
}
