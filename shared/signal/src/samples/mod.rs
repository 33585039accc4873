//! Samples of a stream: the samples of a pass in their order, while the pass is recorded.
//!
//! This module reads the two framings of samples: lines of CSV and binary records. Other crates evaluate
//! the samples.

mod error;
mod reader;

pub use error::SamplesError;
pub use reader::{Framing, Sample, SampleReader};
