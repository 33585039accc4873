//! Numeric arrays of MATLAB files of version 5 to 7.

use super::super::error::{Fault, RecordingError};
use super::column::{Column, matrix, other};
use super::mat_listing::{Variable, list};
use matfile::{Array, MatFile, NumericData};
use std::path::Path;

/// The columns of all arrays, with the names of the arrays. Arrays that are not real numbers are
/// included with their type.
pub(super) fn read(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let unreadable =
        |reason: String| RecordingError::new(path, "file", Fault::Unreadable { reason });
    let bytes = std::fs::read(path).map_err(|error| unreadable(error.to_string()))?;
    let variables = list(&bytes);
    let opaque = variables.iter().find(|variable| variable.is_opaque());
    let file = MatFile::parse(bytes.as_slice()).map_err(|error| match opaque {
        Some(variable) => RecordingError::new(
            path,
            variable.name.as_str(),
            Fault::NotNumeric { kind: variable.kind().unwrap_or_default() },
        ),
        None => {
            unreadable(format!("{error}; save files of version 4 or 7.3 again with `save -v7`"))
        }
    })?;
    let odd = |name: &str| variables.iter().find(|v| v.name == name).and_then(Variable::kind);
    let mut columns: Vec<Column> = file
        .arrays()
        .iter()
        .filter(|array| odd(array.name()).is_none())
        .flat_map(columns)
        .collect();
    columns.extend(variables.iter().filter_map(|v| Some(other(&v.name, v.kind()?))));
    Ok(columns)
}

fn columns(array: &Array) -> Vec<Column> {
    let [rows, width] = array.size()[..] else {
        return vec![other(array.name(), "an array of more than two dimensions")];
    };
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
