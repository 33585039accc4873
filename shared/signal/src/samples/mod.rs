//! Samples of a pass one after the other, while it is recorded.
//!
//! Owns the two framings in which samples come: lines of CSV and binary records. What the samples
//! say about the track is left to others.

mod error;
mod reader;

pub use error::SamplesError;
pub use reader::{Framing, Sample, SampleReader};
