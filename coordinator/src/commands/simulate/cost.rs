//! Size of a simulation, checked before it starts.

use super::track::SimulatedTrack;
use super::{Arguments, Drive, RUN_IN_SPANS};
use anyhow::anyhow;

/// Memory per time step in bytes. It contains acceleration, force, position and surface of the solver, a
/// second copy during measurement, and the columns of the recording's file.
const BYTES_A_STEP: f64 = 120.0;

/// Maximum number of time steps of all passes together.
const STEPS_MAX: f64 = 2e7;

/// Returns an error, with a remedy, for a simulation that exceeds the memory.
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
        "{seconds:.3} s of passes in steps of {:e} s give {steps:.1e} samples and {:.1} GB; the limit is \
         {STEPS_MAX:.0e} samples: use higher speeds, fewer passes or spans, or --time-step {:.1e}",
        arguments.time_step,
        1e-9 * BYTES_A_STEP * steps,
        seconds / STEPS_MAX
    ))
}
