//! Access to a coordinator: certificates, tokens, and the connections of a port.

mod certificates;
mod guard;
mod listener;
mod peer;
mod settings;

pub(crate) use certificates::random_token;
pub use certificates::{CertificatesError, issue};
pub use guard::Guard;
pub use listener::accept;
pub use peer::{Caller, Peer};
pub use settings::{Security, SecurityError};
