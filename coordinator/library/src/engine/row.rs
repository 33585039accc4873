//! A row of either database.

use super::statement::series;
use crate::LibraryError;
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Decode, Postgres, Sqlite, Type};
use std::borrow::Cow;

/// A row returned by a statement.
pub(crate) enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

/// Type of a column's value: `String`, `i64`, `f64`, or an `Option` of these.
pub(crate) trait Column:
    for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres>
{
}

impl<T> Column for T where
    T: for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres>
{
}

impl Row {
    /// The value of a column, by name.
    pub(crate) fn get<T: Column>(&self, column: &str) -> Result<T, LibraryError> {
        Ok(match self {
            Self::Sqlite(row) => sqlx::Row::try_get(row, column)?,
            Self::Postgres(row) => sqlx::Row::try_get(row, &*folded(column))?,
        })
    }

    /// The value of a column with a count or an index.
    pub(crate) fn get_u32(&self, column: &str) -> Result<u32, LibraryError> {
        let value: i64 = self.get(column)?;
        u32::try_from(value)
            .map_err(|_| LibraryError::Damaged { what: format!("{column} is {value}") })
    }

    /// The value of a column with a number of elements.
    pub(crate) fn get_count(&self, column: &str) -> Result<usize, LibraryError> {
        // PostgreSQL counts elements in 32 bits.
        let count = match self {
            Self::Sqlite(row) => sqlx::Row::try_get::<i64, _>(row, column)?,
            Self::Postgres(row) => sqlx::Row::try_get::<i32, _>(row, column)?.into(),
        };
        Ok(usize::try_from(count).unwrap_or(0))
    }

    /// The value of a column with a series of numbers.
    pub(crate) fn doubles(&self, column: &str) -> Result<Vec<f64>, LibraryError> {
        let missing = || LibraryError::Damaged { what: format!("{column} is missing") };
        self.doubles_if_there(column)?.ok_or_else(missing)
    }

    /// The value of a column with a series of numbers, or `None` for null.
    pub(crate) fn doubles_if_there(&self, column: &str) -> Result<Option<Vec<f64>>, LibraryError> {
        let bytes: Option<&[u8]> = match self {
            Self::Sqlite(row) => sqlx::Row::try_get(row, column)?,
            Self::Postgres(row) => sqlx::Row::try_get(row, &*folded(column))?,
        };
        Ok(bytes.map(series))
    }
}

/// The lower-case spelling that PostgreSQL uses for an unquoted name.
fn folded(column: &str) -> Cow<'_, str> {
    if column.bytes().any(|byte| byte.is_ascii_uppercase()) {
        Cow::Owned(column.to_ascii_lowercase())
    } else {
        Cow::Borrowed(column)
    }
}
