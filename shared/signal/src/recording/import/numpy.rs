//! NumPy arrays: single ones, columns of a matrix, and archives of several.

use super::super::error::{Fault, RecordingError};
use super::table::{Column, matrix};
use npyz::npz::array_name_from_file_name;
use npyz::{DType, NpyFile, Order};
use std::fs::File;
use std::io::{BufReader, Error, ErrorKind, Read};
use std::path::Path;
use zip::ZipArchive;

/// The columns of a `.npy` file, named `column` or `column-1`, `column-2` ...
pub(super) fn read_array(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let read = || columns(NpyFile::new(BufReader::new(File::open(path)?))?, "column");
    read().map_err(|error| unreadable(path, &error))
}

/// The columns of all numeric arrays of a `.npz` file, named as the arrays.
pub(super) fn read_archive(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let read = || {
        let mut archive = ZipArchive::new(BufReader::new(File::open(path)?))?;
        let mut all = Vec::new();
        for index in 0..archive.len() {
            let entry = archive.by_index(index)?;
            let Some(name) = array_name_from_file_name(&entry.name()?).map(str::to_owned) else {
                continue;
            };
            // Texts and objects are no columns.
            match columns(NpyFile::new(entry)?, &name) {
                Ok(columns) => all.extend(columns),
                Err(error) if error.kind() == ErrorKind::Unsupported => {}
                Err(error) => return Err(error),
            }
        }
        Ok(all)
    };
    read().map_err(|error: Error| unreadable(path, &error))
}

fn unreadable(path: &Path, error: &Error) -> RecordingError {
    RecordingError::new(path, "file", Fault::Unreadable { reason: error.to_string() })
}

fn columns<R: Read>(array: NpyFile<R>, name: &str) -> Result<Vec<Column>, Error> {
    let shape: Vec<usize> = array.shape().iter().map(|&size| size as usize).collect();
    let order = array.order();
    let (rows, width) = match shape[..] {
        [] => (1, 1),
        [rows] => (rows, 1),
        [rows, width] => (rows, width),
        _ => {
            let text = format!("{name} has {} dimensions; give one or two", shape.len());
            return Err(Error::new(ErrorKind::Unsupported, text));
        }
    };
    let values = numbers(array, name)?;
    let value = |row: usize, column: usize| match order {
        Order::C => values[row * width + column],
        Order::Fortran => values[column * rows + row],
    };
    Ok(matrix(name, rows, width, value))
}

fn numbers<R: Read>(array: NpyFile<R>, name: &str) -> Result<Vec<f64>, Error> {
    let kind = array.dtype();
    let DType::Plain(text) = &kind else {
        let text = format!("{name} has fields; save each as an array of its own");
        return Err(Error::new(ErrorKind::Unsupported, text));
    };
    // `<f8`, `>i2` ...: kind and size are the last characters.
    let text = text.to_string();
    match text.trim_start_matches(['<', '>', '|', '=']) {
        "f8" => array.into_vec(),
        "f4" => Ok(array.into_vec::<f32>()?.into_iter().map(f64::from).collect()),
        "i8" => Ok(array.into_vec::<i64>()?.into_iter().map(|value| value as f64).collect()),
        "i4" => Ok(array.into_vec::<i32>()?.into_iter().map(f64::from).collect()),
        "i2" => Ok(array.into_vec::<i16>()?.into_iter().map(f64::from).collect()),
        "u2" => Ok(array.into_vec::<u16>()?.into_iter().map(f64::from).collect()),
        other => {
            let text = format!("{name} holds {other} values; save it as floating-point numbers");
            Err(Error::new(ErrorKind::Unsupported, text))
        }
    }
}
