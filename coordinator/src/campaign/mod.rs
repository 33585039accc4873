//! What is to be simulated: a campaign's definition, and its cases.
//!
//! Owns the campaign file and the way from an index to a case. Pure; storing the cases is the
//! library's, running them the worker's.

mod design;
mod spec;

pub use design::{case, cases};
pub use spec::{Campaign, DEFAULT, Definition, SpecError, Surfaces};
