//! The connection that writes, and the connections that read.

use super::retry_budget::RetryBudget;
use super::sqlite::OpenFile;
use super::writer::SERVER_TIMEOUT;
use super::{Dialect, Row, Statement, sql};
use crate::LibraryError;
use sqlx::{Connection as _, PgConnection, PgPool, SqliteConnection, SqlitePool};
use std::pin::Pin;
use tokio_stream::{Stream, StreamExt};

/// Target of the log events (level `trace`) with each statement of a writing connection.
const STATEMENTS: &str = "tracktwin_library::statements";

/// A writing connection, inside a transaction.
pub(crate) enum Connection {
    Sqlite(SqliteConnection, OpenFile),
    Postgres(PgConnection),
}

impl Connection {
    pub(crate) const fn dialect(&self) -> Dialect {
        match self {
            Self::Sqlite(..) => Dialect::Sqlite,
            Self::Postgres(_) => Dialect::Postgres,
        }
    }

    /// Runs a statement. Returns the number of changed rows.
    pub(crate) async fn execute(&mut self, statement: Statement) -> Result<u64, LibraryError> {
        self.tell(&statement);
        Ok(match self {
            Self::Sqlite(connection, _) => {
                statement.for_sqlite().execute(connection).await?.rows_affected()
            }
            Self::Postgres(connection) => {
                statement.for_postgres().execute(connection).await?.rows_affected()
            }
        })
    }

    pub(crate) async fn rows(&mut self, statement: Statement) -> Result<Vec<Row>, LibraryError> {
        self.tell(&statement);
        Ok(match self {
            Self::Sqlite(connection, _) => {
                let rows = statement.for_sqlite().fetch_all(connection).await?;
                rows.into_iter().map(Row::Sqlite).collect()
            }
            Self::Postgres(connection) => {
                let rows = statement.for_postgres().fetch_all(connection).await?;
                rows.into_iter().map(Row::Postgres).collect()
            }
        })
    }

    /// Traces a statement. A test compares the description of the lease protocol (docs/lease-protocol.md)
    /// with these traces.
    fn tell(&self, statement: &Statement) {
        tracing::trace!(target: STATEMENTS, text = &*statement.text(self.dialect()));
    }

    pub(crate) async fn row(&mut self, statement: Statement) -> Result<Option<Row>, LibraryError> {
        Ok(self.rows(statement).await?.into_iter().next())
    }

    /// The case indices that a statement returns, in its order.
    pub(crate) async fn indices(&mut self, statement: Statement) -> Result<Vec<i64>, LibraryError> {
        self.rows(statement).await?.iter().map(|row| row.get("sobol_index")).collect()
    }

    /// Begins a transaction. With `SQLite` it is a writing transaction from the start: a change from
    /// reading to writing may be refused despite a timeout.
    pub(super) async fn begin(&mut self) -> Result<(), LibraryError> {
        let text = match self {
            Self::Sqlite(..) => "begin immediate",
            Self::Postgres(_) => "begin",
        };
        self.execute(sql(text)).await.map(drop)
    }

    /// Commits the transaction. With `SQLite`, checks before that the file still exists at its path.
    pub(super) async fn commit(&mut self) -> Result<(), LibraryError> {
        if let Self::Sqlite(_, file) = self {
            file.check()?;
        }
        self.execute(sql("commit")).await.map(drop)
    }

    /// Rolls the present transaction back, if there is one.
    pub(super) async fn rollback(&mut self) {
        // It fails if the database has rolled back already, or if the connection is lost.
        let _ = self.execute(sql("rollback")).await;
    }

    pub(super) async fn close(self) {
        // What is committed is on the disk already; closing only tidies up.
        let _ = match self {
            Self::Sqlite(connection, _) => connection.close().await,
            Self::Postgres(connection) => connection.close().await,
        };
    }
}

/// The reading connections.
#[derive(Clone)]
pub(crate) enum Readers {
    Sqlite(SqlitePool),
    Postgres(PgPool),
}

impl Readers {
    pub(crate) const fn dialect(&self) -> Dialect {
        match self {
            Self::Sqlite(_) => Dialect::Sqlite,
            Self::Postgres(_) => Dialect::Postgres,
        }
    }

    /// Returns all rows. An unavailable database is retried within the retry budget.
    pub(crate) async fn rows(&self, statement: Statement) -> Result<Vec<Row>, LibraryError> {
        let mut budget = RetryBudget::new(true);
        loop {
            let asked = self.stream(statement.clone()).collect::<Result<Vec<_>, _>>();
            match self.within_bounds(asked).await {
                Err(error) if error.is_unavailable() => {
                    if budget.wait().await.is_err() {
                        return Err(error);
                    }
                }
                done => return done,
            }
        }
    }

    /// Applies a time limit to calls of a server. A server that does not respond counts as lost, even if
    /// the network reports no error.
    async fn within_bounds<T>(
        &self,
        asked: impl Future<Output = Result<T, LibraryError>>,
    ) -> Result<T, LibraryError> {
        match self {
            Self::Sqlite(_) => asked.await,
            Self::Postgres(_) => tokio::time::timeout(SERVER_TIMEOUT, asked)
                .await
                .unwrap_or_else(|_| Err(LibraryError::silent(SERVER_TIMEOUT))),
        }
    }

    pub(crate) async fn row(&self, statement: Statement) -> Result<Option<Row>, LibraryError> {
        Ok(self.rows(statement).await?.into_iter().next())
    }

    /// Returns the rows as a stream, so that the memory does not grow with their number.
    pub(crate) fn stream(
        &self,
        statement: Statement,
    ) -> Pin<Box<dyn Stream<Item = Result<Row, LibraryError>> + Send + '_>> {
        match self {
            Self::Sqlite(pool) => {
                let rows = statement.for_sqlite().fetch(pool);
                Box::pin(rows.map(|row| Ok(Row::Sqlite(row?))))
            }
            Self::Postgres(pool) => {
                let rows = statement.for_postgres().fetch(pool);
                Box::pin(rows.map(|row| Ok(Row::Postgres(row?))))
            }
        }
    }

    /// Checks that the pages of the database are consistent. A PostgreSQL server checks each page itself
    /// when it reads the page.
    ///
    /// # Errors
    /// [`LibraryError::Malformed`].
    pub(crate) async fn refuse_malformed(&self) -> Result<(), LibraryError> {
        match self {
            Self::Sqlite(pool) => super::sqlite_schema::refuse_malformed(pool).await,
            Self::Postgres(_) => Ok(()),
        }
    }

    pub(crate) async fn close(&self) {
        match self {
            Self::Sqlite(pool) => pool.close().await,
            Self::Postgres(pool) => pool.close().await,
        }
    }
}
