//! The table `result`: what came out of each case at each speed.

use crate::case::case_of;
use crate::report::{CaseReport, Report};
use crate::{Library, LibraryError};
use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};
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
        let mut rows = sqlx::query(
            "select * from result_with_parameters where campaign_id = ?
            order by sobol_index, speed_km_h",
        )
        .bind(campaign)
        .fetch(self.readers());
        let mut entry: Option<LibraryEntry> = None;
        while let Some(row) = rows.next().await {
            let row = row?;
            let index: u32 = row.try_get("sobol_index")?;
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

fn features_of(row: &SqliteRow) -> Result<Features, LibraryError> {
    let blob: &[u8] = row.try_get("log_power")?;
    let levels = LEVEL_COLUMNS.iter().map(|&column| row.try_get(column));
    Ok(Features { log_power: doubles(blob), band_levels_db: levels.collect::<Result<_, _>>()? })
}

/// Doubles in big-endian order, as bytes.
fn bytes(doubles: &[f64]) -> Vec<u8> {
    doubles.iter().flat_map(|value| value.to_be_bytes()).collect()
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    let (chunks, _) = bytes.as_chunks::<8>();
    chunks.iter().map(|chunk| f64::from_be_bytes(*chunk)).collect()
}

pub(crate) async fn insert_result(
    report: &Report,
    case: &CaseReport,
    speed_km_h: f64,
    features: &Features,
    connection: &mut SqliteConnection,
) -> Result<(), LibraryError> {
    let mut query = sqlx::query(
        "insert into result (campaign_id, sobol_index, speed_km_h, duration_s, worker,
            code_version, model_hash, experiment_hash, parameter_hash, finished_at, log_power,
            level_50_Hz_dB, level_63_Hz_dB, level_80_Hz_dB, level_100_Hz_dB, level_125_Hz_dB,
            level_160_Hz_dB, level_200_Hz_dB, level_250_Hz_dB, level_315_Hz_dB, level_400_Hz_dB,
            level_500_Hz_dB, level_630_Hz_dB, level_800_Hz_dB, level_1000_Hz_dB, level_1250_Hz_dB,
            level_1600_Hz_dB, level_2000_Hz_dB, level_2500_Hz_dB, level_3150_Hz_dB,
            level_4000_Hz_dB)
        values (?, ?, ?, ?, ?, ?, ?, ?, ?,
            strftime('%Y-%m-%dT%H:%M:%fZ', ? / 1000.0, 'unixepoch'), ?,
            ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(&report.campaign)
    .bind(case.index)
    .bind(speed_km_h)
    .bind(case.duration_s)
    .bind(&report.worker)
    .bind(&report.code_version)
    .bind(&report.model_hash)
    .bind(&report.experiment_hash)
    .bind(&case.parameter_hash)
    .bind(report.now_unix_ms)
    .bind(bytes(&features.log_power));
    assert_eq!(features.band_levels_db.len(), LEVEL_COLUMNS.len(), "checked where it came in");
    for &level in &features.band_levels_db {
        query = query.bind(level);
    }
    query.execute(connection).await?;
    Ok(())
}
