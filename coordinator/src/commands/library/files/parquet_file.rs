//! Tables as Parquet files: texts are UTF-8 strings, integers INT64, numbers DOUBLE, series lists
//! of DOUBLE; all values are optional.

use parquet::basic::{Compression, ZstdLevel};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fmt::Write as _;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use tracktwin_library::{Cell, Column, ColumnKind, Table};

/// Definition levels of an optional value, and of an element of an optional list.
const PRESENT: i16 = 1;
const ELEMENT: i16 = 2;

/// A Parquet file open for writing.
pub(in crate::commands::library) struct ParquetFile {
    writer: SerializedFileWriter<File>,
    columns: &'static [Column],
}

impl ParquetFile {
    pub(in crate::commands::library) fn create(
        path: &Path,
        table: &'static Table,
    ) -> Result<Self, ParquetError> {
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .build();
        let schema = Arc::new(parse_message_type(&message_type(table))?);
        let writer = SerializedFileWriter::new(File::create(path)?, schema, Arc::new(properties))?;
        Ok(Self { writer, columns: table.columns })
    }

    /// Writes rows as one row group.
    pub(in crate::commands::library) fn write(
        &mut self,
        rows: &[Vec<Cell>],
    ) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for (place, Column { kind, .. }) in self.columns.iter().enumerate() {
            let cells = rows.iter().map(|row| &row[place]);
            let mut column = group
                .next_column()?
                .ok_or_else(|| ParquetError::General("the file has too few columns".to_owned()))?;
            write_column(column.untyped(), *kind, cells)?;
            column.close()?;
        }
        group.close().map(drop)
    }

    pub(in crate::commands::library) fn end(self) -> Result<(), ParquetError> {
        Ok(self.writer.into_inner()?.sync_all()?)
    }
}

fn message_type(table: &Table) -> String {
    let mut text = format!("message {} {{", table.name);
    for Column { name, kind } in table.columns {
        let _ = match kind {
            ColumnKind::Text => write!(text, " optional binary {name} (string);"),
            ColumnKind::Integer => write!(text, " optional int64 {name};"),
            ColumnKind::Real => write!(text, " optional double {name};"),
            ColumnKind::Doubles => write!(
                text,
                " optional group {name} (list) {{ repeated group list {{ required double element; \
                 }} }}"
            ),
        };
    }
    text + " }"
}

fn write_column<'a>(
    column: &mut ColumnWriter<'_>,
    kind: ColumnKind,
    cells: impl Iterator<Item = &'a Cell> + Clone,
) -> Result<(), ParquetError> {
    let levels: Vec<i16> =
        cells.clone().map(|cell| PRESENT * i16::from(*cell != Cell::Null)).collect();
    match (column, kind) {
        (ColumnWriter::ByteArrayColumnWriter(column), ColumnKind::Text) => {
            let texts = cells.filter_map(|cell| match cell {
                Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                _ => None,
            });
            column.write_batch(&texts.collect::<Vec<_>>(), Some(&levels), None)
        }
        (ColumnWriter::Int64ColumnWriter(column), ColumnKind::Integer) => {
            let integers = cells.filter_map(|cell| match cell {
                Cell::Integer(integer) => Some(*integer),
                _ => None,
            });
            column.write_batch(&integers.collect::<Vec<_>>(), Some(&levels), None)
        }
        (ColumnWriter::DoubleColumnWriter(column), ColumnKind::Real) => {
            let reals = cells.filter_map(|cell| match cell {
                Cell::Real(real) => Some(*real),
                _ => None,
            });
            column.write_batch(&reals.collect::<Vec<_>>(), Some(&levels), None)
        }
        (ColumnWriter::DoubleColumnWriter(column), ColumnKind::Doubles) => {
            let lists = Lists::of(cells);
            column.write_batch(&lists.values, Some(&lists.defined), Some(&lists.repeated))
        }
        _ => Err(ParquetError::General("a column of an unknown type".to_owned())),
    }
    .map(drop)
}

/// Lists in Parquet's representation: all values in sequence, each with its definition and
/// repetition level.
#[derive(Default)]
struct Lists {
    values: Vec<f64>,
    defined: Vec<i16>,
    repeated: Vec<i16>,
}

impl Lists {
    fn of<'a>(cells: impl Iterator<Item = &'a Cell>) -> Self {
        let mut lists = Self::default();
        for cell in cells {
            match cell {
                Cell::Doubles(doubles) if !doubles.is_empty() => {
                    lists.defined.extend(std::iter::repeat_n(ELEMENT, doubles.len()));
                    lists.repeated.push(0);
                    lists.repeated.extend(std::iter::repeat_n(1, doubles.len() - 1));
                    lists.values.extend_from_slice(doubles);
                }
                empty => {
                    lists.defined.push(PRESENT * i16::from(*empty != Cell::Null));
                    lists.repeated.push(0);
                }
            }
        }
        lists
    }

    /// The inverse: lists from Parquet's representation.
    fn cells(self) -> Vec<Cell> {
        let mut values = self.values.into_iter();
        let mut cells: Vec<Cell> = Vec::new();
        for (defined, repeated) in self.defined.into_iter().zip(self.repeated) {
            match (defined, repeated, cells.last_mut()) {
                (ELEMENT, 1.., Some(Cell::Doubles(list))) => list.extend(values.next()),
                (ELEMENT, ..) => cells.push(Cell::Doubles(values.next().into_iter().collect())),
                (PRESENT, ..) => cells.push(Cell::Doubles(Vec::new())),
                _ => cells.push(Cell::Null),
            }
        }
        cells
    }
}

