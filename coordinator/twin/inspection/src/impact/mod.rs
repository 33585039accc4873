//! Short defects and periodic waves of the rail surface, detected from the passes alone.
//!
//! This module detects impacts that repeat at one position (`squat`, the dip of a `rail_joint`) and
//! `corrugation`. The module `wheel` detects effects that repeat with the wheel.

mod coherent;
mod corrugation;
mod kink;
mod local;
mod repeated;
mod shape;

pub use corrugation::{Corrugation, corrugation};
pub use local::{Impact, impacts};
pub(crate) use repeated::{Cells, ImpactKind, cells};
pub use shape::{Form, Shape};
pub(crate) use shape::{Observed, fit};

#[cfg(test)]
mod tests;
