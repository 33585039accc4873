//! Any input from outside is read or refused; no input causes a panic.
//!
//! Each test runs the stored inputs in `__fuzz__`, then random ones. `cargo bolero test NAME` runs until it
//! is stopped; it uses coverage as a guide and stores new inputs.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod campaigns;
mod messages;
mod questions;
mod recordings;
mod tracks;

/// Number of random inputs in an ordinary run.
const ITERATIONS: usize = 200;
