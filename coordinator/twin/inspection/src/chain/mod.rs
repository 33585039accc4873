//! Faults of sensor, recorder, clock and odometer, as distinct from physics of the track.
//!
//! This module detects `clipping`, `electrical_hum`, `gain_error`, `position_error` and unusable passes. It
//! also estimates noise, gain and offset of each pass for the track model. A resonance of the sensor
//! mounting requires the track model and is tested in the diagnosis.

mod axle;
mod clipping;
mod contact;
mod gain;
mod hum;
mod hum_or_order;
mod offset;
mod pass_defect;
mod plateau;
mod scale;
mod speed_coherence;
mod standstill;
mod usable;

pub use axle::with_equal_axles;
pub use clipping::{Clipping, clipping};
pub(crate) use contact::expected_m_s2;
pub use contact::{LossOfContact, PassLoss, loss_of_contact};
pub(crate) use gain::of_other_gain;
pub use gain::{Gain, LevelDifference, gains};
pub(crate) use hum::mains_hz;
pub use hum::{Hum, hum, without_hum};
pub(crate) use hum_or_order::may_be_order;
pub(crate) use offset::misplaced;
pub use offset::{Offset, Offsets, offsets};
pub use pass_defect::{PassDefect, pass_defects};
pub use scale::{Scale, scale};
pub use usable::usable;

use crate::along::Background;
use tracktwin_signal::recording::Recording;

/// Power spectral density of the noise floor of every pass in (m/s2)2/Hz: median of the upper half of its
/// spectrum.
///
/// `None` for a pass that is too short or constant.
pub fn noise_floors(recording: &Recording) -> Vec<Option<f64>> {
    let floor = |pass: &tracktwin_signal::recording::Pass| {
        Background::of(&pass.signal).map(|background| background.floor())
    };
    recording.passes.iter().map(floor).collect()
}

#[cfg(test)]
mod contact_tests;
#[cfg(test)]
mod hum_tests;
#[cfg(test)]
mod tests;
