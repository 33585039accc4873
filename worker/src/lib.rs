//! A worker of the farm: simulates leased cases and reports their features.
//!
//! This crate contains the network side of a worker ([`agent`]): leases, results, credentials. The crate
//! [`tracktwin_experiment`] simulates the cases. The coordinator selects the cases and stores the
//! results.

pub mod agent;
mod backoff;
mod bounded_listener;
pub mod command;
mod config;
mod connection;
mod coordinators;
mod core;
mod counters;
mod credentials;
mod error;
mod finished;
mod health;
mod holdings;
mod logging;
mod outbox;
mod session;
mod slot;

pub use bounded_listener::serve_bounded;
pub use counters::Counters;
pub use credentials::{Credentials, CredentialsError, Token};
pub use holdings::Holdings;
pub use logging::{LogFormat, log_to_stderr};
