//! Where simulation and recording differ, what physics was left out, and what including it gains.
//!
//! Owns baseline, null model, detection, names and their acceptance. Pure: recordings and null
//! simulations come in as values, a diagnosis goes out. The catalogue of physics is the track
//! model's; pages and files are left to others.

mod finding;

pub use finding::{Finding, Place};
