//! Columns of numbers in Parquet files; knows nothing of what they mean.

use super::error::{Fault, RecordingError};
use super::import::Column;
use parquet::basic::{Compression, Encoding, Repetition, Type as PhysicalType, ZstdLevel};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{DataType, DoubleType, FloatType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Reads the named columns; other columns are passed over and nulls become not-a-number.
pub(super) fn read<const N: usize>(
    path: &Path,
    names: &[&str; N],
) -> Result<[Vec<f64>; N], RecordingError> {
    let unreadable = |reason: String| Fault::Unreadable { reason };
    let file = File::open(path)
        .map_err(|error| RecordingError::new(path, "file", unreadable(error.to_string())))?;
    let reader = SerializedFileReader::new(file)
        .map_err(|error| RecordingError::new(path, "file", unreadable(error.to_string())))?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let present: Vec<String> =
        schema.columns().iter().map(|column| column.path().string()).collect();
    let mut columns = [const { Vec::new() }; N];
    for (column, name) in columns.iter_mut().zip(names) {
        let place = present.iter().position(|candidate| candidate == name).ok_or_else(|| {
            RecordingError::new(path, *name, Fault::NoColumn { present: present.clone() })
        })?;
        *column = column_values(&reader, place)
            .map_err(|error| RecordingError::new(path, *name, unreadable(error.to_string())))?
            .ok_or_else(|| {
                let kind = format!("{} values", schema.column(place).physical_type());
                RecordingError::new(path, *name, Fault::NotNumeric { kind })
            })?;
    }
    Ok(columns)
}

/// Reads all columns that hold numbers.
pub(super) fn read_all(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let unreadable = |error: ParquetError| {
        RecordingError::new(path, "file", Fault::Unreadable { reason: error.to_string() })
    };
    let file = File::open(path).map_err(|error| unreadable(error.into()))?;
    let reader = SerializedFileReader::new(file).map_err(unreadable)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let mut columns = Vec::new();
    for (place, column) in schema.columns().iter().enumerate() {
        if let Some(values) = column_values(&reader, place).map_err(unreadable)? {
            columns.push(Column { name: column.path().string(), values, oddity: None });
        }
    }
    Ok(columns)
}

/// All values of the column at `place`, or none if they are not numbers.
fn column_values(
    reader: &SerializedFileReader<File>,
    place: usize,
) -> Result<Option<Vec<f64>>, ParquetError> {
    let mut values = Vec::new();
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group)?;
        let rows = usize::try_from(group.metadata().num_rows()).unwrap_or_default();
        match group.get_column_reader(place)? {
            ColumnReader::DoubleColumnReader(column) => {
                append(column, rows, |value| value, &mut values)?;
            }
            ColumnReader::FloatColumnReader(column) => {
                append(column, rows, f64::from, &mut values)?;
            }
            ColumnReader::Int32ColumnReader(column) => {
                append(column, rows, f64::from, &mut values)?;
            }
            ColumnReader::Int64ColumnReader(column) => {
                append(column, rows, |value| value as f64, &mut values)?;
            }
            _ => return Ok(None),
        }
    }
    Ok(Some(values))
}

/// Appends the `rows` values of one row group's column.
fn append<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: usize,
    number: impl Fn(T::T) -> f64,
    into: &mut Vec<f64>,
) -> Result<(), ParquetError> {
    let (mut values, mut levels) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
    while levels.len().max(values.len()) < rows {
        let (records, _, _) = reader.read_records(rows, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            break;
        }
    }
    // A required column has no levels: every value is there.
    let mut present = values.into_iter().map(number);
    if levels.is_empty() {
        into.extend(present);
    } else {
        let defined = levels.iter().copied().max().unwrap_or_default().max(1);
        into.extend(levels.iter().map(|&level| {
            if level == defined { present.next().unwrap_or(f64::NAN) } else { f64::NAN }
        }));
    }
    Ok(())
}

/// Writes a pass: times and positions in double, accelerations in single precision.
///
/// Byte-stream split with zstd, as `pyarrow` writes it: bytes of like significance compress well.
pub(super) fn write(
    path: &Path,
    names: &[&str; 3],
    time_s: &[f64],
    position_m: &[f64],
    acceleration_m_s2: &[f32],
) -> Result<(), ParquetError> {
    let column = |name, kind| -> Result<Arc<Type>, ParquetError> {
        let column = Type::primitive_type_builder(name, kind);
        Ok(Arc::new(column.with_repetition(Repetition::REQUIRED).build()?))
    };
    let fields = vec![
        column(names[0], PhysicalType::DOUBLE)?,
        column(names[1], PhysicalType::DOUBLE)?,
        column(names[2], PhysicalType::FLOAT)?,
    ];
    let schema = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::BYTE_STREAM_SPLIT)
        .build();
    let mut writer = SerializedFileWriter::new(File::create(path)?, schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    write_column::<DoubleType>(&mut group, time_s)?;
    write_column::<DoubleType>(&mut group, position_m)?;
    write_column::<FloatType>(&mut group, acceleration_m_s2)?;
    group.close()?;
    writer.close()?;
    Ok(())
}

fn write_column<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: &[T::T],
) -> Result<(), ParquetError> {
    if let Some(mut column) = group.next_column()? {
        column.typed::<T>().write_batch(values, None, None)?;
        column.close()?;
    }
    Ok(())
}
