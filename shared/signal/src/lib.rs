//! Signals, their wavelet transforms and the features taken from them.
//!
//! This crate contains the checked signal, recordings in files, the continuous wavelet transform (CWT), the
//! synchrosqueezed wavelet transform (SSWT), the local wavelet power spectrum (LWPS) and the features of a
//! sleeper's window. It processes simulated and recorded signals in the same way. Other crates simulate
//! signals and derive properties of the track from the features.
//!
//! # Example: LWPS of a tone
//!
//! ```
//! use std::f64::consts::TAU;
//! use tracktwin_signal::{Extractor, FeatureDefinition, Signal};
//!
//! let tone = |n: u32| 3.0 * (TAU * 800.0 * f64::from(n) / 1e5).sin();
//! let signal = Signal::new(1e5, (0..20_000).map(tone).collect())?;
//! let definition = FeatureDefinition::default();
//! let features = Extractor::new(&definition)?.extract(&signal, 8_000..12_000)?;
//!
//! // A steady tone of amplitude A has the logarithm 2 ln A in its bin.
//! let power = &features.log_power;
//! let highest = (0..power.len()).max_by(|a, b| power[*a].total_cmp(&power[*b])).unwrap();
//! assert!((definition.frequencies_hz()[highest] / 800.0 - 1.0).abs() < 0.01);
//! assert!((power[highest] - 2.0 * 3_f64.ln()).abs() < 0.05, "{}", power[highest]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
