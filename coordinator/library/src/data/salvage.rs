//! Reading of the intact rows of a damaged library.

use super::{Cell, Table, read};
use crate::engine::{Dialect, Statement, sql};
use crate::{Library, LibraryError};
use std::ops::Range;

/// Number of rows or cases that are read together. A range that cannot be read is divided into halves.
const TOGETHER: i64 = 1024;

/// Upper limit of the indices searched if the number of cases is unknown.
const INDICES_MAX: i64 = 1 << 20;

/// Unreadable rows of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lost {
    /// Maximum number of lost rows, if it is known. In a range of cases, each case counts as one row.
    pub rows: Option<u64>,
    /// Error of the database at the first unreadable row.
    pub reason: String,
}

/// How to address the rows of a table one by one.
enum Way {
    /// By `rowid` of `SQLite`, without use of any index.
    Rowid { max: i64 },
    /// By campaign and case index.
    Index { campaigns: Vec<(String, i64)> },
    /// Not possible: the table is read from both ends, as far as possible.
    Ends,
}

impl Library {
    /// As [`Library::read_table`], but skips unreadable rows and returns what was skipped. A row may be
    /// passed to `take` twice, and the order of the rows is undefined.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if the library does not respond, or the error of `take`.
    pub async fn read_what_is_whole<E: From<LibraryError>>(
        &self,
        table: &Table,
        rows_max: usize,
        mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
    ) -> Result<Option<Lost>, E> {
        let Err(error) = self.read(table, read::by_key(table, ""), rows_max, &mut take).await?
        else {
            return Ok(None);
        };
        if !error.is_of_the_data() {
            return Err(error.into());
        }
        let reason = super::verify::reason(&error);
        let ranges = match self.way(table).await {
            Way::Rowid { max } => {
                let ask = format!(
                    "select {} from {} not indexed where rowid >= $1 and rowid < $2",
                    table.column_list(),
                    table.name
                );
                vec![(sql(ask), max)]
            }
            Way::Index { campaigns } => {
                let ask = format!(
                    "select {} from {} where campaign_id = $1 and sobol_index >= $2
                        and sobol_index < $3",
                    table.column_list(),
                    table.name
                );
                let of = |(campaign, max): (String, i64)| (sql(ask.clone()).bind(campaign), max);
                campaigns.into_iter().map(of).collect()
            }
            Way::Ends => {
                let backwards = self.read(table, read::by_key(table, "desc"), rows_max, take);
                return Ok(backwards.await?.err().map(|_| Lost { rows: None, reason }));
            }
        };
        let mut rows = 0;
        for (ask, max) in ranges {
            rows += self.read_ranges(table, &ask, max, &mut take).await?;
        }
        // What only an index had lost is found without it.
        Ok((rows > 0).then_some(Lost { rows: Some(rows), reason }))
    }

    /// Reads a table in ranges of numbers, and divides unreadable ranges into halves. Returns how many
    /// single numbers could not be read.
    async fn read_ranges<E: From<LibraryError>>(
        &self,
        table: &Table,
        ask: &Statement,
        max: i64,
        mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
    ) -> Result<u64, E> {
        let mut lost = 0;
        for start in (0..=max).step_by(TOGETHER as usize) {
            let whole: Range<i64> = start..start + TOGETHER;
            let mut ranges = vec![whole];
            while let Some(range) = ranges.pop() {
                let mut found = Vec::new();
                let keep = async |rows: Vec<Vec<Cell>>| {
                    found.extend(rows);
                    Ok::<(), E>(())
                };
                let part = ask.clone().bind(range.start).bind(range.end);
                match self.read(table, part, usize::MAX, keep).await? {
                    Ok(()) => take(found).await?,
                    Err(error) if !error.is_of_the_data() => return Err(error.into()),
                    Err(_) if range.end - range.start == 1 => lost += 1,
                    Err(_) => {
                        let middle = i64::midpoint(range.start, range.end);
                        ranges.extend([middle..range.end, range.start..middle]);
                    }
                }
            }
        }
        Ok(lost)
    }

    async fn way(&self, table: &Table) -> Way {
        if self.readers().dialect() == Dialect::Sqlite
            && let Some(max) = self.largest_rowid(table).await
        {
            return Way::Rowid { max };
        }
        let Ok(campaigns) = self.campaigns().await else { return Way::Ends };
        if table.column("sobol_index").is_none() {
            return Way::Ends;
        }
        let mut known = Vec::new();
        for campaign in campaigns {
            let cases = self.status(&campaign.id).await.map(|status| i64::from(status.total()));
            known.push((campaign.id, cases.unwrap_or(INDICES_MAX)));
        }
        Way::Index { campaigns: known }
    }

    /// The largest `rowid` of a table; `None` if its rows have none.
    async fn largest_rowid(&self, table: &Table) -> Option<i64> {
        // Where the table's own end cannot be read, its index knows as well.
        for order in ["rowid", &table.key.join(", ")] {
            let ask = format!(
                "select max(number) as n from (select rowid as number from {} order by {order})",
                table.name
            );
            if let Ok(Some(row)) = self.readers().row(sql(ask)).await {
                return row.get("n").ok();
            }
        }
        None
    }
}
