//! Reading of complete tables.

use super::attest::Attestation;
use super::{Cell, Table, decode};
use crate::engine::{Statement, sql};
use crate::{Library, LibraryError};
use tokio_stream::StreamExt;

impl Library {
    /// Passes all rows of a table to `take`, in the order of the table's key, at most `rows_max` per call.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if the library cannot be read or results do not match their checksum, or
    /// the error of `take`.
    pub async fn read_table<E: From<LibraryError>>(
        &self,
        table: &Table,
        rows_max: usize,
        mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut attestation = Attestation::of(table);
        let attested = async |rows: Vec<Vec<Cell>>| {
            attestation.take(&rows)?;
            take(rows).await
        };
        self.read(table, by_key(table, ""), rows_max, attested).await??;
        Ok(attestation.end()?)
    }

    /// Passes the rows of a statement to `take`. The inner result has an error of reading, the outer one an
    /// error of `take`.
    pub(super) async fn read<E>(
        &self,
        table: &Table,
        ask: Statement,
        rows_max: usize,
        mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
    ) -> Result<Result<(), LibraryError>, E> {
        let mut stream = self.readers().stream(ask);
        let mut rows = Vec::new();
        while let Some(row) = stream.next().await {
            match row.and_then(|row| decode::table_row(table, &row)) {
                Ok(row) => rows.push(row),
                Err(error) => {
                    // What came before is whole.
                    take(rows).await?;
                    return Ok(Err(error));
                }
            }
            if rows.len() == rows_max {
                take(std::mem::take(&mut rows)).await?;
            }
        }
        if !rows.is_empty() {
            take(rows).await?;
        }
        Ok(Ok(()))
    }

    /// Number of rows of a table.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn count(&self, table: &Table) -> Result<u64, LibraryError> {
        let row =
            self.readers().row(sql(format!("select count(*) as n from {}", table.name))).await?;
        let count = row.map_or(Ok(0), |row| row.get::<i64>("n"))?;
        Ok(count.unsigned_abs())
    }
}

/// Statement that selects all rows of a table, ordered by the key in this direction (`desc`, or empty).
pub(super) fn by_key(table: &Table, direction: &str) -> Statement {
    let key: Vec<_> = table.key.iter().map(|column| format!("{column} {direction}")).collect();
    let (columns, name, key) = (table.column_list(), table.name, key.join(", "));
    sql(format!("select {columns} from {name} order by {key}"))
}
