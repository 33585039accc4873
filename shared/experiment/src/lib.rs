//! Experiment and outcome of a case, common to coordinator and worker.
//!
//! This crate contains the [`Experiment`] (all settings except the parameters of a case), the
//! [`Simulation`] of cases, their [`Outcome`], and [`MODEL_HASH`], the version of the physics. The
//! coordinator selects the cases. The protocol crate transfers them.
//!
//! # Example: LWPS of a simulated pass
//!
//! Corrugation of 6 mm wavelength excites a wheel at 10 km/h with 463 Hz.
//!
//! ```
//! use tracktwin_parameters::{ParameterSet, TrackDesign};
//! use tracktwin_signal::{Extractor, FeatureDefinition, Signal};
//! use tracktwin_track::extension::ExtensionInstance;
//! use tracktwin_track::model::{Mesh, Roughness, Support, TrackModel};
//! use tracktwin_track::time::{self, Pass};
//!
//! let (design, spans) = (TrackDesign::v_track(), 20);
//! let supports = vec![Support::from(&ParameterSet::nominal()); spans - 1];
//! let waves = ExtensionInstance::new("corrugation")
//!     .at([0.0, 2.5])
//!     .with("wavelength_m", 6e-3)
//!     .with("amplitude_m", 5e-6)
//!     .build(&design, spans)?;
//! let track = TrackModel::build(&design, &Mesh::uniform(spans, 4, 8), &supports, &[waves])?;
//! let (speed_m_s, time_step_s) = (10.0 / 3.6, 1e-5);
//! let pass = Pass { speed_m_s, start_m: 0.6, end_m: 1.9, time_step_s, local_flexibility: true };
//! let surface = track.surface(&Roughness::new(0.1), 1);
//! let record = time::pass(&track, &pass, &surface)?;
//!
//! let signal = Signal::new(1.0 / time_step_s, record.acceleration_m_s2)?;
//! // The window of the sleeper at 1.25 m.
//! let sample = |x_m: f64| ((x_m - pass.start_m) / speed_m_s / time_step_s) as usize;
//! let window = sample(1.1875)..sample(1.3125);
//! let definition = FeatureDefinition::default();
//! let power = Extractor::new(&definition)?.extract(&signal, window)?.log_power;
//! let highest = (0..power.len()).max_by(|a, b| power[*a].total_cmp(&power[*b])).unwrap();
//! let found_hz = definition.frequencies_hz()[highest];
//! assert!((found_hz / (speed_m_s / 6e-3) - 1.0).abs() < 0.02, "{found_hz}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod drawn;
mod error;
mod experiment;
mod outcome;
mod simulate;

pub use error::ExperimentError;
pub use experiment::{Experiment, metres_per_second};
pub use outcome::{Outcome, PassFeatures};
pub use simulate::{Prepare, Simulate, Simulation, prepare_simulation};
pub use tracktwin_parameters::Case;

/// Version of the program, for display.
pub const CODE_VERSION: &str = env!("CARGO_PKG_VERSION");

/// Version of the physics: BLAKE3 of `golden.json`, the features of some cases.
///
/// The coordinator rejects workers with another version. Null simulations of another version are
/// repeated. A test simulates the cases; if it fails, its message states how to write the file, and
/// therefore the version, again.
pub const MODEL_HASH: &str = env!("TRACKTWIN_MODEL_HASH");
