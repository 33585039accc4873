//! Numeric arrays of MATLAB files of version 5 to 7.

use super::super::error::{Fault, RecordingError};
use super::table::{Column, matrix};
use matfile::{Array, MatFile, NumericData};
use std::fs::File;
use std::path::Path;

/// The columns of all real numeric arrays, named as the arrays.
pub(super) fn read(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let unreadable =
        |reason: String| RecordingError::new(path, "file", Fault::Unreadable { reason });
    let file = File::open(path).map_err(|error| unreadable(error.to_string()))?;
    let file = MatFile::parse(file).map_err(|error| {
        unreadable(format!("{error}; files of version 7.3 must be saved anew with `save -v7`"))
    })?;
    Ok(file.arrays().iter().flat_map(columns).collect())
}

fn columns(array: &Array) -> Vec<Column> {
    let [rows, width] = array.size()[..] else { return Vec::new() };
    let values = numbers(array.data());
    // Stored column by column.
    matrix(array.name(), rows, width, |row, column| values[column * rows + row])
}

fn numbers(data: &NumericData) -> Vec<f64> {
    fn all<T: Copy>(values: &[T], number: impl Fn(T) -> f64) -> Vec<f64> {
        values.iter().map(|&value| number(value)).collect()
    }
    match data {
        NumericData::Double { real, .. } => real.clone(),
        NumericData::Single { real, .. } => all(real, f64::from),
        NumericData::Int8 { real, .. } => all(real, f64::from),
        NumericData::UInt8 { real, .. } => all(real, f64::from),
        NumericData::Int16 { real, .. } => all(real, f64::from),
        NumericData::UInt16 { real, .. } => all(real, f64::from),
        NumericData::Int32 { real, .. } => all(real, f64::from),
        NumericData::UInt32 { real, .. } => all(real, f64::from),
        NumericData::Int64 { real, .. } => all(real, |value| value as f64),
        NumericData::UInt64 { real, .. } => all(real, |value| value as f64),
    }
}
