//! A row of either database.

use super::statement::series;
use crate::LibraryError;
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Decode, Postgres, Sqlite, Type};
use std::borrow::Cow;

/// A row that a statement answered.
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
    /// The value of a column.
    pub(crate) fn get<T: Column>(&self, column: &str) -> Result<T, LibraryError> {
        Ok(match self {
            Self::Sqlite(row) => sqlx::Row::try_get(row, column)?,
            Self::Postgres(row) => sqlx::Row::try_get(row, &*folded(column))?,
        })
    }

    /// A count or an index.
    pub(crate) fn get_u32(&self, column: &str) -> Result<u32, LibraryError> {
        let value: i64 = self.get(column)?;
        u32::try_from(value)
            .map_err(|_| LibraryError::Damaged { what: format!("{column} is {value}") })
    }

    /// How many elements something has.
    pub(crate) fn get_count(&self, column: &str) -> Result<usize, LibraryError> {
        // PostgreSQL counts elements in 32 bits.
        let count = match self {
            Self::Sqlite(row) => sqlx::Row::try_get::<i64, _>(row, column)?,
            Self::Postgres(row) => sqlx::Row::try_get::<i32, _>(row, column)?.into(),
        };
        Ok(usize::try_from(count).unwrap_or(0))
    }

    /// A series of numbers.
    pub(crate) fn doubles(&self, column: &str) -> Result<Vec<f64>, LibraryError> {
        let missing = || LibraryError::Damaged { what: format!("{column} is missing") };
        self.doubles_if_there(column)?.ok_or_else(missing)
    }

    /// A series of numbers that may be missing.
    pub(crate) fn doubles_if_there(&self, column: &str) -> Result<Option<Vec<f64>>, LibraryError> {
        let bytes: Option<&[u8]> = match self {
            Self::Sqlite(row) => sqlx::Row::try_get(row, column)?,
            Self::Postgres(row) => sqlx::Row::try_get(row, &*folded(column))?,
        };
        Ok(bytes.map(series))
    }
}

/// As PostgreSQL spells an unquoted name.
fn folded(column: &str) -> Cow<'_, str> {
    if column.bytes().any(|byte| byte.is_ascii_uppercase()) {
        Cow::Owned(column.to_ascii_lowercase())
    } else {
        Cow::Borrowed(column)
    }
}
