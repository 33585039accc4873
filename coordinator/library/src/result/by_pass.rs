//! Storage in a `SQLite` file: one row per pass.

use super::columns::{LEVEL_COLUMNS, of_report};
use crate::LibraryError;
use crate::engine::{Connection, sql};
use crate::report::Report;
use tracktwin_experiment::PassFeatures;
use tracktwin_protocol::CaseReport;

/// The columns with one value per report, and then those with one value per pass, without the levels.
const INSERT: &str = "insert into result (campaign_id, worker, code_version, model_hash,
    experiment_hash, finished_at, flagged, sobol_index, speed_km_h, duration_s, parameter_hash, checksum,
    contact_loss_share, log_power";
const OF_A_REPORT: usize = 7;
const OF_A_PASS: usize = 7 + LEVEL_COLUMNS.len();

/// Maximum number of rows in one statement. 64 rows of 27 values are well below the 32,766 values that
/// `SQLite` accepts.
const ROWS_MAX: usize = 64;

/// Inserts results. The number of rows in a statement is a power of two, so that few different statements
/// must be prepared. Each statement costs one call of the thread of the connection.
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

/// Placeholders for this number of rows. Each row has the report's values, bound once after those of all
/// passes, and the values of its pass.
///
/// Unnamed placeholders take the values in order, independent of named placeholders between them.
fn places(rows: usize) -> String {
    let of_report: Vec<_> =
        (1..=OF_A_REPORT).map(|value| format!("${}", rows * OF_A_PASS + value)).collect();
    let row = format!("({}, {})", of_report.join(", "), ["?"; OF_A_PASS].join(", "));
    vec![row; rows].join(", ")
}
