//! Reading tables out, whole.

use super::{Cell, Table, decode};
use crate::engine::sql;
use crate::{Library, LibraryError};
use tokio_stream::StreamExt;

impl Library {
    /// Hands the rows of a table to `take`, by its key, at most `rows_max` at a time.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read; or what `take` says.
    pub async fn read_table<E: From<LibraryError>>(
        &self,
        table: &Table,
        rows_max: usize,
        mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
    ) -> Result<(), E> {
        let ask = format!(
            "select {} from {} order by {}",
            table.column_list(),
            table.name,
            table.key.join(", ")
        );
        let mut stream = self.readers().stream(sql(ask));
        let mut rows = Vec::new();
        while let Some(row) = stream.next().await {
            rows.push(decode::table_row(table, &row?)?);
            if rows.len() == rows_max {
                take(std::mem::take(&mut rows)).await?;
            }
        }
        if rows.is_empty() { Ok(()) } else { take(rows).await }
    }

    /// How many rows a table has.
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
