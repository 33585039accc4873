//! Reading of the intact rows of a damaged library.

use super::{Cell, Table, read};
use crate::engine::{Dialect, Statement, sql};
use crate::{Library, LibraryError};
use std::ops::Range;

/// Number of rows or cases that are read together. A range that cannot be read is divided into halves.
const TOGETHER: i64 = 1024;

/// Number of neighbouring ranges without a readable row after which ranges are skipped: the rows below an
/// interior page of the file. From then on each skip is twice as long as the last.
const RANGES_READ: u32 = 8;

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

/// Rows of a table that are addressed by a number.
struct Numbered {
    /// Statement that selects the rows of a range: from $1 on, below $2, after the values bound already.
    rows: Statement,
    /// Statement that selects the first number from $1 on, as `n`; `None` if the numbers are dense.
    first: Option<Statement>,
    /// Largest number.
    max: i64,
}

/// How to address the rows of a table one by one.
enum Way {
    /// By `rowid` of `SQLite`.
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
        let numbered = match self.way(table).await {
            Way::Rowid { max } => vec![by_rowid(table, max)],
            Way::Index { campaigns } => campaigns
                .into_iter()
                .map(|(campaign, max)| by_index(table, campaign, max))
                .collect(),
            Way::Ends => {
                let backwards = self.read(table, read::by_key(table, "desc"), rows_max, take);
                return Ok(backwards.await?.err().map(|_| Lost { rows: None, reason }));
            }
        };
        let mut rows = Some(0);
        for numbers in numbered {
            let lost = self.read_numbered(table, &numbers, &mut take).await?;
            rows = rows.zip(lost).map(|(before, lost)| before + lost);
        }
        // What only an index had lost is found without it.
        Ok((rows != Some(0)).then_some(Lost { rows, reason }))
    }

    /// Reads numbered rows in ranges. Numbers that do not exist are skipped, so that the effort depends on
    /// the number of rows and not on the largest number, which may be damaged as well. Returns how many
    /// single numbers could not be read; `None` if ranges were skipped unread.
    async fn read_numbered<E: From<LibraryError>>(
        &self,
        table: &Table,
        numbers: &Numbered,
        mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
    ) -> Result<Option<u64>, E> {
        let (mut lost, mut start, mut unreadable) = (Some(0), 0, 0);
        let end = numbers.max.saturating_add(1);
        while start < end {
            match self.first_from(numbers, start).await? {
                Ok(None) => break,
                Ok(Some(first)) => start = start.max(first),
                Err(_) if unreadable >= RANGES_READ => {
                    lost = None;
                    let skipped = 1_i64.checked_shl(unreadable - RANGES_READ);
                    let skipped = skipped.and_then(|ranges| ranges.checked_mul(TOGETHER));
                    start = skipped.and_then(|it| start.checked_add(it)).unwrap_or(i64::MAX);
                    unreadable += 1;
                    continue;
                }
                Err(_) => {}
            }
            let range = start..start.saturating_add(TOGETHER);
            start = range.end;
            let missing = self.read_range(table, &numbers.rows, range, &mut take).await?;
            unreadable = if missing == TOGETHER.unsigned_abs() { unreadable + 1 } else { 0 };
            lost = lost.map(|lost| lost + missing);
        }
        Ok(lost)
    }

    /// The first existing number from `start` on; `None` if there is none. The inner result has the error of
    /// an unreadable row.
    async fn first_from<E: From<LibraryError>>(
        &self,
        numbers: &Numbered,
        start: i64,
    ) -> Result<Result<Option<i64>, LibraryError>, E> {
        let Some(first) = &numbers.first else { return Ok(Ok(Some(start))) };
        let found = self.readers().row(first.clone().bind(start)).await;
        match found.and_then(|row| row.map(|row| row.get("n")).transpose()) {
            Err(error) if !error.is_of_the_data() => Err(error.into()),
            found => Ok(found),
        }
    }

    /// Reads a range of numbers, and divides unreadable ranges into halves. Returns how many single numbers
    /// could not be read.
    async fn read_range<E: From<LibraryError>>(
        &self,
        table: &Table,
        ask: &Statement,
        whole: Range<i64>,
        mut take: impl AsyncFnMut(Vec<Vec<Cell>>) -> Result<(), E>,
    ) -> Result<u64, E> {
        let mut lost = 0;
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

/// The rows of a table by `rowid`, without use of any index.
fn by_rowid(table: &Table, max: i64) -> Numbered {
    let (name, columns) = (table.name, table.column_list());
    let rows = format!("select {columns} from {name} not indexed where rowid >= $1 and rowid < $2");
    let first = format!(
        "select rowid as n from {name} not indexed where rowid >= $1 order by rowid limit 1"
    );
    Numbered { rows: sql(rows), first: Some(sql(first)), max }
}

/// The rows of a campaign by the index of their case.
fn by_index(table: &Table, campaign: String, max: i64) -> Numbered {
    let rows = format!(
        "select {} from {} where campaign_id = $1 and sobol_index >= $2 and sobol_index < $3",
        table.column_list(),
        table.name
    );
    Numbered { rows: sql(rows).bind(campaign), first: None, max }
}
