//! Reads and writes columns of numbers in Parquet files, independent of their meaning.

use super::error::{Fault, RecordingError};
use super::import::{Column, Oddity};
use parquet::basic::{
    Compression, ConvertedType, Encoding, LogicalType, Repetition, TimeUnit, Type as PhysicalType,
    ZstdLevel,
};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{DataType, DoubleType, FloatType};
use parquet::errors::ParquetError;
use parquet::file::metadata::FileMetaData;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnDescriptor, Type};
use std::collections::HashMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Reads the named columns and ignores other columns. Null values become NaN.
pub(super) fn read<const N: usize>(
    path: &Path,
    names: &[&str; N],
) -> Result<[Vec<f64>; N], RecordingError> {
    let all = read_all(path)?;
    let mut columns = [const { Vec::new() }; N];
    for (column, name) in columns.iter_mut().zip(names) {
        let fault = |fault| RecordingError::new(path, *name, fault);
        let named = || all.iter().enumerate().filter(|(_, column)| column.name == *name);
        let places: Vec<usize> = named().map(|(index, _)| index + 1).collect();
        let Some((_, found)) = named().next() else {
            let present = all.iter().map(|column| column.name.clone()).collect();
            return Err(fault(Fault::NoColumn { present, header: None }));
        };
        if places.len() > 1 {
            return Err(fault(Fault::ColumnTwice { places }));
        }
        if let Some(Oddity::Kind(kind)) = &found.oddity {
            return Err(fault(Fault::NotNumeric { kind: kind.clone() }));
        }
        column.clone_from(&found.values);
    }
    Ok(columns)
}

/// Part of the decoder's message on a compression that it was built without.
const DISABLED: &str = "Disabled feature at compile time";

/// Reads all columns. A column that is not numeric states its type.
///
/// Times, timestamps and durations become seconds; timestamps count from the first.
pub(super) fn read_all(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let unreadable = |error: ParquetError| {
        let reason = error.to_string();
        let is_compressed_otherwise = reason.contains(DISABLED);
        let fault =
            if is_compressed_otherwise { Fault::Compression } else { Fault::Unreadable { reason } };
        RecordingError::new(path, "file", fault)
    };
    let file = File::open(path).map_err(|error| unreadable(error.into()))?;
    let reader = SerializedFileReader::new(file).map_err(unreadable)?;
    let metadata = reader.metadata().file_metadata();
    let durations = durations(metadata);
    let mut columns = Vec::new();
    for (place, column) in metadata.schema_descr().columns().iter().enumerate() {
        let name = column.path().string();
        let kind = Kind::of(column, durations.get(&name).copied());
        let unit = matches!(kind, Kind::Time(_)).then(|| "s".to_owned());
        let mut values = Vec::new();
        let oddity = match kind {
            Kind::Other(kind) => Some(Oddity::Kind(kind)),
            kind => {
                values = column_values(&reader, place, column, &kind).map_err(unreadable)?;
                None
            }
        };
        columns.push(Column { name, values, oddity, unit });
    }
    Ok(columns)
}

/// Type of the values of a column.
#[derive(Clone, Debug, PartialEq)]
enum Kind {
    /// Numbers without conversion.
    Plain,
    /// Whole numbers without a sign.
    Unsigned,
    /// Numbers of half precision.
    Half,
    /// Whole numbers of so much each.
    Scaled(f64),
    /// Times as integers in this unit in s.
    Time(f64),
    /// No numbers.
    Other(String),
}

impl Kind {
    fn of(column: &ColumnDescriptor, duration_s: Option<f64>) -> Self {
        if column.max_rep_level() > 0 {
            return Self::Other("a list in every row".to_owned());
        }
        match column.logical_type_ref() {
            Some(LogicalType::Timestamp(kind)) => return Self::Time(seconds(kind.unit)),
            Some(LogicalType::Time(kind)) => return Self::Time(seconds(kind.unit)),
            Some(LogicalType::Date) => return Self::Other("dates".to_owned()),
            Some(LogicalType::Float16) => return Self::Half,
            Some(LogicalType::Integer(kind)) if !kind.is_signed => return Self::Unsigned,
            _ => {}
        }
        match (column.converted_type(), column.physical_type()) {
            (ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS, _) => Self::Time(1e-3),
            (ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS, _) => Self::Time(1e-6),
            (ConvertedType::UINT_32 | ConvertedType::UINT_64, _) => Self::Unsigned,
            (ConvertedType::DECIMAL, PhysicalType::INT32 | PhysicalType::INT64) => {
                Self::Scaled(10f64.powi(-column.type_scale()))
            }
            (_, PhysicalType::INT64) => duration_s.map_or(Self::Plain, Self::Time),
            (_, PhysicalType::DOUBLE | PhysicalType::FLOAT | PhysicalType::INT32) => Self::Plain,
            (_, PhysicalType::BOOLEAN) => Self::Other("Boolean values".to_owned()),
            (ConvertedType::DECIMAL, _) => Self::Other("decimal numbers".to_owned()),
            (_, PhysicalType::INT96) => {
                Self::Other("timestamps of the deprecated type INT96".to_owned())
            }
            (_, PhysicalType::BYTE_ARRAY) => Self::Other("texts".to_owned()),
            (_, PhysicalType::FIXED_LEN_BYTE_ARRAY) => Self::Other("bytes".to_owned()),
        }
    }

