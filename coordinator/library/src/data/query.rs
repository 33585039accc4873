//! Read-only execution of SQL statements of the user.

use super::{Cell, decode, question, schema};
use crate::engine::{Dialect, Row, Target};
use crate::{Library, LibraryError};
use sqlx::postgres::{PgColumn, PgConnectOptions};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{
    AssertSqlSafe, Column, ConnectOptions, Executor, PgConnection, SqlSafeStr, SqliteConnection,
    Statement, TypeInfo,
};
use std::path::Path;
use tokio_stream::StreamExt;

/// Receiver of the rows of a query.
pub trait Answer {
    /// Error type of the receiver.
    type Error: From<LibraryError>;

    /// Receives the names of the columns. It is called once, before any row, also if there are no rows.
    ///
    /// # Errors
    /// An error ends the query.
    fn columns(&mut self, names: &[String]) -> Result<(), Self::Error>;

    /// Receives a row.
    ///
    /// # Errors
    /// An error ends the query.
    fn row(&mut self, cells: Vec<Cell>) -> Result<(), Self::Error>;
}

impl Library {
    /// Runs one statement of the user on a separate read-only connection, and passes the rows to `answer`.
    ///
    /// # Errors
    /// Returns [`LibraryError::OnlyReads`] for a statement that would write, [`LibraryError::BadQuery`] for
    /// a statement that the database rejects, or the error of `answer`.
    pub async fn query<A: Answer>(&self, text: &str, answer: &mut A) -> Result<(), A::Error> {
        match self.target() {
            Target::Sqlite(path) => sqlite(path, text, answer).await,
            Target::Postgres { options, .. } => postgres(options, text, answer).await,
        }
    }
}

async fn sqlite<A: Answer>(path: &Path, text: &str, answer: &mut A) -> Result<(), A::Error> {
    question::check(text, Dialect::Sqlite)?;
    // Opened for reading, so that no pragma can undo it.
    let options = SqliteConnectOptions::new().filename(path).read_only(true);
    let options = options.pragma("query_only", "on");
    let mut connection: SqliteConnection = options.connect().await.map_err(LibraryError::from)?;
    let text = AssertSqlSafe(text.to_owned()).into_sql_str();
    let statement = connection.prepare(text).await.map_err(refused)?;
    let columns = names(statement.columns());
    answer.columns(&columns)?;
    let mut rows = statement.query().fetch(&mut connection);
    while let Some(row) = rows.next().await {
        let row = Row::Sqlite(row.map_err(refused)?);
        answer.row(decode::any_row(&row, &columns)?)?;
    }
    Ok(())
}

async fn postgres<A: Answer>(
    options: &PgConnectOptions,
    text: &str,
    answer: &mut A,
) -> Result<(), A::Error> {
    question::check(text, Dialect::Postgres)?;
    let mut connection: PgConnection = options.connect().await.map_err(LibraryError::from)?;
    // The protocol takes one statement at a time, so this transaction is all that it can end.
    connection.execute("begin transaction read only").await.map_err(LibraryError::from)?;
    let asked = AssertSqlSafe(text.to_owned()).into_sql_str();
    let mut statement = connection.prepare(asked).await.map_err(refused)?;
    let columns = names(statement.columns());
    answer.columns(&columns)?;
    let is_decimal = |column: &PgColumn| column.type_info().name() == "NUMERIC";
    let decimal: Vec<_> = statement.columns().iter().map(is_decimal).collect();
    if let Some(text) = with_texts(text, statement.columns()) {
        let text = AssertSqlSafe(text).into_sql_str();
        statement = connection.prepare(text).await.map_err(refused)?;
    }
    let mut rows = statement.query().fetch(&mut connection);
    while let Some(row) = rows.next().await {
        let row = Row::Postgres(row.map_err(refused)?);
        let mut cells = decode::any_row(&row, &columns)?;
        for (cell, _) in cells.iter_mut().zip(&decimal).filter(|(_, is_decimal)| **is_decimal) {
            if let Cell::Text(text) = cell {
                *cell = decode::number(text);
            }
        }
        answer.row(cells)?;
    }
    Ok(())
}

/// Returns the statement with a cast to text for columns whose type has no cell (times, decimal numbers,
/// arrays of integers); `None` if there are no such columns.
fn with_texts(text: &str, columns: &[PgColumn]) -> Option<String> {
    let is_cell = |column: &PgColumn| decode::is_postgres_cell(column.type_info().name());
    if columns.iter().all(is_cell) {
        return None;
    }
    // Names need not be different.
    let places: Vec<_> = (1..=columns.len()).map(|place| format!("column_{place}")).collect();
    let shown = columns.iter().zip(&places).map(|(column, place)| {
        if is_cell(column) { place.clone() } else { format!("cast({place} as text)") }
    });
    Some(format!(
        "select {} from ({}\n) as asked ({})",
        shown.collect::<Vec<_>>().join(", "),
        text.trim_end().trim_end_matches(';'),
        places.join(", ")
    ))
}

fn names<C: Column>(columns: &[C]) -> Vec<String> {
    columns.iter().map(|column| schema::spelled(column.name()).to_owned()).collect()
}

/// Converts the error of a statement. `SQLITE_READONLY` and its extended codes have this low byte.
/// PostgreSQL has one code for a read-only transaction and one for a view that cannot be written.
fn refused(error: sqlx::Error) -> LibraryError {
    let sqlx::Error::Database(database) = &error else { return error.into() };
    let code = database.code().unwrap_or_default();
    let sqlite_result = code.parse::<u32>().map(|code| code % 256);
    if sqlite_result == Ok(8) && code.len() < 5 || ["25006", "55000"].contains(&&*code) {
        return LibraryError::OnlyReads;
    }
    LibraryError::BadQuery { reason: database.message().to_owned() }
}
