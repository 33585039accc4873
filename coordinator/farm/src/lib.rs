//! The farm: campaigns, and the coordinator that leases their cases to workers.
//!
//! - [`campaign`]: definition of a campaign, and the case that belongs to an index.
//! - [`dispatch`]: leases cases to workers and evaluates their reports.
//! - [`security`]: certificates, tokens, accepted connections.
//! - [`serve`]: the gRPC service on a port.
//! - [`dashboard`]: pages and metrics for people and Prometheus.
//! - [`coordinator`]: starts and ends service and dashboard.
//! - [`embedded`]: coordinator and workers in one process.
//!
//! The library stores the queue and the results. Nothing that must survive the process is kept in this
//! crate.

pub mod campaign;
pub mod coordinator;
pub mod dashboard;
pub mod dispatch;
pub mod embedded;
pub mod security;
mod serve;

pub use serve::{ServeError, serve};
