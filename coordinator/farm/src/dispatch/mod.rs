//! Hands cases to workers and takes their results.
//!
//! Owns the gRPC service and its decisions; the queue itself is the library's, so that nothing of
//! it is lost with this process, and so that several coordinators may serve one library.

mod audits;
mod breaker;
mod campaigns;
mod counts;
mod lease_sizer;
mod messages;
mod policy;
mod roster;
mod service;
mod settings;

pub use breaker::Breaker;
pub use campaigns::DispatchError;
pub use counts::Counts;
pub use lease_sizer::LeaseSizer;
pub use policy::{ATTEMPTS_MAX, FAILURES_MAX, LOSSES_MAX, SUSPECT_AFTER};
pub use service::Dispatch;
pub use settings::{Clock, Scope, Settings, Timing};
