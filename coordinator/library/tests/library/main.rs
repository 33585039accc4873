//! The library on real files.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod histories;
mod opening;
mod queue;
mod results;
mod support;
