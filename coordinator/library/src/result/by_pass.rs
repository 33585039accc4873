//! A row a pass, as a file has it.

use super::LEVEL_COLUMNS;
use crate::LibraryError;
use crate::engine::{Connection, Dialect, iso_utc, sql};
use crate::report::{CaseReport, Report};
use tracktwin_signal::Features;

/// The columns that are one for a whole report, and then those that are not.
const INSERT: &str = "insert into result (campaign_id, worker, code_version, model_hash,
    experiment_hash, finished_at, flagged, sobol_index, speed_km_h, duration_s, parameter_hash, log_power";

/// Rows in one statement at most: 64 rows of 32 values stay well below the 32,766 that `SQLite` takes.
const ROWS_MAX: usize = 64;

/// Statements of as many rows as a power of two, so that there are few to prepare: each costs a turn
/// of the thread that speaks to the file.
pub(super) async fn insert(
    connection: &mut Connection,
    report: &Report,
    finished: &[(&CaseReport, &[Features])],
    flagged: Option<String>,
) -> Result<(), LibraryError> {
    let passes = finished.iter().flat_map(|&(case, features)| {
        let speeds = report.speeds_km_h.iter();
        speeds.zip(features).map(move |(&speed_km_h, features)| (case, speed_km_h, features))
    });
    let passes: Vec<_> = passes.collect();
    let finished_at = iso_utc(report.now_unix_ms);
    let mut rest = &passes[..];
    while !rest.is_empty() {
        let largest = 1 << rest.len().ilog2();
        let (rows, after) = rest.split_at(ROWS_MAX.min(largest));
        let places = Dialect::Sqlite.rows_of_values(rows.len(), 12 + LEVEL_COLUMNS.len());
        let mut insert = sql(format!("{INSERT}, {}) values {places}", LEVEL_COLUMNS.join(", ")));
        for (case, speed_km_h, features) in rows {
            insert = insert
                .bind(&report.campaign)
                .bind(&report.worker)
                .bind(&report.code_version)
                .bind(&report.model_hash)
                .bind(&report.experiment_hash)
                .bind(&finished_at)
                .bind(flagged.clone())
                .bind(case.index)
                .bind(*speed_km_h)
                .bind(case.duration_s)
                .bind(&case.parameter_hash)
                .bind(&features.log_power[..]);
            let levels = &features.band_levels_db;
            insert = levels.iter().fold(insert, |insert, &level| insert.bind(level));
        }
        connection.execute(insert).await?;
        rest = after;
    }
    Ok(())
}
