//! Do a pass's times, positions, rate and speed agree with one another?

use super::columns::Columns;
use super::error::{Fault, RecordingError};
use std::path::Path;

/// Relative difference allowed between the declared sample rate and that of `time_s`.
///
/// Clocks of recorders are off by parts in a hundred thousand; a wrong rate is off by much more.
const RATE_TOLERANCE: f64 = 1e-3;
/// Deviation of a single time step, in sample intervals, that rounded times may show.
const STEP_TOLERANCE: f64 = 0.5;
/// Relative difference allowed between nominal speed and mean speed of a pass.
///
/// A drive holds its speed within a few per cent; a file under the wrong speed is further off.
const SPEED_TOLERANCE: f64 = 0.1;
/// Metres per second in a kilometre per hour.
const KM_PER_H: f64 = 1.0 / 3.6;

/// The times advance evenly and at the declared rate (the field of `manifest`).
pub(super) fn times(
    manifest: &Path,
    path: &Path,
    columns: &Columns,
    declared: f64,
) -> Result<(), RecordingError> {
    let times = &columns.time_s;
    let duration = times[times.len() - 1] - times[0];
    let observed = (times.len() - 1) as f64 / duration;
    let even = uneven_step(times, duration / (times.len() - 1) as f64, 1.0 / declared);
    if let Some(fault) = even {
        return Err(RecordingError::new(path, "time_s", fault));
    }
    if (observed / declared - 1.0).abs() > RATE_TOLERANCE {
        let fault = Fault::WrongSampleRate { declared, observed, file: file_name(path) };
        return Err(RecordingError::new(manifest, "sample_rate_Hz", fault));
    }
    Ok(())
}

fn uneven_step(times: &[f64], mean: f64, declared: f64) -> Option<Fault> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let index = steps.len() / 2;
    // The median step is what a gap cannot move; the mean is what rounding cannot move.
    let median = *steps.clone().select_nth_unstable_by(index, f64::total_cmp).1;
    let expected = if (mean / median - 1.0).abs() < STEP_TOLERANCE { mean } else { median };
    let odd = |step: f64| !(step > 0.0 && (step - expected).abs() <= STEP_TOLERANCE * expected);
    let row = steps.iter().position(|&step| odd(step))?;
    // What the declared rate says, unless that is wrong too.
    let expected =
        if (declared / median - 1.0).abs() < STEP_TOLERANCE { declared } else { expected };
    Some(Fault::UnevenTime { row: row + 2, step: steps.swap_remove(row), expected })
}

/// The position does not decrease.
pub(super) fn positions(path: &Path, positions: &[f64]) -> Result<(), RecordingError> {
    let Some(index) = positions.windows(2).position(|pair| pair[1] < pair[0]) else {
        return Ok(());
    };
    let (before, after) = (positions[index], positions[index + 1]);
    let fault = Fault::RunsBack { row: index + 2, before, after };
    Err(RecordingError::new(path, "position_m", fault))
}

/// The declared speed (the `field` of `manifest`) is that of the positions.
pub(super) fn speed(
    manifest: &Path,
    field: &str,
    path: &Path,
    columns: &Columns,
    declared: f64,
) -> Result<(), RecordingError> {
    let span = |values: &[f64]| values[values.len() - 1] - values[0];
    let observed = span(&columns.position_m) / span(&columns.time_s) / KM_PER_H;
    if (observed / declared - 1.0).abs() <= SPEED_TOLERANCE {
        return Ok(());
    }
    let fault = Fault::WrongSpeed { declared, observed, file: file_name(path) };
    Err(RecordingError::new(manifest, field, fault))
}

/// The pass covers a sleeper's window.
pub(super) fn length(path: &Path, positions: &[f64], spacing_m: f64) -> Result<(), RecordingError> {
    let length_m = positions[positions.len() - 1] - positions[0];
    if length_m >= spacing_m {
        return Ok(());
    }
    Err(RecordingError::new(path, "position_m", Fault::TooShort { length_m, spacing_m }))
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into())
}
