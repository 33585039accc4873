//! Effects that repeat with the wheel's revolutions, detected from the passes alone.
//!
//! Owns the flat and the orders of an out-of-round wheel, its circumference where that isn't known,
//! and how well a model of orders predicts withheld data. What repeats with the track is
//! `impact`'s.

mod block;
mod comb;
mod flat;
mod order_model;
mod out_of_round;

pub use block::CombBlock;
pub use comb::{CIRCUMFERENCES_M, Comb, comb};
pub use flat::{Flat, flat};
pub use order_model::HeldOut;
pub use out_of_round::{Order, out_of_round};

use std::f64::consts::TAU;
use tracktwin_signal::recording::Recording;

/// The wheel's circumference in m by its nominal radius, where the recording states one.
pub fn nominal_circumference_m(recording: &Recording) -> Option<f64> {
    let radius = recording.nominal_value("wheel", "radius_m")?;
    (radius.is_finite() && radius > 0.0).then_some(TAU * radius)
}

#[cfg(test)]
mod tests;
