//! Verification of constraints that PostgreSQL does not enforce.

use super::Survey;
use crate::LibraryError;
use crate::engine::sql;

/// Statements that count orphaned rows and find the lowest index of one. PostgreSQL has no foreign key from
/// a result to its case, nor from a series to its result (docs/decisions/0035).
const LOOSE: [(&str, &str); 3] = [
    (
        "orphaned results: their case is missing",
        "select count(*) as n, min(sobol_index) as first_index from case_result
        left join campaign_case using (campaign_id, sobol_index) where state is null",
    ),
    (
        "results without their series",
        "select count(*) as n, min(sobol_index) as first_index from case_result
        cross join unnest(speeds_km_h) as of (speed_km_h)
        left join case_series
            on result_id = id and case_series.speed_km_h = of.speed_km_h
        where result_id is null",
    ),
    (
        "series without their results",
        "select count(*) as n, cast(null as bigint) as first_index from case_series
        left join case_result on id = result_id where id is null",
    ),
];

/// Relations of the schema that are not read completely: name of a table or view, and one of its columns.
const RELATIONS: [(&str, &str); 9] = [
    ("case_result", "checksum"),
    ("case_series", "log_power"),
    ("case_count", "cases"),
    ("trial_lease", "worker"),
    ("result_with_parameters", "checksum"),
    ("campaign_status", "cases"),
    ("failed_case", "error"),
    ("spectrum", "log_power"),
    ("campaign_progress", "finished"),
];

/// Triggers that maintain the counts of cases.
const TRIGGERS: [&str; 3] = ["count_inserted_case", "count_updated_case", "count_deleted_case"];

impl<F: FnMut()> Survey<'_, F> {
    pub(super) async fn server(&mut self) -> Result<(), LibraryError> {
        self.relations().await?;
        self.indexes().await?;
        for (what, ask) in LOOSE {
            let found = self.library.readers().row(sql(ask)).await.and_then(|row| {
                let Some(row) = row else { return Ok((0, None)) };
                Ok((row.get_u32("n")?.into(), row.get::<Option<i64>>("first_index")?))
            });
            let name = self.library.name();
            match found {
                Ok((0, _)) => {}
                Ok((count, first)) => {
                    let first_index = first.and_then(|index| u32::try_from(index).ok());
                    self.add(&name, what, count, first_index);
                }
                Err(error) => self.unreadable(&name, what, error)?,
            }
        }
        Ok(())
    }

    async fn relations(&mut self) -> Result<(), LibraryError> {
        let (readers, name) = (self.library.readers(), self.library.name());
        for (relation, column) in RELATIONS {
            let ask = sql(format!("select {column} from {relation} where false"));
            if let Err(error) = readers.rows(ask).await {
                self.unreadable(&name, relation, error)?;
            }
        }
        for trigger in TRIGGERS {
            let ask =
                "select tgname as name from pg_trigger where tgname = $1 and tgenabled <> 'D'";
            if readers.row(sql(ask).bind(trigger)).await?.is_none() {
                self.add(&name, format!("the trigger {trigger} is missing"), 1, None);
            }
        }
        Ok(())
    }

    /// Lets the server check its indexes if the extension `amcheck` is installed in the database.
    async fn indexes(&mut self) -> Result<(), LibraryError> {
        let (readers, name) = (self.library.readers(), self.library.name());
        let there = "select extname as name from pg_extension where extname = 'amcheck'";
        if readers.row(sql(there)).await?.is_none() {
            let note =
                "indexes are not looked over: `create extension amcheck` lets the server do it";
            self.found.notes.push(note.to_owned());
            return Ok(());
        }
        let indexes = "select cast(pg_class.oid as bigint) as id, relname as name from pg_class
            join pg_am on pg_am.oid = relam
            where relkind = 'i' and amname = 'btree' and relnamespace = current_schema()::regnamespace
            order by relname";
        for index in readers.rows(sql(indexes)).await? {
            let check = sql("select cast(bt_index_check(cast($1 as oid), true) as text)");
            let checked = readers.rows(check.bind(index.get::<i64>("id")?)).await;
            if let Err(error) = checked {
                let index: String = index.get("name")?;
                self.unreadable(&name, &format!("the index {index}"), error)?;
            }
        }
        Ok(())
    }
}
