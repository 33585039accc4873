//! Signals, their wavelet transforms and the features taken from them.
//!
//! Owns the checked signal, recordings in files, the continuous wavelet transform (CWT), the
//! synchrosqueezed one (SSWT), the local wavelet power spectrum (LWPS) and the features of a
//! sleeper's window. A simulated signal and a recorded one take the same road. Where a signal
//! comes from, and what its features say about the track, is left to others.

mod features;
pub mod recording;
pub mod samples;
mod signal;
mod squeeze;
mod transform;
mod wavelet;
mod welch;

pub use features::{
    DefinitionError, Extractor, FeatureDefinition, FeatureError, FeatureSet, Features,
    SAMPLES_A_PERIOD, ThirdOctave, TimeFrequencyMap,
};
pub use signal::{Signal, SignalError};
pub use squeeze::{Conventions, Normalisation, squeeze};
pub use transform::{Cwt, Padding, TimeFrequency};
pub use wavelet::Morlet;
pub use welch::{PowerSpectrum, WelchError};
