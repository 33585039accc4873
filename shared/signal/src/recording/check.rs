//! Checks that times, positions, sample rate and speed of a pass agree.

use super::clock::SampleClock;
use super::columns::Columns;
use super::copies;
use super::error::{Fault, RecordingError};
use std::path::Path;

/// Relative difference allowed between the declared sample rate and that of `time_s`.
///
/// The clocks of recorders have errors of some 1e-5. A wrong rate has a much larger error.
pub const RATE_TOLERANCE: f64 = 1e-3;
/// Relative difference of a declared step from the median one below which it is the one expected.
const STEP_TOLERANCE: f64 = 0.5;
/// Relative difference allowed between nominal speed and mean speed of a pass.
///
/// A drive holds its speed within a few per cent. A file with the wrong speed differs by more.
const SPEED_TOLERANCE: f64 = 0.1;
/// Metres per second in a kilometre per hour.
const KM_PER_H: f64 = 1.0 / 3.6;

/// Checks that the times advance evenly and at the declared rate (the field of `manifest`).
pub(super) fn times(
    manifest: &Path,
    path: &Path,
    columns: &Columns,
    declared: f64,
) -> Result<SampleClock, RecordingError> {
    let clock = SampleClock::of(&columns.time_s)
        .map_err(|fault| RecordingError::new(path, "time_s", known_rate(fault, declared)))?;
    let observed = clock.rate_hz;
    if (observed / declared - 1.0).abs() > RATE_TOLERANCE.max(clock.uncertainty) {
        let fault = Fault::WrongSampleRate { declared, observed, file: file_name(path) };
        return Err(RecordingError::new(manifest, "sample_rate_Hz", fault));
    }
    Ok(clock)
}

/// Computes the expected step from the declared rate, unless this rate is wrong too.
fn known_rate(fault: Fault, declared: f64) -> Fault {
    match fault {
        Fault::UnevenTime { row, step, expected, alternative }
            if (1.0 / declared / expected - 1.0).abs() < STEP_TOLERANCE =>
        {
            Fault::UnevenTime { row, step, expected: 1.0 / declared, alternative }
        }
        other => other,
    }
}

/// Index of each pass that is a copy of an earlier one, and the error that says so.
pub(super) fn copies<'a>(
    passes: impl Iterator<Item = (&'a Path, &'a [f64])>,
) -> Vec<(usize, RecordingError)> {
    let passes: Vec<(&Path, &[f64])> = passes.collect();
    let earlier = |index: usize| {
        let (path, samples) = passes[index];
        passes[..index].iter().find_map(|(other, earlier)| {
            let factor = copies::factor(earlier, samples)?;
            let fault = Fault::Copy { of: file_name(other), factor };
            Some((index, RecordingError::new(path, "acceleration", fault)))
        })
    };
    (0..passes.len()).filter_map(earlier).collect()
}

/// Checks that the declared speed (the `field` of `manifest`) agrees with the positions.
pub(super) fn speed(
    manifest: &Path,
    field: &str,
    path: &Path,
    position_m: &[f64],
    clock: SampleClock,
    declared: f64,
) -> Result<(), RecordingError> {
    let last = position_m.len() - 1;
    let observed = (position_m[last] - position_m[0]) / last as f64 * clock.rate_hz / KM_PER_H;
    if (observed / declared - 1.0).abs() <= SPEED_TOLERANCE {
        return Ok(());
    }
    let fault = Fault::WrongSpeed { declared, observed, file: file_name(path) };
    Err(RecordingError::new(manifest, field, fault))
}

/// Checks that the pass covers the window of a sleeper.
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
