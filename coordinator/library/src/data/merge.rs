//! Rows of a copy that exist already: what is kept of them, and what is taken from the source.
//!
//! Cases and results never change, so the existing ones are kept. Workers, progress and audits change while a
//! campaign runs; a continued copy takes their later state. Flags of results are added and never removed.

use super::Table;
use super::cell::Cell;
use crate::engine::{Connection, Text, Write, sql};
use crate::{Library, LibraryError};
use std::collections::{BTreeMap, HashSet};

/// Flags results ($3) of a campaign ($1) by a worker ($2) that are not flagged, with the reason $4.
const FLAG: Text = Text::Each {
    sqlite: "
        update result set flagged = $4
        where campaign_id = $1 and worker = $2 and flagged is null
            and sobol_index in (select value from json_each($3))",
    postgres: "
        update case_result set flagged = $4
        where campaign_id = $1 and worker = $2 and flagged is null and sobol_index = any($3)",
};

/// Condition under which the row of the source (`excluded`) replaces an existing one; `None` for tables whose
/// rows are kept.
fn is_later(table: &Table) -> Option<&'static str> {
    match table.name {
        "worker" => Some("excluded.last_seen_unix_ms >= worker.last_seen_unix_ms"),
        "progress" => {
            Some("excluded.finished + excluded.failed >= progress.finished + progress.failed")
        }
        "audit" => Some(
            "audit.state in ('waiting', 'leased') and excluded.state in ('agrees', 'differs')
                and audit.worker = excluded.worker",
        ),
        _ => None,
    }
}

/// Whether existing rows of a table are replaced by later ones.
pub(super) fn replaces(table: &Table) -> bool {
    is_later(table).is_some()
}

/// The clause of an insertion for rows that exist: they are kept, or replaced by rows that differ and are later.
pub(super) fn on_conflict(table: &Table) -> String {
    let key = table.key.join(", ");
    let Some(is_later) = is_later(table) else {
        return format!("on conflict ({key}) do nothing");
    };
    let name = table.name;
    let others = table.columns.iter().map(|column| column.name);
    let others: Vec<_> = others.filter(|column| !table.key.contains(column)).collect();
    let set: Vec<_> = others.iter().map(|it| format!("{it} = excluded.{it}")).collect();
    let differs: Vec<_> =
        others.iter().map(|it| format!("{name}.{it} is distinct from excluded.{it}")).collect();
    format!(
        "on conflict ({key}) do update set {} where {is_later} and ({})",
        set.join(", "),
        differs.join(" or ")
    )
}

/// Keeps one row of each key. A statement must not replace a row twice, and a salvaged row may come twice.
pub(super) fn without_duplicates(table: &Table, mut rows: Vec<Vec<Cell>>) -> Vec<Vec<Cell>> {
    let places: Vec<usize> = table.key.iter().filter_map(|name| table.column(name)).collect();
    let mut known = HashSet::new();
    rows.retain(|row| {
        let key: Vec<_> = places.iter().map(|&place| row.get(place)).collect();
        known.insert(format!("{key:?}"))
    });
    rows
}

impl Library {
    /// Flags existing results whose rows in the source are flagged. Results of another worker are kept as they
    /// are: they are not the ones that the source says are wrong.
    pub(super) async fn flag_those_here(
        &self,
        table: &Table,
        rows: &[Vec<Cell>],
    ) -> Result<(), LibraryError> {
        let columns = ["campaign_id", "worker", "flagged", "sobol_index"];
        let places = columns.map(|name| table.column(name));
        let [Some(campaign), Some(worker), Some(flagged), Some(index)] = places else {
            return Ok(());
        };
        let mut of_reason: BTreeMap<[String; 3], Vec<i64>> = BTreeMap::new();
        for row in rows {
            if let (
                Cell::Text(campaign),
                Cell::Text(worker),
                Cell::Text(reason),
                Cell::Integer(index),
            ) = (&row[campaign], &row[worker], &row[flagged], &row[index])
            {
                let key = [campaign, worker, reason].map(String::clone);
                of_reason.entry(key).or_default().push(*index);
            }
        }
        if of_reason.is_empty() {
            return Ok(());
        }
        self.write(Flags { of_reason }).await
    }
}

/// Flags by campaign, worker and reason, each with the indices of its cases.
struct Flags {
    of_reason: BTreeMap<[String; 3], Vec<i64>>,
}

impl Write for Flags {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        for ([campaign, worker, reason], indices) in &self.of_reason {
            let flag = sql(FLAG).bind(campaign).bind(worker).bind(indices.clone()).bind(reason);
            connection.execute(flag).await?;
        }
        Ok(())
    }
}
