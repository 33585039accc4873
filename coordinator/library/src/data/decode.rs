//! Conversion of database rows to cells.

use super::{Cell, Column, ColumnKind, Table};
use crate::LibraryError;
use crate::engine::{Row, series};
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Row as _, TypeInfo, ValueRef};
use std::fmt::Write as _;

/// Converts a row of a table, in the order of the table's columns.
pub(super) fn table_row(table: &Table, row: &Row) -> Result<Vec<Cell>, LibraryError> {
    cells(table.columns, row)
}

/// Converts these columns of a row.
pub(super) fn cells<'a>(
    columns: impl IntoIterator<Item = &'a Column>,
    row: &Row,
) -> Result<Vec<Cell>, LibraryError> {
    let cell = |column: &Column| {
        Ok(match column.kind {
            ColumnKind::Text => row.get::<Option<String>>(column.name)?.map(Cell::Text),
            ColumnKind::Integer => row.get::<Option<i64>>(column.name)?.map(Cell::Integer),
            ColumnKind::Real => row.get::<Option<f64>>(column.name)?.map(Cell::Real),
            ColumnKind::Doubles => Some(Cell::Doubles(row.doubles(column.name)?)),
        }
        .unwrap_or(Cell::Null))
    };
    columns.into_iter().map(cell).collect()
}

/// Converts a row of any query.
pub(super) fn any_row(row: &Row, columns: &[String]) -> Result<Vec<Cell>, LibraryError> {
    let cells = columns.iter().enumerate();
    match row {
        Row::Sqlite(row) => cells.map(|(place, name)| sqlite_cell(row, place, name)).collect(),
        Row::Postgres(row) => cells.map(|(place, name)| postgres_cell(row, place, name)).collect(),
    }
}

/// Converts a value of `SQLite`. `SQLite` has a type for each value; series are stored as blobs.
fn sqlite_cell(row: &SqliteRow, place: usize, name: &str) -> Result<Cell, LibraryError> {
    let value = row.try_get_raw(place)?;
    if value.is_null() {
        return Ok(Cell::Null);
    }
    Ok(match value.type_info().name() {
        "INTEGER" => Cell::Integer(row.try_get_unchecked(place)?),
        "REAL" => Cell::Real(row.try_get_unchecked(place)?),
        "BOOLEAN" => Cell::Boolean(row.try_get_unchecked(place)?),
        "BLOB" => bytes_cell(row.try_get_unchecked(place)?, name),
        _ => Cell::Text(row.try_get_unchecked(place)?),
    })
}

/// Converts bytes to a series if the schema has a series column of this name, otherwise to hexadecimal
/// digits.
fn bytes_cell(bytes: &[u8], name: &str) -> Cell {
    if bytes.len().is_multiple_of(size_of::<f64>()) && is_series(name) {
        Cell::Doubles(series(bytes))
    } else {
        Cell::Text(hexadecimal(bytes))
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02X}");
        text
    })
}

/// Whether a column of this name contains series.
fn is_series(name: &str) -> bool {
    let mut columns = Table::ALL.into_iter().flat_map(|table| table.columns);
    columns.any(|column| column.kind == ColumnKind::Doubles && column.name == name)
}

/// Types that [`postgres_cell`] converts to a cell other than text.
const POSTGRES_NUMBERS: [&str; 8] =
    ["BOOL", "INT2", "INT4", "INT8", "FLOAT4", "FLOAT8", "FLOAT8[]", "BYTEA"];

/// Types whose values PostgreSQL sends as plain text.
const POSTGRES_TEXTS: [&str; 6] = ["TEXT", "VARCHAR", "CHAR", "NAME", "UNKNOWN", "JSON"];

/// Whether [`postgres_cell`] supports this type of PostgreSQL.
pub(super) fn is_postgres_cell(kind: &str) -> bool {
    POSTGRES_NUMBERS.contains(&kind) || POSTGRES_TEXTS.contains(&kind)
}

fn postgres_cell(row: &PgRow, place: usize, name: &str) -> Result<Cell, LibraryError> {
    let value = row.try_get_raw(place)?;
    if value.is_null() {
        return Ok(Cell::Null);
    }
    Ok(match value.type_info().name() {
        "BOOL" => Cell::Boolean(row.try_get(place)?),
        "INT2" => Cell::Integer(row.try_get::<i16, _>(place)?.into()),
        "INT4" => Cell::Integer(row.try_get::<i32, _>(place)?.into()),
        "INT8" => Cell::Integer(row.try_get(place)?),
        "FLOAT4" => Cell::Real(row.try_get::<f32, _>(place)?.into()),
        "FLOAT8" => Cell::Real(row.try_get(place)?),
        "FLOAT8[]" => Cell::Doubles(row.try_get(place)?),
        "BYTEA" => bytes_cell(row.try_get(place)?, name),
        _ => Cell::Text(row.try_get_unchecked(place)?),
    })
}

/// Converts a decimal number in text form. PostgreSQL returns sums and means of integers as decimal numbers
/// of any length.
pub(super) fn number(text: &str) -> Cell {
    let integer = text.parse().map(Cell::Integer);
    integer
        .or_else(|_| text.parse().map(Cell::Real))
        .unwrap_or_else(|_| Cell::Text(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_without_decimals_are_integers() {
        assert_eq!(number("-6"), Cell::Integer(-6));
        assert_eq!(number("1.5000000000000000"), Cell::Real(1.5));
        assert_eq!(number("2.0"), Cell::Real(2.0));
        assert_eq!(number("100000000000000000000"), Cell::Real(1e20));
        assert_eq!(number("-Infinity"), Cell::Real(f64::NEG_INFINITY));
    }
}