    fn of_int(&self, value: i64, unsigned: u64, first: &mut Option<i64>) -> f64 {
        match self {
            Self::Unsigned => unsigned as f64,
            Self::Scaled(factor) => value as f64 * factor,
            // A time since 1970 in nanoseconds has more digits than a double.
            Self::Time(seconds) => value.wrapping_sub(*first.get_or_insert(value)) as f64 * seconds,
            _ => value as f64,
        }
    }
}

const fn seconds(unit: TimeUnit) -> f64 {
    match unit {
        TimeUnit::MILLIS => 1e-3,
        TimeUnit::MICROS => 1e-6,
        TimeUnit::NANOS => 1e-9,
    }
}

/// Seconds of one of a column that pandas stores as durations, for which Parquet has no type.
fn durations(metadata: &FileMetaData) -> HashMap<String, f64> {
    let entries = metadata.key_value_metadata().into_iter().flatten();
    let pandas = entries
        .filter(|entry| entry.key == "pandas")
        .find_map(|entry| serde_json::from_str::<serde_json::Value>(entry.value.as_deref()?).ok());
    let columns = pandas.as_ref().and_then(|pandas| pandas.get("columns")?.as_array());
    let duration = |column: &serde_json::Value| {
        let name = column.get("field_name").or_else(|| column.get("name"))?.as_str()?;
        let seconds = match column.get("numpy_type")?.as_str()? {
            "timedelta64[s]" => 1.0,
            "timedelta64[ms]" => 1e-3,
            "timedelta64[us]" => 1e-6,
            "timedelta64[ns]" => 1e-9,
            _ => return None,
        };
        Some((name.to_owned(), seconds))
    };
    columns.into_iter().flatten().filter_map(duration).collect()
}

/// All values of the column at `place`.
fn column_values(
    reader: &SerializedFileReader<File>,
    place: usize,
    column: &ColumnDescriptor,
    kind: &Kind,
) -> Result<Vec<f64>, ParquetError> {
    let mut values = Vec::new();
    let mut first = None;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group)?;
        let rows = usize::try_from(group.metadata().num_rows()).unwrap_or_default();
        let into = (rows, column.max_def_level(), &mut values);
        match group.get_column_reader(place)? {
            ColumnReader::DoubleColumnReader(reader) => append(reader, into, |value| value)?,
            ColumnReader::FloatColumnReader(reader) => append(reader, into, f64::from)?,
            ColumnReader::Int32ColumnReader(reader) => append(reader, into, |value| {
                kind.of_int(value.into(), value.cast_unsigned().into(), &mut first)
            })?,
            ColumnReader::Int64ColumnReader(reader) => {
                let number = |value: i64| kind.of_int(value, value.cast_unsigned(), &mut first);
                append(reader, into, number)?;
            }
            ColumnReader::FixedLenByteArrayColumnReader(reader) => append(reader, into, |value| {
                let bytes = value.data().try_into().unwrap_or([0; 2]);
                half::f16::from_le_bytes(bytes).into()
            })?,
            _ => return Err(ParquetError::General("holds no numbers".to_owned())),
        }
    }
    Ok(values)
}

/// Appends the values of one row group's column: its rows, the level of a value that is there, and
/// where they go.
fn append<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    (rows, there, into): (usize, i16, &mut Vec<f64>),
    number: impl FnMut(T::T) -> f64,
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
        into.extend(levels.iter().map(|&level| {
            if level == there { present.next().unwrap_or(f64::NAN) } else { f64::NAN }
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
