//! A worker: parameter set in, features out.
//!
//! Owns the way of one case ([`Simulation`], pure) and the network around it ([`agent`]). Which
//! cases there are, and what becomes of results, is the coordinator's.

pub mod agent;
mod backoff;
pub mod command;
mod connection;
mod coordinators;
mod core;
mod counters;
mod credentials;
mod experiment;
mod health;
mod holdings;
mod logging;
mod outbox;
mod port;
mod session;
mod simulate;

pub use counters::Counters;
pub use credentials::{Credentials, CredentialsError, Token};
pub use experiment::{Experiment, ExperimentError};
pub use holdings::Holdings;
pub use logging::{LogFormat, log_to_stderr};
pub use port::Port;
pub use simulate::{Prepare, Simulate, Simulation, prepare_simulation};
pub use tracktwin_parameters::Case;
pub use tracktwin_protocol::{Outcome, PassFeatures};

/// Version of the program, for people.
pub const CODE_VERSION: &str = env!("CARGO_PKG_VERSION");

/// Hash of everything that decides what a parameter set becomes: sources and dependencies.
pub const MODEL_HASH: &str = env!("TRACKTWIN_MODEL_HASH");
