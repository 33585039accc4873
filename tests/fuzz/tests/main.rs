//! What comes from outside may be anything: it is read or refused, and nothing panics.
//!
//! Each test takes the kept inputs in `__fuzz__`, then some at random. `cargo bolero test NAME` goes on
//! for as long as it is let, guided by what the program does, and keeps what is new.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod campaigns;
mod messages;
mod questions;
mod recordings;
mod tracks;

/// Inputs at random in an ordinary run.
const ITERATIONS: usize = 200;
