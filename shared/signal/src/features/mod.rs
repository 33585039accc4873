//! Features of a sleeper's window: its LWPS and its levels in one-third octaves.
//!
//! This module defines and extracts the features. The caller selects the window of the sleeper and combines
//! several passes.

mod band;
mod definition;
mod extractor;
mod literal;
mod map;
mod plan;
mod reassignment;
mod set;
mod stretch;

pub use band::ThirdOctave;
pub use definition::{DefinitionError, FeatureDefinition};
pub use extractor::{Extractor, FeatureError, Features, SAMPLES_A_PERIOD};
pub use map::TimeFrequencyMap;
pub use set::FeatureSet;
