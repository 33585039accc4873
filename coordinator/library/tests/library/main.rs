//! Tests of the library on real files and databases.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod campaigns;
mod checksums;
mod data;
mod faults;
mod histories;
mod malformed;
mod model;
mod opening;
mod page;
mod plans;
mod provenance;
mod queue;
mod reading;
mod results;
mod schema;
mod snapshot;
mod support;
mod trials;
mod upgrade;
mod views;
mod workers;
