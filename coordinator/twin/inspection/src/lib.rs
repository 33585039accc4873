//! Inspection: tests of the passes of a recording that need no fitted track model.
//!
//! This crate detects impacts, periodic waves, defects of the wheel and faults of the measuring chain, and
//! combines the tests into one inspection. The functions are pure: they take a recording and return
//! findings. Only the sizes of defects use a track, the stated one. The crate `tracktwin-diagnosis` contains
//! all tests that need a fitted track model.

mod along;
pub mod chain;
mod finding;
pub mod impact;
mod inspect;
pub mod wheel;

pub use along::{SPEED_RATIO, median, separate_wavelengths};
pub use finding::{Finding, Place};
pub use inspect::{FALSE_ALARMS, Inspection, inspect};
