//! Features of a sleeper's window: its LWPS and its levels in one-third octaves.
//!
//! Owns the definition of the features and their extraction; the sleeper's window, and what
//! becomes of several passes, is the caller's.

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
