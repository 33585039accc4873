//! The library on real files.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod campaigns;
mod data;
mod faults;
mod histories;
mod opening;
mod page;
mod provenance;
mod queue;
mod results;
mod support;
mod trials;
mod upgrade;
mod workers;
