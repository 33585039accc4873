//! From a library and a recording to results, stage by stage: what commands call.
//!
//! Owns the order of stages and the way between the library, which is asynchronous, and the crates
//! that compute. What a stage does is its crate's.

pub mod check;
pub mod compute;
pub mod confirm;
pub mod coverage;
pub mod diagnose;
pub mod evaluate;
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