/// Passes the rows of a file written by [`ParquetFile`] to `take`, one group at a time.
pub(in crate::commands::library) async fn read<E: From<ParquetError>>(
    path: &Path,
    table: &Table,
    mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
) -> Result<(), E> {
    let reader = SerializedFileReader::new(File::open(path).map_err(ParquetError::from)?)?;
    check_columns(&reader, table)?;
    for group in 0..reader.num_row_groups() {
        take(rows(&reader, group, table)?).await?;
    }
    Ok(())
}

fn check_columns(reader: &impl FileReader, table: &Table) -> Result<(), ParquetError> {
    let schema = reader.metadata().file_metadata().schema();
    let found: Vec<&str> = schema.get_fields().iter().map(|field| field.name()).collect();
    let expected: Vec<&str> = table.columns.iter().map(|column| column.name).collect();
    if found == expected {
        return Ok(());
    }
    let missing = expected.iter().find(|name| !found.contains(name)).unwrap_or(&"in another order");
    Err(ParquetError::General(format!(
        "the columns differ from those of the table {}: {missing}",
        table.name
    )))
}

fn rows(
    reader: &impl FileReader,
    group: usize,
    table: &Table,
) -> Result<Vec<Vec<Cell>>, ParquetError> {
    let group = reader.get_row_group(group)?;
    let count = usize::try_from(group.metadata().num_rows()).unwrap_or_default();
    let mut rows = vec![Vec::with_capacity(table.columns.len()); count];
    for (place, column) in table.columns.iter().enumerate() {
        let cells = read_column(group.get_column_reader(place)?, column, count)?;
        for (row, cell) in rows.iter_mut().zip(cells) {
            row.push(cell);
        }
    }
    Ok(rows)
}

fn read_column(
    reader: ColumnReader,
    column: &Column,
    count: usize,
) -> Result<Vec<Cell>, ParquetError> {
    match (reader, column.kind) {
        (ColumnReader::ByteArrayColumnReader(reader), ColumnKind::Text) => {
            let (texts, levels) = flat(reader, count)?;
            let texts =
                texts.iter().map(|bytes| bytes.as_utf8().map(|it| Cell::Text(it.to_owned())));
            Ok(with_gaps(texts.collect::<Result<Vec<_>, _>>()?, &levels))
        }
        (ColumnReader::Int64ColumnReader(reader), ColumnKind::Integer) => {
            let (integers, levels) = flat(reader, count)?;
            Ok(with_gaps(integers.into_iter().map(Cell::Integer), &levels))
        }
        (ColumnReader::DoubleColumnReader(reader), ColumnKind::Real) => {
            let (reals, levels) = flat(reader, count)?;
            Ok(with_gaps(reals.into_iter().map(Cell::Real), &levels))
        }
        (ColumnReader::DoubleColumnReader(mut reader), ColumnKind::Doubles) => {
            let mut lists = Lists::default();
            let Lists { values, defined, repeated } = &mut lists;
            reader.read_records(count, Some(defined), Some(repeated), values)?;
            Ok(lists.cells())
        }
        _ => Err(ParquetError::General(format!("the column {} is of another type", column.name))),
    }
}

/// The values of a column without lists, and which of them are present.
fn flat<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    count: usize,
) -> Result<(Vec<T::T>, Vec<i16>), ParquetError> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    reader.read_records(count, Some(&mut levels), None, &mut values)?;
    Ok((values, levels))
}

fn with_gaps(values: impl IntoIterator<Item = Cell>, levels: &[i16]) -> Vec<Cell> {
    let mut values = values.into_iter();
    let cell = |level: &i16| match *level {
        PRESENT => values.next().unwrap_or(Cell::Null),
        _ => Cell::Null,
    };
    levels.iter().map(cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_column_of_lists_without_any_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("series.parquet");
        let table = Table::named("stored_array").unwrap();
        let of = |kind| {
            if kind == ColumnKind::Doubles { Cell::Doubles(vec![1.5, 2.0]) } else { Cell::Null }
        };
        let empty = vec![vec![Cell::Null; table.columns.len()]; 2];
        let full = vec![table.columns.iter().map(|column| of(column.kind)).collect::<Vec<_>>()];
        let mut file = ParquetFile::create(&path, table).unwrap();
        for rows in [&empty, &full] {
            file.write(rows).unwrap();
        }
        file.end().unwrap();
        let mut found = Vec::new();
        let take = async |rows: Vec<Vec<Cell>>| {
            found.extend(rows);
            Ok::<(), ParquetError>(())
        };
        read(&path, table, take).await.unwrap();
        assert_eq!(found, [empty, full].concat());
    }
}
