//! The farm: campaigns, and the coordinator that hands their cases to workers.
//!
//! - [`campaign`]: what is simulated; from an index to a case.
//! - [`dispatch`]: which worker gets which case, and what becomes of its report.
//! - [`security`]: certificates, tokens, connections that are let in.
//! - [`serve`]: the gRPC service on a port.
//! - [`dashboard`]: pages and metrics for people and Prometheus.
//! - [`coordinator`]: starts and ends service and dashboard.
//! - [`embedded`]: coordinator and workers in one process.
//!
//! The queue and the results are the library's; no state of this crate outlives the process.

pub mod campaign;
pub mod coordinator;
pub mod dashboard;
pub mod dispatch;
pub mod embedded;
pub mod security;
mod serve;

pub use serve::{ServeError, serve};
