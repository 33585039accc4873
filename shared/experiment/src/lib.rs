//! Experiment and outcome of a case, common to coordinator and worker.
//!
//! Owns the [`Experiment`] (all that decides results but a case's parameters), the [`Simulation`] of
//! cases, their [`Outcome`], and [`MODEL_HASH`], by which two programs know that their physics agree.
//! Which cases there are is the coordinator's, how they travel the protocol's.

mod experiment;
mod outcome;
mod simulate;

pub use experiment::{Experiment, ExperimentError};
pub use outcome::{Outcome, PassFeatures};
pub use simulate::{Prepare, Simulate, Simulation, prepare_simulation};
pub use tracktwin_parameters::Case;

/// Version of the program, for people.
pub const CODE_VERSION: &str = env!("CARGO_PKG_VERSION");

/// Version of the physics: BLAKE3 of `golden.json`, the features of some cases.
///
/// A worker with another one is refused, and null simulations of another one are repeated. A test
/// simulates the cases; if it fails, it states how to write the file, and so the version, again.
pub const MODEL_HASH: &str = env!("TRACKTWIN_MODEL_HASH");
