//! Effects that repeat with the revolutions of the wheel, detected from the passes alone.
//!
//! This module detects a flat and the orders of an out-of-round wheel, estimates an unknown circumference,
//! and tests how well a model of orders predicts withheld data. The module `impact` detects effects that
//! repeat with the track.

mod block;
mod comb;
mod flat;
mod order_model;
mod out_of_round;

pub use block::CombBlock;
pub use comb::{CIRCUMFERENCES_M, Comb, comb};
pub(crate) use flat::TOLERANCE;
pub use flat::{Flat, flat};
pub use order_model::HeldOut;
pub use out_of_round::{Order, out_of_round};

use std::f64::consts::TAU;
use tracktwin_signal::recording::Recording;

/// The circumference of the wheel in m from its nominal radius; `None` if the recording states no valid
/// radius.
pub fn nominal_circumference_m(recording: &Recording) -> Option<f64> {
    let radius = recording.nominal_value("wheel", "radius_m")?;
    (radius.is_finite() && radius > 0.0).then_some(TAU * radius)
}

#[cfg(test)]
mod tests;
