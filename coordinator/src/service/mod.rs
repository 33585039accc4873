//! The coordinator as a service on a port: who may talk to it, and how it starts and ends.
//!
//! Owns ports, certificates, tokens and the order of starting and stopping. What workers are
//! answered is [`dispatch`](crate::dispatch)'s.

mod certificates;
mod coordinator;
mod guard;
mod listener;
mod peer;
mod security;
mod serve;
mod watch;

pub(crate) use certificates::random_token;
pub use certificates::{CertificatesError, issue};
pub use coordinator::{Coordinator, CoordinatorError};
pub use guard::Guard;
pub use listener::accept;
pub use peer::{Caller, Peer};
pub use security::{Security, SecurityError};
pub use serve::{ServeError, serve};
