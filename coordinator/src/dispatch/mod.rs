//! Hands cases to workers and takes their results.
//!
//! Owns the gRPC service and its decisions; the queue itself is the library's, so that nothing of
//! it is lost with this process.

mod batch;
mod policy;
mod service;

pub use batch::Pace;
pub use policy::{ATTEMPTS_MAX, after_attempt};
pub use service::{Dispatch, DispatchError, Timing};
