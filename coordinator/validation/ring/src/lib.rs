//! A replica of the test ring of the source paper (Shen et al. 2023), recorded by the reference
//! simulator, and a comparison of its evaluations with the statements of the paper.
//!
//! This crate contains the description of the ring ([`Ring`], [`Plan`]), its truth, the statements with
//! their tolerances, and the table of all sleepers. Other crates evaluate and diagnose the recording,
//! write files and make pages.

mod compared;
mod diagnosed;
mod error;
mod estimates;
mod methods;
mod parameters;
mod pictures;
mod plan;
mod repeated;
mod ring;
mod spectra;
mod statement;
mod structures;
mod study;
mod surface_statements;
mod table;
#[cfg(test)]
mod testing;

pub use diagnosed::Diagnoses;
pub use error::RingError;
pub use estimates::{Estimated, correlation};
pub use plan::{Plan, Stretch};
pub use ring::{Joint, Ring, SleeperTruth, Truth};
pub use spectra::RailSpectra;
pub use statement::Statement;
pub use study::{Method, Study};
