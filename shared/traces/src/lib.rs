//! `OpenTelemetry` traces of the farm: from a lease to the rows of its results.
//!
//! This crate defines a step of a trace, its transfer between processes (W3C Trace Context) and its
//! export (OTLP). Without an exporter, steps have no cost.

mod export;
mod step;

pub use export::{Export, ExportError};
pub use opentelemetry::Value;
pub use step::Step;
