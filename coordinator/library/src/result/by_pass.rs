//! A row a pass, as a file has it.

use super::columns::{LEVEL_COLUMNS, of_report};
use crate::LibraryError;
use crate::engine::{Connection, sql};
use crate::report::Report;
use tracktwin_experiment::PassFeatures;
use tracktwin_protocol::CaseReport;

/// The columns that are one for a whole report, and then those that are not, without the levels.
const INSERT: &str = "insert into result (campaign_id, worker, code_version, model_hash,
    experiment_hash, finished_at, flagged, sobol_index, speed_km_h, duration_s, parameter_hash, checksum,
    contact_loss_share, log_power";
const OF_A_REPORT: usize = 7;
const OF_A_PASS: usize = 7 + LEVEL_COLUMNS.len();

/// Rows in one statement at most: 64 rows of 27 values stay well below the 32,766 that `SQLite` takes.
const ROWS_MAX: usize = 64;

/// Statements of as many rows as a power of two, so that there are few to prepare: each costs a turn
/// of the thread that speaks to the file.
pub(super) async fn insert(
    connection: &mut Connection,
    report: &Report,
    finished: &[(&CaseReport, &[PassFeatures])],
    flagged: Option<String>,
) -> Result<(), LibraryError> {
    let passes =
        finished.iter().flat_map(|&(case, passes)| passes.iter().map(move |it| (case, it)));
    let passes: Vec<_> = passes.collect();
    let mut rest = &passes[..];
    while !rest.is_empty() {
        let largest = 1 << rest.len().ilog2();
        let (rows, after) = rest.split_at(ROWS_MAX.min(largest));
        let mut insert =
            sql(format!("{INSERT}, {}) values {}", LEVEL_COLUMNS.join(", "), places(rows.len())));
        for (case, pass) in rows {
            insert = insert
                .bind(case.index)
                .bind(pass.speed_km_h)
                .bind(case.duration_s)
                .bind(&case.parameter_hash)
                .bind(&case.checksum)
                .bind(pass.contact_loss_share)
                .bind(&pass.features.log_power[..]);
            let levels = &pass.features.band_levels_db;
            insert = levels.iter().fold(insert, |insert, &level| insert.bind(level));
        }
        let insert = of_report(insert, report).bind(flagged.clone());
        connection.execute(insert).await?;
        rest = after;
    }
    Ok(())
}

/// So many rows of a report's values, which stand once behind those of all passes, and of a pass's own.
///
/// Values without a name are taken in order, whatever names stand between them.
fn places(rows: usize) -> String {
    let of_report: Vec<_> =
        (1..=OF_A_REPORT).map(|value| format!("${}", rows * OF_A_PASS + value)).collect();
    let row = format!("({}, {})", of_report.join(", "), ["?"; OF_A_PASS].join(", "));
    vec![row; rows].join(", ")
}
