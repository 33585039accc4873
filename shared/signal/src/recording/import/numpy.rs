//! NumPy arrays: single ones, columns of a matrix, and archives of several.

use super::super::error::{Fault, RecordingError};
use super::column::{Column, matrix, other};
use npyz::npz::array_name_from_file_name;
use npyz::{DType, NpyFile, Order};
use std::fs::File;
use std::io::{BufReader, Cursor, Error, ErrorKind, Read};
use std::path::Path;
use zip::ZipArchive;

/// Longest head of an array: shape and kind take some hundred bytes.
const HEAD_BYTES_MAX: u64 = 1 << 16;

/// The columns of a `.npy` file, named `column` or `column-1`, `column-2` ...
pub(super) fn read_array(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let read = || {
        let file = File::open(path)?;
        let bytes = file.metadata()?.len();
        columns(array(BufReader::new(file), bytes)?, "column")
    };
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
            let bytes = entry.size();
            all.extend(columns(array(entry, bytes)?, &name)?);
        }
        Ok(all)
    };
    read().map_err(|error: Error| unreadable(path, &error))
}

fn unreadable(path: &Path, error: &Error) -> RecordingError {
    RecordingError::new(path, "file", Fault::Unreadable { reason: error.to_string() })
}

/// The array in these bytes, after checking that its header states no more numbers than they hold,
/// because the reader trusts the header.
fn array<R: Read>(mut file: R, bytes: u64) -> Result<NpyFile<impl Read>, Error> {
    let bad = |what: &str| Error::new(ErrorKind::InvalidData, what.to_owned());
    // Magic, version, and the head's length in two bytes, from version 2 on in four.
    let mut head = vec![0; 10];
    file.read_exact(&mut head)?;
    if head[6] > 1 {
        head.resize(12, 0);
        file.read_exact(&mut head[10..])?;
    }
    let length = head[8..].iter().rev().fold(0, |length, &byte| (length << 8) | u64::from(byte));
    (&mut file).take(length.min(HEAD_BYTES_MAX)).read_to_end(&mut head)?;
    let text = String::from_utf8_lossy(&head);
    let shape = text.split_once("'shape'").and_then(|(_, rest)| rest.split_once(')'));
    let (shape, _) = shape.ok_or_else(|| bad("its header has no shape"))?;
    let mut sizes = shape.split([':', '(', ',']).filter_map(|size| size.trim().parse::<u64>().ok());
    let numbers = sizes.try_fold(1, u64::checked_mul);
    if numbers.is_none_or(|numbers| numbers > bytes) {
        return Err(bad("its header states more numbers than the file holds"));
    }
    NpyFile::new(Cursor::new(head).chain(file))
}

fn columns<R: Read>(array: NpyFile<R>, name: &str) -> Result<Vec<Column>, Error> {
    if let DType::Record(fields) = array.dtype() {
        let kind = "a field of records: save it as a separate array";
        return Ok(fields.iter().map(|field| other(&field.name, kind)).collect());
    }
    let shape: Vec<usize> = array.shape().iter().map(|&size| size as usize).collect();
    let order = array.order();
    let (rows, width) = match shape[..] {
        [] => (1, 1),
        [rows] => (rows, 1),
        [rows, width] => (rows, width),
        _ => return Ok(vec![other(name, "an array of more than two dimensions")]),
    };
    let values = match numbers(array)? {
        Ok(values) => values,
        Err(kind) => return Ok(vec![other(name, kind)]),
    };
    let value = |row: usize, column: usize| match order {
        Order::C => values[row * width + column],
        Order::Fortran => values[column * rows + row],
    };
    Ok(matrix(name, rows, width, value))
}

/// The values as numbers, or what they are instead.
fn numbers<R: Read>(array: NpyFile<R>) -> Result<Result<Vec<f64>, String>, Error> {
    fn all<T: Copy>(values: Vec<T>, number: impl Fn(T) -> f64) -> Vec<f64> {
        values.into_iter().map(number).collect()
    }
    let DType::Plain(text) = array.dtype() else {
        return Ok(Err("nested arrays".to_owned()));
    };
    // `<f8`, `>i2` ...: kind and size are the last characters.
    let text = text.to_string();
    let kind = text.trim_start_matches(['<', '>', '|', '=']);
    Ok(Ok(match kind {
        "f8" => array.into_vec()?,
        "f4" => all(array.into_vec::<f32>()?, f64::from),
        "f2" => all(array.into_vec::<half::f16>()?, f64::from),
        "i8" => all(array.into_vec::<i64>()?, |value| value as f64),
        "i4" => all(array.into_vec::<i32>()?, f64::from),
        "i2" => all(array.into_vec::<i16>()?, f64::from),
        "i1" => all(array.into_vec::<i8>()?, f64::from),
        "u8" => all(array.into_vec::<u64>()?, |value| value as f64),
        "u4" => all(array.into_vec::<u32>()?, f64::from),
        "u2" => all(array.into_vec::<u16>()?, f64::from),
        "u1" => all(array.into_vec::<u8>()?, f64::from),
        _ => return Ok(Err(other_kind(kind))),
    }))
}

/// Type of values that are not real numbers.
fn other_kind(kind: &str) -> String {
    match kind.chars().next() {
        Some('c') => "complex numbers: save the real part or the magnitude".to_owned(),
        Some('b') => "Boolean values".to_owned(),
        Some('O') => "Python objects: save them with `astype(float)`".to_owned(),
        Some('U' | 'S' | 'a') => "texts".to_owned(),
        Some('m' | 'M') => {
            format!(
                "{kind} values: save times in seconds, for example `t / numpy.timedelta64(1, 's')`"
            )
        }
        _ => format!("{kind} values"),
    }
}
