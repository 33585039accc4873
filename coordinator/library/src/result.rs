//! The table `result`: what came out of each case at each speed.

use crate::case::case_of;
use crate::engine::{Connection, Dialect, Row, Value, iso_utc, sql};
use crate::report::{CaseReport, Report};
use crate::{Library, LibraryError};
use std::fmt::Write as _;
use tokio_stream::StreamExt;
use tracktwin_parameters::Case;
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
    /// [`LibraryError`] when the library cannot be read or a case lacks a speed.
    pub async fn training_set(
        &self,
        campaign: &str,
        mut take: impl FnMut(LibraryEntry),
    ) -> Result<(), LibraryError> {
        let speeds = self.campaign(campaign).await?.speeds_km_h.len();
        let ask = "select * from result_with_parameters where campaign_id = $1
            order by sobol_index, speed_km_h";
        let mut rows = self.readers().stream(sql(ask).bind(campaign));
        let mut entry: Option<LibraryEntry> = None;
        while let Some(row) = rows.next().await {
            let row = row?;
            let index = row.get_u32("sobol_index")?;
            match &mut entry {
                Some(entry) if entry.case.index == index => entry.features.push(features_of(&row)?),
                _ => {
                    let next =
                        LibraryEntry { case: case_of(&row)?, features: vec![features_of(&row)?] };
                    if let Some(done) = entry.replace(next) {
                        take(complete(done, speeds)?);
                    }
                }
            }
        }
        if let Some(done) = entry {
            take(complete(done, speeds)?);
        }
        Ok(())
    }
}

fn complete(entry: LibraryEntry, speeds: usize) -> Result<LibraryEntry, LibraryError> {
    if entry.features.len() == speeds {
        return Ok(entry);
    }
    let (index, found) = (entry.case.index, entry.features.len());
    Err(LibraryError::Damaged { what: format!("case {index} has {found} of {speeds} results") })
}

pub(crate) fn features_of(row: &Row) -> Result<Features, LibraryError> {
    let levels = LEVEL_COLUMNS.iter().map(|&column| row.get(column));
    let band_levels_db = levels.collect::<Result<_, _>>()?;
    Ok(Features { log_power: row.doubles("log_power")?, band_levels_db })
}

/// Stores the results of cases that have none.
pub(crate) async fn insert_results(
    connection: &mut Connection,
    report: &Report,
    finished: &[(&CaseReport, &[Features])],
) -> Result<(), LibraryError> {
    match connection.dialect() {
        Dialect::Sqlite => insert_in_groups(connection, report, finished).await,
        Dialect::Postgres => insert_at_once(connection, report, finished).await,
    }
}

/// The passes of cases, each with its speed.
fn passes<'a>(
    report: &'a Report,
    finished: &'a [(&'a CaseReport, &'a [Features])],
) -> impl Iterator<Item = (&'a CaseReport, f64, &'a Features)> {
    finished.iter().flat_map(|&(case, features)| {
        assert_eq!(features.len(), report.speeds_km_h.len(), "checked where the message came in");
        let speeds = report.speeds_km_h.iter().copied();
        speeds.zip(features).map(move |(speed_km_h, features)| {
            let levels = features.band_levels_db.len();
            assert_eq!(levels, LEVEL_COLUMNS.len(), "checked where the message came in");
            (case, speed_km_h, features)
        })
    })
}

/// The columns that are one for a whole report, and then those that are not.
const INSERT: &str = "insert into result (campaign_id, worker, code_version, model_hash,
    experiment_hash, finished_at, sobol_index, speed_km_h, duration_s, parameter_hash, log_power";

/// Rows in one statement at most: 64 rows of 31 values stay well below the 32,766 that `SQLite` takes.
const ROWS_MAX: usize = 64;

