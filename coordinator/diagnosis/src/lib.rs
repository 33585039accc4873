//! Where simulation and recording differ, what physics was left out, and what including it gains.
//!
//! Owns baseline, null model, detection, names and their acceptance. Pure: recordings and null
//! simulations come in as values, a diagnosis goes out. The catalogue of physics is the track
//! model's; pages and files are left to others.

mod along;
mod bands;
mod baseline;
mod calibration;
pub mod chain;
mod finding;
mod first_look;
mod forward;
pub mod impact;
mod null_model;
mod section;
mod spectra;
pub mod wheel;

pub use bands::Bands;
pub use baseline::Unknowns;
pub use calibration::{Calibration, CalibrationError, Observation, calibrate};
pub use finding::{Finding, Place};
pub use first_look::{FALSE_ALARMS, FirstLook, first_look};
pub use forward::{Forward, Linearised};
pub use null_model::{NullError, NullModel, whitening};
pub use section::Section;
pub use spectra::{Spectra, SpeedSpectra};
