//! Tests of a recording's passes without a track model.
//!
//! Owns impacts, waves and the wheel's turns, faults of the measuring chain, and the first look that
//! puts them together. Pure: a recording goes in, findings come out. What a model of the track explains
//! is the diagnosis's.

mod along;
pub mod chain;
mod finding;
pub mod impact;
mod inspect;
pub mod wheel;

pub use along::{median, separates_wavelengths};
pub use finding::{Finding, Place};
pub use inspect::{FALSE_ALARMS, Inspection, inspect};
