//! A statement with its values, for either database.

use super::Dialect;
use sqlx::postgres::PgArguments;
use sqlx::query::Query;
use sqlx::sqlite::SqliteArguments;
use sqlx::{AssertSqlSafe, Postgres, Sqlite};
use std::borrow::Cow;

/// A value to be bound. A missing value has a type, because PostgreSQL requires it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Text(Option<String>),
    Integer(Option<i64>),
    Real(Option<f64>),
    /// A series of numbers in stored form: big-endian doubles, concatenated.
    Series(Option<Vec<u8>>),
    /// A list used within a statement; with `SQLite` it is bound as JSON. See [`Dialect::listed`].
    Integers(Vec<i64>),
    /// As `Integers`, with texts.
    Texts(Vec<String>),
    /// As `Integers`, with floating-point numbers.
    Reals(Vec<f64>),
    /// As `Integers`, with floating-point numbers that may be missing.
    OptionalReals(Vec<Option<f64>>),
}

/// SQL text of a statement.
#[derive(Clone, Debug)]
pub(crate) enum Text {
    /// One text for both databases.
    Same(Cow<'static, str>),
    /// A separate text for each database.
    Each {
        /// Text in the dialect of `SQLite`.
        sqlite: &'static str,
        /// Text in the dialect of PostgreSQL.
        postgres: &'static str,
    },
}

impl Text {
    /// Creates one text for both databases.
    pub(crate) const fn same(text: &'static str) -> Self {
        Self::Same(Cow::Borrowed(text))
    }

    /// The text for this dialect.
    fn of(self, dialect: Dialect) -> Cow<'static, str> {
        match (self, dialect) {
            (Self::Same(text), _) => text,
            (Self::Each { sqlite, .. }, Dialect::Sqlite) => Cow::Borrowed(sqlite),
            (Self::Each { postgres, .. }, Dialect::Postgres) => Cow::Borrowed(postgres),
        }
    }
}

impl From<&'static str> for Text {
    fn from(text: &'static str) -> Self {
        Self::same(text)
    }
}

impl From<String> for Text {
    fn from(text: String) -> Self {
        Self::Same(Cow::Owned(text))
    }
}

/// A statement written in this crate.
#[derive(Clone, Debug)]
pub(crate) struct Statement {
    text: Text,
    values: Vec<Value>,
}

/// A statement without values. `text` must not contain anything from outside this crate.
pub(crate) fn sql(text: impl Into<Text>) -> Statement {
    Statement { text: text.into(), values: Vec::new() }
}

impl Statement {
    /// Binds the next value. The first bound value is `$1`.
    pub(crate) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// The SQL text of the statement for this database.
    pub(super) fn text(&self, dialect: Dialect) -> Cow<'static, str> {
        self.text.clone().of(dialect)
    }

    pub(super) fn for_sqlite(self) -> Query<'static, Sqlite, SqliteArguments> {
        let query = sqlx::query(AssertSqlSafe(self.text.of(Dialect::Sqlite)));
        self.values.into_iter().fold(query, |query, value| match value {
            Value::Text(text) => query.bind(text),
            Value::Integer(integer) => query.bind(integer),
            Value::Real(real) => query.bind(real),
            Value::Series(bytes) => query.bind(bytes),
            Value::Integers(integers) => query.bind(format!("{integers:?}")),
            Value::Texts(texts) => query.bind(serde_json::Value::from(texts).to_string()),
            Value::Reals(reals) => query.bind(serde_json::Value::from(reals).to_string()),
            Value::OptionalReals(reals) => query.bind(serde_json::Value::from(reals).to_string()),
        })
    }

    pub(super) fn for_postgres(self) -> Query<'static, Postgres, PgArguments> {
        let query = sqlx::query(AssertSqlSafe(self.text.of(Dialect::Postgres)));
        self.values.into_iter().fold(query, |query, value| match value {
            Value::Text(text) => query.bind(text),
            Value::Integer(integer) => query.bind(integer),
            Value::Real(real) => query.bind(real),
            Value::Series(bytes) => query.bind(bytes),
            Value::Integers(integers) => query.bind(integers),
            Value::Texts(texts) => query.bind(texts),
            Value::Reals(reals) => query.bind(reals),
            Value::OptionalReals(reals) => query.bind(reals),
        })
    }
}

impl Value {
    /// Concatenates several series into one value.
    pub(crate) fn series<'a>(parts: impl IntoIterator<Item = &'a [f64], IntoIter: Clone>) -> Self {
        let parts = parts.into_iter();
        let mut numbers = Vec::with_capacity(parts.clone().map(<[f64]>::len).sum());
        for part in parts {
            numbers.extend(part.iter().map(|number| number.to_be_bytes()));
        }
        Self::Series(Some(numbers.into_flattened()))
    }
}

/// Decodes a stored series.
pub(crate) fn series(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|chunk| f64::from_be_bytes(*chunk)).collect()
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(Some(text.to_owned()))
    }
}

impl From<&String> for Value {
    fn from(text: &String) -> Self {
        Self::Text(Some(text.clone()))
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(Some(text))
    }
}

impl From<i64> for Value {
    fn from(integer: i64) -> Self {
        Self::Integer(Some(integer))
    }
}

impl From<u32> for Value {
    fn from(integer: u32) -> Self {
        Self::Integer(Some(integer.into()))
    }
}

impl From<f64> for Value {
    fn from(real: f64) -> Self {
        Self::Real(Some(real))
    }
}

impl From<Option<f64>> for Value {
    fn from(real: Option<f64>) -> Self {
        Self::Real(real)
    }
}

impl From<&[f64]> for Value {
    fn from(series: &[f64]) -> Self {
        Self::series([series])
    }
}

impl From<Vec<i64>> for Value {
    fn from(integers: Vec<i64>) -> Self {
        Self::Integers(integers)
    }
}

impl From<Option<String>> for Value {
    fn from(text: Option<String>) -> Self {
        Self::Text(text)
    }
}
