//! What a simulation costs, said before it is begun.

use super::track::SimulatedTrack;
use super::{Arguments, Drive, RUN_IN_SPANS};
use anyhow::anyhow;

/// Bytes that a time step takes until it is in the recording's file: acceleration, force, position
/// and surface as the solver has them, twice over while they are measured, and the file's columns.
const BYTES_A_STEP: f64 = 120.0;

/// Time steps of all passes together.
const STEPS_MAX: f64 = 2e7;

/// Refuses what no memory holds, with what would do.
pub(super) fn check(
    arguments: &Arguments,
    track: &SimulatedTrack,
    drives: &[Drive],
) -> Result<(), anyhow::Error> {
    let [from_m, to_m] = track.recorded_m();
    let length_m = to_m - from_m + RUN_IN_SPANS as f64 * track.design().sleeper.spacing_m;
    let seconds: f64 = drives.iter().map(|drive| 3.6 * length_m / drive.speed_km_h).sum();
    let steps = seconds / arguments.time_step;
    if steps <= STEPS_MAX {
        return Ok(());
    }
    Err(anyhow!(
        "{seconds:.3} s of passes in steps of {:e} s are {steps:.1e} samples and {:.1} GB; {STEPS_MAX:.0e} \
         are the most: give higher speeds, fewer passes or spans, or --time-step {:.1e}",
        arguments.time_step,
        1e-9 * BYTES_A_STEP * steps,
        seconds / STEPS_MAX
    ))
}
