//! Columns of results that both databases have.

use crate::LibraryError;
use crate::engine::{Row, Statement, iso_utc};
use crate::report::Report;
use tracktwin_signal::Features;

/// The columns of one-third-octave levels, ascending; 50 to 4000 Hz.
pub(crate) const LEVEL_COLUMNS: [&str; 20] = [
    "level_50_Hz_dB",
    "level_63_Hz_dB",
    "level_80_Hz_dB",
    "level_100_Hz_dB",
    "level_125_Hz_dB",
    "level_160_Hz_dB",
    "level_200_Hz_dB",
    "level_250_Hz_dB",
    "level_315_Hz_dB",
    "level_400_Hz_dB",
    "level_500_Hz_dB",
    "level_630_Hz_dB",
    "level_800_Hz_dB",
    "level_1000_Hz_dB",
    "level_1250_Hz_dB",
    "level_1600_Hz_dB",
    "level_2000_Hz_dB",
    "level_2500_Hz_dB",
    "level_3150_Hz_dB",
    "level_4000_Hz_dB",
];

pub(crate) fn features_of(row: &Row) -> Result<Features, LibraryError> {
    Ok(Features { log_power: row.doubles("log_power")?, band_levels_db: levels_of(row)? })
}

pub(super) fn levels_of(row: &Row) -> Result<Vec<f64>, LibraryError> {
    LEVEL_COLUMNS.iter().map(|&column| row.get(column)).collect()
}

/// Binds the values of a report in both databases: campaign, worker, version, model, experiment and time.
pub(super) fn of_report(insert: Statement, report: &Report) -> Statement {
    insert
        .bind(&report.campaign)
        .bind(&report.worker)
        .bind(&report.code_version)
        .bind(&report.model_hash)
        .bind(&report.experiment_hash)
        .bind(iso_utc(report.now_unix_ms))
}
