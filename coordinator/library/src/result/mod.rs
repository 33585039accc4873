//! The relation `result`: features of each case at each speed.
//!
//! With `SQLite`, `result` is a table with one row per pass. With PostgreSQL it is a view of `case_result`,
//! which has one row per case, and `case_series`, which has one row per pass (docs/decisions/0030 and
//! 0035).

mod by_case;
mod by_pass;
mod columns;
mod contact;
mod entry;
mod stored;
mod training_set;

pub use contact::ContactLoss;
pub use entry::LibraryEntry;

pub(crate) use by_case::{gathering, lock};
pub(crate) use columns::{LEVEL_COLUMNS, features_of};
pub(crate) use stored::{Attested, Gathering, StoredCase, passes_of};

use crate::LibraryError;
use crate::engine::{Connection, Dialect, Text, sql};
use crate::report::Report;
use tracktwin_experiment::PassFeatures;
use tracktwin_protocol::CaseReport;
use tracktwin_signal::Features;

/// Deletes the results of cases ($2) of a campaign ($1).
const DISCARD: Text = Text::Each {
    sqlite: "delete from result where campaign_id = $1 and sobol_index in (select value from json_each($2))",
    postgres: "
        with discarded as (
            delete from case_result where campaign_id = $1 and sobol_index = any($2) returning id)
        delete from case_series where result_id in (select id from discarded)",
};

/// Number of a worker's ($1) results that are not flagged.
const UNFLAGGED: &str =
    "select count(*) as results from result where worker = $1 and flagged is null";

/// Flags these results with the reason $2.
const FLAG: Text = Text::Each {
    sqlite: "update result set flagged = $2 where worker = $1 and flagged is null",
    postgres: "update case_result set flagged = $2 where worker = $1 and flagged is null",
};

/// Deletes the results of cases.
pub(crate) async fn discard(
    connection: &mut Connection,
    campaign: &str,
    indices: &[i64],
) -> Result<(), LibraryError> {
    connection.execute(sql(DISCARD).bind(campaign).bind(indices.to_vec())).await.map(drop)
}

/// Flags all results of a worker that are not flagged yet. Returns the number of them.
pub(crate) async fn flag(
    connection: &mut Connection,
    worker: &str,
    reason: &str,
) -> Result<u64, LibraryError> {
    let theirs = connection.row(sql(UNFLAGGED).bind(worker)).await?;
    connection.execute(sql(FLAG).bind(worker).bind(reason)).await?;
    theirs.map_or(Ok(0), |row| row.get_u32("results").map(u64::from))
}

/// Stores the results of cases that have none. If a reason is given, the results are flagged with it.
///
/// # Panics
/// Panics if the shape of features differs from that of the first ones. The receiver of the message must
/// check this.
pub(crate) async fn insert_results(
    connection: &mut Connection,
    report: &Report,
    finished: &[(&CaseReport, &[PassFeatures])],
    flagged: Option<String>,
) -> Result<(), LibraryError> {
    let shape = |features: &Features| (features.log_power.len(), features.band_levels_db.len());
    let first = finished.iter().find_map(|(_, passes)| passes.first());
    let expected = (first.map_or(0, |it| it.features.log_power.len()), LEVEL_COLUMNS.len());
    for (_, passes) in finished {
        assert!(
            passes.iter().map(|it| it.speed_km_h).eq(report.speeds_km_h.iter().copied()),
            "a pass at each speed"
        );
        assert!(passes.iter().all(|it| shape(&it.features) == expected), "passes of one shape");
    }
    match connection.dialect() {
        Dialect::Sqlite => by_pass::insert(connection, report, finished, flagged).await,
        Dialect::Postgres => by_case::insert(connection, report, finished, flagged).await,
    }
}
