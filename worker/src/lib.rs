//! A worker: parameter set in, features out.
//!
//! Owns the network around a case ([`agent`]): leases, results, credentials. What is done with the case
//! is [`tracktwin_experiment`]'s; which cases there are, and what becomes of results, the coordinator's.

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

pub use bounded_listener::BoundedListener;
pub use counters::Counters;
pub use credentials::{Credentials, CredentialsError, Token};
pub use holdings::Holdings;
pub use logging::{LogFormat, log_to_stderr};
