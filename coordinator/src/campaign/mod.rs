//! What is to be simulated: a campaign's definition, and its cases.
//!
//! Owns the campaign file and the way from an index to a case. Pure; storing the cases is the
//! library's, running them the worker's.

mod design;
mod kinship;
mod spec;
mod training;

pub use design::{case, cases};
pub use kinship::Kinship;
pub use spec::{Campaign, DEFAULT, Definition, SpecError, Surfaces};
pub use training::Lack;
pub(crate) use training::TRAINED;
