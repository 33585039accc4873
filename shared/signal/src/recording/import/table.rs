//! Named columns of numbers, independent of the file format.

use super::super::columns::{not_finite, sparse};
use super::super::error::{Fault, RecordingError};
use super::super::{limits, parquet_file};
use super::column::{Column, Content, Oddity};
use super::unit::bare_name;
use super::{csv_table, foreign, matlab, numpy};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes by whose beginning a kind of file is known.
const BEGIN_BYTES: u64 = 64;
/// Numbers that loggers write for what was not measured.
const MISSING: [f64; 8] = [999.0, 999.25, 9999.0, 99_999.0, 999_999.0, 9_999_999.0, 1e30, 1e35];
/// Times the span of all other values by which such a number is away from them.
const FAR: f64 = 3.0;

/// Columns of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The file.
    pub path: PathBuf,
    /// Columns in the order of the file.
    pub columns: Vec<Column>,
    /// Assumptions made while reading, one sentence each.
    pub notes: Vec<String>,
    /// The line of a text file that was taken as the header.
    pub header: Option<u64>,
}

impl Table {
    /// Reads a `.csv`, `.txt`, `.parquet`, `.npy`, `.npz` or `.mat` file.
    ///
    /// # Errors
    /// [`Fault::NoSuchFile`], [`Fault::Foreign`], [`Fault::UnknownTable`] or a fault of the content.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let fail = |fault| RecordingError::new(path, "file", fault);
        if !path.is_file() {
            return Err(fail(Fault::NoSuchFile));
        }
        limits::file(path)?;
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let ending = ending.to_ascii_lowercase();
        if let Some(fault) = foreign::fault(&begin(path)?, &ending, ending == "npz") {
            return Err(fail(fault));
        }
        let content = match ending.as_str() {
            "csv" | "txt" | "dat" | "tsv" => csv_table::read(path)?,
            "parquet" => parquet_file::read_all(path)?.into(),
            "npy" => numpy::read_array(path)?.into(),
            "npz" => numpy::read_archive(path)?.into(),
            "mat" => matlab::read(path)?.into(),
            _ => return Err(fail(Fault::UnknownTable)),
        };
        if content.columns.is_empty() {
            return Err(fail(Fault::Empty { rows: 0 }));
        }
        let Content { columns, notes, header } = content;
        Ok(Self { path: path.to_owned(), columns, notes, header })
    }

    /// The column with this name, with or without a unit in the file. All values are finite, and there
    /// are at least two.
    ///
    /// # Errors
    /// [`Fault::NoColumn`] with the names there are, [`Fault::ColumnTwice`], [`Fault::NotNumeric`],
    /// [`Fault::NotFinite`] or [`Fault::Missing`] with the row, [`Fault::Sparse`], or [`Fault::Empty`].
    pub(super) fn column(&self, name: &str) -> Result<&Column, RecordingError> {
        let fault = |fault| RecordingError::new(&self.path, name, fault);
        let column = self.find(name).map_err(fault)?;
        check(column).map_or(Ok(column), |found| Err(fault(found)))
    }

    fn find(&self, name: &str) -> Result<&Column, Fault> {
        let places = |is_it: &dyn Fn(&str) -> bool| -> Vec<usize> {
            let named = self.columns.iter().enumerate().filter(|(_, column)| is_it(&column.name));
            named.map(|(index, _)| index).collect()
        };
        let exact = places(&|other| other == name);
        let found =
            if exact.is_empty() { places(&|other| bare_name(other) == name) } else { exact };
        match found[..] {
            [index] => Ok(&self.columns[index]),
            [] => {
                let present = self.columns.iter().map(|column| column.name.clone()).collect();
                Err(Fault::NoColumn { present, header: self.header })
            }
            _ => Err(Fault::ColumnTwice { places: found.iter().map(|index| index + 1).collect() }),
        }
    }
}

/// What is wrong with the values of a column.
fn check(column: &Column) -> Option<Fault> {
    match &column.oddity {
        Some(Oddity::Kind(kind)) => return Some(Fault::NotNumeric { kind: kind.clone() }),
        Some(Oddity::Value { row, text }) => {
            if let Some(sparse) = sparse(&column.values) {
                return Some(sparse);
            }
            return Some(Fault::NotFinite { row: *row, value: format!("\"{text}\"") });
        }
        None => {}
    }
    if column.values.len() < 2 {
        return Some(Fault::Empty { rows: column.values.len() });
    }
    let values = &column.values;
    sparse(values).or_else(|| not_finite(values)).or_else(|| missing(values))
}

/// A code for a missing value: a number far from all others.
fn missing(values: &[f64]) -> Option<Fault> {
    let is_sign = |value: &f64| MISSING.iter().any(|sign| (value.abs() / sign - 1.0).abs() < 1e-6);
    let row = values.iter().position(is_sign)?;
    let others = values.iter().filter(|value| !is_sign(value));
    let ends = others.fold([f64::INFINITY, f64::NEG_INFINITY], |e, &v| [e[0].min(v), e[1].max(v)]);
    let span = ends[1] - ends[0];
    let value = values[row];
    let away = if value > 0.0 { value - ends[1] } else { ends[0] - value };
    (away > FAR * span && span >= 0.0).then_some(Fault::Missing { row: row + 1, value })
}

/// The first bytes of a file.
fn begin(path: &Path) -> Result<Vec<u8>, RecordingError> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(BEGIN_BYTES).read_to_end(&mut bytes));
    read.map_err(|error| {
        RecordingError::new(path, "file", Fault::Unreadable { reason: error.to_string() })
    })?;
    Ok(bytes)
}
