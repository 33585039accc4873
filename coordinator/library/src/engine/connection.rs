//! The connection that writes, and the connections that read.

use super::retry_budget::RetryBudget;
use super::sqlite::OpenFile;
use super::writer::SERVER_TIMEOUT;
use super::{Dialect, Row, Statement, sql};
use crate::LibraryError;
use sqlx::{Connection as _, PgConnection, PgPool, SqliteConnection, SqlitePool};
use std::pin::Pin;
use tokio_stream::{Stream, StreamExt};

/// Where every statement of a connection that writes is shown, at the level `trace`.
const STATEMENTS: &str = "tracktwin_library::statements";

/// A connection that writes, inside a transaction.
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

    /// Runs a statement; answers how many rows it changed.
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

    /// Traces a statement; a test compares the description of the lease protocol with these
    /// (docs/lease-protocol.md).
    fn tell(&self, statement: &Statement) {
        tracing::trace!(target: STATEMENTS, text = &*statement.text(self.dialect()));
    }

    pub(crate) async fn row(&mut self, statement: Statement) -> Result<Option<Row>, LibraryError> {
        Ok(self.rows(statement).await?.into_iter().next())
    }

    /// The places of cases that a statement answers, in its order.
    pub(crate) async fn indices(&mut self, statement: Statement) -> Result<Vec<i64>, LibraryError> {
        self.rows(statement).await?.iter().map(|row| row.get("sobol_index")).collect()
    }

    /// Begins a transaction; with `SQLite` as one that writes, for a reading one that becomes a
    /// writing one may be refused despite any timeout.
    pub(super) async fn begin(&mut self) -> Result<(), LibraryError> {
        let text = match self {
            Self::Sqlite(..) => "begin immediate",
            Self::Postgres(_) => "begin",
        };
        self.execute(sql(text)).await.map(drop)
    }

    /// Commits the transaction; with `SQLite` only to a file that others still find.
    pub(super) async fn commit(&mut self) -> Result<(), LibraryError> {
        if let Self::Sqlite(_, file) = self {
            file.check()?;
        }
        self.execute(sql("commit")).await.map(drop)
    }

    /// Leaves nothing of the present transaction, if there is one.
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

/// Connections that read.
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

    /// All rows at once, waiting for a database that is away.
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

    /// A server that does not respond is treated as lost, even if the network reports no error.
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

    /// The rows as they come, so that memory does not grow with their number.
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

    /// Refuses a database whose pages do not fit together. A server looks at its pages itself, at each that it
    /// reads.
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
