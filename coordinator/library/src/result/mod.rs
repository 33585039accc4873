//! `result`: what came out of each case at each speed.
//!
//! With `SQLite` a table of a row a pass; with PostgreSQL a view of `case_result`, which has a row a
//! case, and `case_series`, which has a row a pass: docs/decisions/0030 and 0035.

mod by_case;
mod by_pass;
mod contact;
mod stored;

pub use contact::ContactLoss;

pub(crate) use by_case::{gathering, lock};
pub(crate) use stored::{Attested, Gathering, StoredCase, passes_of};

use crate::engine::{Connection, Dialect, Row, Statement, iso_utc, sql};
use crate::report::Report;
use crate::{Library, LibraryError};
use tracktwin_experiment::PassFeatures;
use tracktwin_parameters::Case;
use tracktwin_protocol::CaseReport;
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

/// A finished case: what went in and what came out.
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryEntry {
    /// The case.
    pub case: Case,
    /// Features, one a speed of the campaign, by ascending speed.
    pub features: Vec<Features>,
}

impl Library {
    /// Hands every finished case of a campaign to `take`, by ascending index.
    ///
    /// One entry is held at a time, so a million cases need no more memory than one.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read, a case lacks a speed, or its results do not have
    /// their checksum.
    pub async fn training_set(
        &self,
        campaign: &str,
        mut take: impl FnMut(LibraryEntry),
    ) -> Result<(), LibraryError> {
        let speeds = self.campaign(campaign).await?.speeds_km_h.len();
        let complete = |case: StoredCase| complete(case, speeds).map(&mut take);
        self.stored_cases(campaign, complete).await
    }
}

fn complete(case: StoredCase, speeds: usize) -> Result<LibraryEntry, LibraryError> {
    let (index, found) = (case.case.index, case.passes.len());
    if found == speeds {
        return case.entry();
    }
    Err(LibraryError::Damaged { what: format!("case {index} has {found} of {speeds} results") })
}

pub(crate) fn features_of(row: &Row) -> Result<Features, LibraryError> {
    Ok(Features { log_power: row.doubles("log_power")?, band_levels_db: levels_of(row)? })
}

fn levels_of(row: &Row) -> Result<Vec<f64>, LibraryError> {
    LEVEL_COLUMNS.iter().map(|&column| row.get(column)).collect()
}

/// Binds what both databases keep of a report: campaign, worker, version, model, experiment and time.
fn of_report(insert: Statement, report: &Report) -> Statement {
    insert
        .bind(&report.campaign)
        .bind(&report.worker)
        .bind(&report.code_version)
        .bind(&report.model_hash)
        .bind(&report.experiment_hash)
        .bind(iso_utc(report.now_unix_ms))
}

/// The table that results are written to.
pub(crate) const fn table(dialect: Dialect) -> &'static str {
    match dialect {
        Dialect::Sqlite => "result",
        Dialect::Postgres => "case_result",
    }
}

/// Takes the results of cases away.
pub(crate) async fn discard(
    connection: &mut Connection,
    campaign: &str,
    indices: &[i64],
) -> Result<(), LibraryError> {
    let dialect = connection.dialect();
    let of = format!("campaign_id = $1 and sobol_index {}", dialect.listed("$2"));
    let series = format!(
        "delete from case_series where result_id in (select id from case_result where {of})"
    );
    let results = format!("delete from {} where {of}", table(dialect));
    let both = match dialect {
        Dialect::Sqlite => vec![results],
        Dialect::Postgres => vec![series, results],
    };
    for delete in both {
        connection.execute(sql(delete).bind(campaign).bind(indices.to_vec())).await?;
    }
    Ok(())
}

/// Stores the results of cases that have none, flagged where there is a reason to.
///
/// # Panics
/// When features have another shape than the first: whoever took the message in looked at that.
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
