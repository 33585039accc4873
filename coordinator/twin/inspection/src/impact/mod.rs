//! Short defects and waves of the rail's surface, detected from the passes alone.
//!
//! Owns impacts that repeat at a place (`squat`, the dip of a `rail_joint`) and `corrugation`.
//! Effects that repeat with the wheel belong to `wheel`.

mod corrugation;
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
