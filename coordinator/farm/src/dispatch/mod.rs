//! Hands cases to workers and takes their results.
//!
//! This module contains the gRPC service and its decisions. The queue itself is in the library. The queue
//! therefore survives this process, and several coordinators can serve one library.

mod audits;
mod breaker;
mod campaigns;
mod counts;
mod lease_sizer;
mod library_faults;
mod messages;
mod policy;
mod roster;
mod service;
mod settings;

pub(crate) use library_faults::is_news;

pub use breaker::Breaker;
pub use campaigns::DispatchError;
pub use counts::Counts;
pub use lease_sizer::LeaseSizer;
pub use library_faults::{LastOutcome, LibraryFaults, WorkerCall};
pub use policy::{ATTEMPTS_MAX, FAILURES_MAX, LOSSES_MAX, SUSPECT_AFTER};
pub use service::Dispatch;
pub use settings::{Clock, Scope, Settings, Timing};
