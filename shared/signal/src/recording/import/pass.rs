//! From tables to a recording.

use super::super::error::{Fault, RecordingError};
use super::super::{Pass, Recording, Sleeper};
use super::{AccelerationUnit, Layout, Table};
use crate::Signal;
use serde_json::{Map, json};
use std::path::{Path, PathBuf};
use tracktwin_parameters::QuantityError;
use tracktwin_parameters::quantity::SLEEPERS;

/// Relative difference of time steps from their mean above which a file was not sampled evenly.
const UNEVEN: f64 = 0.5;
/// Speed in km/h that no pass exceeds; the fastest train ran 575 km/h once.
const SPEED_MAX_KM_H: f64 = 500.0;

/// A recording made of foreign files, and what was done or assumed on the way.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The column its accelerations come from.
    pub column: String,
    /// The recording.
    pub recording: Recording,
    /// What was changed or assumed, a sentence each.
    pub notes: Vec<String>,
}

/// One recording for each column of acceleration, with a pass for each file.
///
/// # Errors
/// The first thing that is wrong, with file, column and row; a layout that doesn't suffice says
/// which entry is missing.
pub fn import(files: &[PathBuf], layout: &Layout) -> Result<Vec<Imported>, RecordingError> {
    let tables: Vec<Table> =
        files.iter().map(|file| Table::read(file)).collect::<Result<_, _>>()?;
    let first = files.first().map_or(Path::new("files"), PathBuf::as_path);
    let missing = |field: &str, expected: &str| {
        let fault = Fault::NoField { expected: expected.to_owned() };
        RecordingError::new(first, field, fault)
    };
    if layout.acceleration.is_empty() {
        let names = tables.first().map(names).unwrap_or_default();
        let expected = format!("the column of acceleration (the file has {names})");
        return Err(missing("acceleration", &expected));
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
    let first = tables.first().map_or(Path::new("files"), |table| table.path.as_path());
    let mut passes: Vec<Pass> = Vec::with_capacity(tables.len());
    let mut notes = Vec::new();
    for table in tables {
        let pass = pass(table, column, layout, &mut notes)?;
        let (observed, declared) = (
            pass.signal.sample_rate_hz(),
            passes.first().map_or(pass.signal.sample_rate_hz(), |p| p.signal.sample_rate_hz()),
        );
        if (observed / declared - 1.0).abs() > 1e-6 {
            let file = table.path.display().to_string();
            let fault = Fault::WrongSampleRate { declared, observed, file };
            return Err(RecordingError::new(&table.path, "sample_rate_Hz", fault));
        }
        passes.push(pass);
    }
    let rate = passes.first().map_or(0.0, |pass| pass.signal.sample_rate_hz());
    let sleepers = sleepers(&passes, layout)
        .map_err(|error| RecordingError::new(first, "spacing_m", Fault::OutOfRange(error)))?;
    if sleepers.is_empty() {
        notes.push("no place of a sleeper is known: the recording has none".to_owned());
    }
    let sign = if layout.upwards { ", turned from upwards" } else { "" };
    let recording = Recording {
        name: column.to_owned(),
        sample_rate_hz: rate,
        channel: format!(
            "vertical axle-box acceleration, positive downwards (column {column}{sign})"
        ),
        passes,
        sleepers,
        nominal: nominal(layout),
        spacing_m: layout.spacing_m,
    };
    Ok(Imported { column: column.to_owned(), recording, notes })
}

fn nominal(layout: &Layout) -> Map<String, serde_json::Value> {
    let mut nominal = Map::new();
    nominal.insert("sleeper".to_owned(), json!({"spacing_m": layout.spacing_m}));
    if let Some(radius) = layout.wheel_radius_m {
        nominal.insert("wheel".to_owned(), json!({"radius_m": radius}));
    }
    let known = layout.acceleration_unit != AccelerationUnit::Unknown;
    nominal.insert("gain_known".to_owned(), json!(known));
    nominal
}

/// Sleepers at even distances from the one whose place is known, over all passes.
fn sleepers(passes: &[Pass], layout: &Layout) -> Result<Vec<Sleeper>, QuantityError> {
    let Some(known) = layout.sleeper_m else { return Ok(Vec::new()) };
    let firsts = passes.iter().map(|pass| pass.position_m[0]);
    let lasts = passes.iter().map(|pass| pass.position_m[pass.position_m.len() - 1]);
    let number = |x: f64| (x - known) / layout.spacing_m;
    let from = number(firsts.fold(f64::INFINITY, f64::min)).ceil() as i64;
    let to = number(lasts.fold(f64::NEG_INFINITY, f64::max)).floor() as i64;
    // No more than may be.
    SLEEPERS.check((to - from + 1).max(0) as f64)?;
    let sleeper = |(index, number): (usize, i64)| Sleeper {
        id: format!("SN{}", index + 1),
        x_m: known + number as f64 * layout.spacing_m,
    };
    Ok((from..=to).enumerate().map(sleeper).collect())
}

fn pass(
    table: &Table,
    column: &str,
    layout: &Layout,
    notes: &mut Vec<String>,
) -> Result<Pass, RecordingError> {
    let values = table.column(column)?;
    let rate = sample_rate(table, layout)?;
    let position_m = positions(table, layout, values.len(), rate)?;
    if position_m.len() != values.len() {
        let fault = Fault::LengthMismatch { rows: position_m.len(), others: values.len() };
        return Err(RecordingError::new(&table.path, "position", fault));
    }
    let seconds = (values.len() - 1) as f64 / rate;
    let speed_km_h = 3.6 * (position_m[values.len() - 1] - position_m[0]) / seconds;
    if !(speed_km_h > 0.0 && speed_km_h <= SPEED_MAX_KM_H) {
        let fault = Fault::Impossible { observed: speed_km_h };
        return Err(RecordingError::new(&table.path, "positions", fault));
    }
    let unit = layout.acceleration_unit.in_si() * if layout.upwards { -1.0 } else { 1.0 };
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    // Gravity and the amplifier's offset; nothing of the track is that slow.
    let samples = values.iter().map(|value| unit * (value - mean)).collect();
    let file = table.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    notes.push(format!(
        "{file}: {column}: {} samples at {rate} Hz, {speed_km_h:.2} km/h; a constant offset of {mean:.4} was taken out",
        values.len()
    ));
    let signal = Signal::new(rate, samples).map_err(|error| {
        let fault = Fault::Unreadable { reason: error.to_string() };
        RecordingError::new(&table.path, column, fault)
    })?;
    Ok(Pass { file, speed_km_h, signal, position_m, contact_loss_share: None })
}

/// The stated sample rate, or that of the column of times, in Hz.
fn sample_rate(table: &Table, layout: &Layout) -> Result<f64, RecordingError> {
    if let Some(rate) = layout.sample_rate_hz {
        return Ok(rate);
    }
    let Some(name) = &layout.time else {
        let fault = Fault::NoField { expected: "it, or the column of times".to_owned() };
        return Err(RecordingError::new(&table.path, "sample_rate_Hz", fault));
    };
    let times = table.column(name)?;
    let unit = layout.time_unit.in_si();
    let mean = unit * (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let odd = |pair: &[f64]| ((pair[1] - pair[0]) * unit / mean - 1.0).abs() > UNEVEN;
    if let Some(row) = times.windows(2).position(odd) {
        let step = unit * (times[row + 1] - times[row]);
        let fault = Fault::UnevenTime { row: row + 2, step, expected: mean };
        return Err(RecordingError::new(&table.path, name.as_str(), fault));
    }
    // Times are written with few digits: a rate that is whole within a millionth is whole.
    let rate = 1.0 / mean;
    Ok(if (rate / rate.round() - 1.0).abs() < 1e-6 { rate.round() } else { rate })
}

/// Places of the wheel in m, from the first of position, column of speed, constant speed.
fn positions(
    table: &Table,
    layout: &Layout,
    count: usize,
    rate: f64,
) -> Result<Vec<f64>, RecordingError> {
    if let Some(name) = &layout.position {
        let unit = layout.position_unit.in_si();
        return Ok(table.column(name)?.iter().map(|value| unit * value).collect());
    }
    if let Some(name) = &layout.speed {
        let unit = layout.speed_unit.in_si() / rate;
        let mut place = 0.0;
        let advance = |speed: &f64| {
            let here = place;
            place += unit * speed;
            here
        };
        return Ok(table.column(name)?.iter().map(advance).collect());
    }
    let Some(speed) = layout.speed_km_h else {
        let expected = "a speed in km/h, or a column of positions or speeds".to_owned();
        let fault = Fault::NoField { expected };
        return Err(RecordingError::new(&table.path, "speed_km_h", fault));
    };
    Ok((0..count).map(|index| index as f64 * speed / 3.6 / rate).collect())
}