/// Statements of as many rows as a power of two, so that there are few to prepare: each costs a turn
/// of the thread that speaks to the file.
async fn insert_in_groups(
    connection: &mut Connection,
    report: &Report,
    finished: &[(&CaseReport, &[Features])],
) -> Result<(), LibraryError> {
    let passes: Vec<_> = passes(report, finished).collect();
    let finished_at = iso_utc(report.now_unix_ms);
    let mut rest = &passes[..];
    while !rest.is_empty() {
        let largest = 1 << rest.len().ilog2();
        let (rows, after) = rest.split_at(ROWS_MAX.min(largest));
        let places = Dialect::Sqlite.rows_of_values(rows.len(), 11 + LEVEL_COLUMNS.len());
        let mut insert = sql(format!("{INSERT}, {}) values {places}", LEVEL_COLUMNS.join(", ")));
        for (case, speed_km_h, features) in rows {
            insert = insert
                .bind(&report.campaign)
                .bind(&report.worker)
                .bind(&report.code_version)
                .bind(&report.model_hash)
                .bind(&report.experiment_hash)
                .bind(&finished_at)
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

/// Over a network, one statement for all: features of all rows travel as one series and their levels as
/// one array, of which every row takes its stretch.
async fn insert_at_once(
    connection: &mut Connection,
    report: &Report,
    finished: &[(&CaseReport, &[Features])],
) -> Result<(), LibraryError> {
    let mut rows = Columns::default();
    for (case, speed_km_h, features) in passes(report, finished) {
        rows.push(case, speed_km_h, features);
    }
    let mut insert = format!("{INSERT}, {}) ", LEVEL_COLUMNS.join(", "));
    insert.push_str(
        "select $1, $2, $3, $4, $5, $6, sobol_index, speed_km_h, duration_s, parameter_hash,
            substring($12 from cast(first_byte as integer) for cast(bytes as integer))",
    );
    for level in 1..=LEVEL_COLUMNS.len() {
        let _ = write!(insert, ", ($13)[{} * (place - 1) + {level}]", LEVEL_COLUMNS.len());
    }
    insert.push_str(
        " from unnest($7, $8, $9, $10, $11, $14) with ordinality
            as of (sobol_index, speed_km_h, duration_s, parameter_hash, first_byte, bytes, place)",
    );
    let insert = sql(insert)
        .bind(&report.campaign)
        .bind(&report.worker)
        .bind(&report.code_version)
        .bind(&report.model_hash)
        .bind(&report.experiment_hash)
        .bind(iso_utc(report.now_unix_ms))
        .bind(rows.index)
        .bind(Value::Reals(rows.speed_km_h))
        .bind(Value::Reals(rows.duration_s))
        .bind(Value::Texts(rows.parameter_hash))
        .bind(rows.first_byte)
        .bind(&rows.log_power[..])
        .bind(Value::Reals(rows.level_db))
        .bind(rows.bytes);
    connection.execute(insert).await.map(drop)
}

/// Results as columns.
#[derive(Default)]
struct Columns {
    index: Vec<i64>,
    speed_km_h: Vec<f64>,
    duration_s: Vec<f64>,
    parameter_hash: Vec<String>,
    /// Where in the bytes of `log_power` a row's features begin, counted from 1, and how many they are.
    first_byte: Vec<i64>,
    bytes: Vec<i64>,
    log_power: Vec<f64>,
    level_db: Vec<f64>,
}

impl Columns {
    fn push(&mut self, case: &CaseReport, speed_km_h: f64, features: &Features) {
        self.index.push(case.index.into());
        self.speed_km_h.push(speed_km_h);
        self.duration_s.push(case.duration_s);
        self.parameter_hash.push(case.parameter_hash.clone());
        self.first_byte.push(bytes_of(&self.log_power) + 1);
        self.bytes.push(bytes_of(&features.log_power));
        self.log_power.extend_from_slice(&features.log_power);
        self.level_db.extend_from_slice(&features.band_levels_db);
    }
}

fn bytes_of(series: &[f64]) -> i64 {
    i64::try_from(size_of_val(series)).expect("memory holds fewer")
}
