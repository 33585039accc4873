//! Sequences of computations that the commands use, from a library and a recording to results.
//!
//! This module defines the order of the stages, and connects the asynchronous library with the computing
//! crates. Each stage is implemented in its own crate.

pub mod check;
pub mod compute;
pub mod confirm;
pub mod coverage;
pub mod diagnose;
pub mod diagnose_sections;
pub mod evaluate;
mod fitted_sections;
pub mod invert;
pub mod lack;
pub mod models;
pub mod null_models;
pub mod provenance;
pub mod reproduce;
pub mod ring;
pub mod stream;
pub mod train;
pub mod trial;
