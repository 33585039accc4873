//! Conversion of tables to a recording.

use super::super::error::{Fault, RecordingError};
use super::super::motion::MotionFault;
use super::super::{Pass, Recording, check, quiet};
use super::raw::Raw;
use super::{AccelerationUnit, Layout, Table, sleepers, speeds};
use serde_json::{Map, json};
use std::path::{Path, PathBuf};

/// Relative difference up to which two sample rates are one: clocks of recorders and stamps have errors of some 1e-5, and over
/// 500 m a ten thousandth is 5 cm.
const SAME_RATE: f64 = 1e-4;

/// A recording from imported files, with the changes and assumptions of the import.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Column of the accelerations.
    pub column: String,
    /// The recording.
    pub recording: Recording,
    /// Changes, assumptions and doubts, one sentence each.
    pub notes: Vec<String>,
}

/// Imports `files`: one recording per column of acceleration, each with one pass per file.
///
/// # Errors
/// The first error, with file, column and row. For an incomplete layout, the error names the missing
/// entry.
pub fn import(files: &[PathBuf], layout: &Layout) -> Result<Vec<Imported>, RecordingError> {
    let tables: Vec<Table> =
        files.iter().map(|file| Table::read(file)).collect::<Result<_, _>>()?;
    let first = files.first().map_or(Path::new("files"), PathBuf::as_path);
    if layout.acceleration.is_empty() {
        let names = tables.first().map(names).unwrap_or_default();
        let remedy = format!(
            "state it with `--column acceleration=NAME` (the columns of the file are {names})"
        );
        return Err(RecordingError::new(first, "acceleration", Fault::NoField { remedy }));
    }
    layout.check().map_err(|error| {
        RecordingError::new(first, error.entry, Fault::OutOfRange(error.source))
    })?;
    layout.acceleration.iter().map(|column| recording(&tables, column, layout)).collect()
}

fn names(table: &Table) -> String {
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    names.join(", ")
}

fn recording(tables: &[Table], column: &str, layout: &Layout) -> Result<Imported, RecordingError> {
    let mut notes: Vec<String> = Vec::new();
    let mut corrections: Vec<String> = Vec::new();
    let raw: Vec<Raw> = tables
        .iter()
        .map(|table| Raw::of(table, column, layout, &mut notes))
        .collect::<Result<_, _>>()?;
    alike(&raw)?;
    let is_backwards = is_backwards(&raw)?;
    if is_backwards {
        corrections.push(
            "the positions decrease along the pass: the recording stores them, and the \
             positions of the sleepers, with the opposite sign"
                .to_owned(),
        );
    }
    let is_gain_known = raw.iter().all(|raw| raw.unit != AccelerationUnit::Unknown);
    let rate = raw.first().map_or(0.0, |raw| raw.rate_hz);
    let first = raw.first().map_or_else(|| PathBuf::from("files"), |raw| raw.path.clone());
    let mut passes: Vec<Pass> = raw
        .into_iter()
        .map(|raw| raw.into_pass(column, is_backwards, layout, (&mut notes, &mut corrections)))
        .collect::<Result<_, _>>()?;
    speeds::assign(&mut passes, layout.speed_km_h, &mut corrections);
    let sleepers = sleepers::along(&passes, layout, is_backwards).map_err(|fault| {
        let entry = if matches!(fault, Fault::OutOfRange(_)) { "spacing_m" } else { "sleeper_m" };
        RecordingError::new(&first, entry, fault)
    })?;
    corrections.extend(layout.assumed());
    if sleepers.is_empty() {
        notes.push("no sleeper position is known: the recording has no sleepers".to_owned());
    }
    notes.extend(corrections.iter().cloned());
    let is_doubt = |note: &String| note.starts_with("doubt: ");
    let doubts = corrections.into_iter().chain(notes.iter().filter(|note| is_doubt(note)).cloned());
    let doubts: Vec<String> = doubts.collect();
    // Found again when the recording is read.
    notes.extend(passes.iter().filter_map(|pass| quiet::doubt(pass, is_gain_known)));
    // Doubts last, where they are seen.
    notes.sort_by_key(is_doubt);
    let recording = Recording {
        name: column.to_owned(),
        sample_rate_hz: rate,
        channel: channel(column, layout),
        passes,
        sleepers,
        nominal: nominal(layout, is_gain_known),
        spacing_m: layout.spacing_m(),
        doubts,
    };
    Ok(Imported { column: column.to_owned(), recording, notes })
}

fn channel(column: &str, layout: &Layout) -> String {
    let sign = if layout.upwards { ", sign changed from upwards" } else { "" };
    format!("vertical axle-box acceleration, positive downwards (column {column}{sign})")
}

/// All files have one sample rate, and no file is a copy of another.
fn alike(raw: &[Raw]) -> Result<(), RecordingError> {
    for other in raw.iter().skip(1) {
        let (first, rate) = (raw[0].rate_hz, other.rate_hz);
        if (rate / first - 1.0).abs() > SAME_RATE {
            let file = raw[0].path.display().to_string();
            let fault = Fault::OtherSampleRate { rate, first, file };
            return Err(RecordingError::new(&other.path, "sample_rate_Hz", fault));
        }
    }
    let samples = raw.iter().map(|raw| (raw.path.as_path(), raw.samples.as_slice()));
    check::copies(samples).into_iter().next().map_or(Ok(()), |(_, copy)| Err(copy))
}

/// Whether all files run towards smaller positions.
fn is_backwards(raw: &[Raw]) -> Result<bool, RecordingError> {
    let first = raw.first().is_some_and(Raw::is_backwards);
    match raw.iter().find(|other| other.is_backwards() != first) {
        Some(other) => {
            let fault = MotionFault::Directions.into();
            Err(RecordingError::new(&other.path, other.places.name, fault))
        }
        None => Ok(first),
    }
}

fn nominal(layout: &Layout, is_gain_known: bool) -> Map<String, serde_json::Value> {
    let mut nominal = Map::new();
    nominal.insert("sleeper".to_owned(), json!({"spacing_m": layout.spacing_m()}));
    if let Some(radius) = layout.wheel_radius_m {
        nominal.insert("wheel".to_owned(), json!({"radius_m": radius}));
    }
    nominal.insert("gain_known".to_owned(), json!(is_gain_known));
    nominal
}
