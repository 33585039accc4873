//! Lines at frequencies of the mains that may be orders of the wheel.

use super::hum::{CELLS_APART, DRIFT_HZ, segments};
use tracktwin_signal::recording::Recording;

/// Whether a line in the segments of every pass may be an order of a wheel of this circumference in m, known with this
/// standard deviation.
pub(crate) fn may_be_order(
    recording: &Recording,
    frequency_hz: f64,
    (turn_m, deviation_m): (f64, f64),
) -> bool {
    recording.passes.iter().all(|pass| {
        let rate_hz = pass.signal.sample_rate_hz();
        let length = pass.position_m.len() / segments(pass.position_m.len(), rate_hz);
        pass.position_m.chunks_exact(length).any(|part| {
            let speed_m_s = (part[length - 1] - part[0]) / (length - 1) as f64 * rate_hz;
            let turning_hz = speed_m_s / turn_m;
            let order = frequency_hz / turning_hz;
            // A line within the drift of the mains counts as theirs.
            let width_hz = CELLS_APART * rate_hz / length as f64
                + DRIFT_HZ * frequency_hz / 50.0
                + 2.0 * deviation_m / turn_m * frequency_hz;
            order > 0.5 && (order - order.round()).abs() * turning_hz < width_hz
        })
    })
}
