//! `OpenTelemetry` traces of the farm: how leases become rows.
//!
//! Owns what a step of a trace is, how it is passed on between processes (W3C Trace Context) and
//! where steps are sent (OTLP). Without an exporter, steps cost nothing.

mod export;
mod step;

pub use export::{Export, ExportError};
pub use opentelemetry::Value;
pub use step::Step;
