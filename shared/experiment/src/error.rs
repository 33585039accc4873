//! Reasons for refusing an experiment.

use crate::experiment::{END_SPANS, STEPS_MAX};
use tracktwin_parameters::{DesignAxisError, QuantityError, WavelengthsError};
use tracktwin_signal::FeatureError;
use tracktwin_track::extension::InstanceError;

/// Why an experiment is not possible. Each error names the setting.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    /// Speeds are missing, not positive, or not in order.
    #[error(
        "speeds_km_h: {speeds:?} must be one or more positive speeds in ascending order \
         without duplicates"
    )]
    Speeds {
        /// The speeds.
        speeds: Vec<f64>,
    },
    /// A number is outside its allowed range.
    #[error("{setting}: {value} must lie in {low} to {high}")]
    OutOfRange {
        /// The setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// Lowest value.
        low: f64,
        /// Highest value.
        high: f64,
    },
    /// A speed is outside its allowed range.
    #[error("speeds_km_h: {0}")]
    Speed(#[from] QuantityError),
    /// A pass has more time steps than fit into memory.
    #[error(
        "time_step_s: {time_step_s:e} gives {steps:.1e} steps at {speed_km_h} km/h, but the \
             limit is {STEPS_MAX:.0e}; use a longer step or higher speeds"
    )]
    TooManySteps {
        /// The time step, in s.
        time_step_s: f64,
        /// Number of time steps of the slowest pass.
        steps: f64,
        /// Speed of this pass in km/h.
        speed_km_h: f64,
    },
    /// Wavelengths are not in order, or outside their limits.
    #[error("wavelengths_m: {0}")]
    Wavelengths(#[from] WavelengthsError),
    /// The recorded stretch is too near to the held ends of the rail.
    #[error(
        "spans: {spans} is too small for {speed_km_h} km/h: the evaluated sleepers must be \
             {END_SPANS} spans away from the ends of the rail; use {needed} spans"
    )]
    TooShort {
        /// Number of spans of the track.
        spans: usize,
        /// Speed in km/h.
        speed_km_h: f64,
        /// Smallest sufficient number of spans.
        needed: usize,
    },
    /// A further wheel would leave the track.
    #[error(
        "spans: {spans} is too small for the wheel {ahead_m} m ahead of the first one, which would leave the track at \
             {speed_km_h} km/h; use {needed} spans, or smaller distances of the wheels"
    )]
    WheelOffTrack {
        /// Number of spans of the track.
        spans: usize,
        /// Distance of the wheel in front of the first one in m; negative behind it.
        ahead_m: f64,
        /// Speed in km/h.
        speed_km_h: f64,
        /// Smallest sufficient number of spans.
        needed: usize,
    },
    /// A varied number of the design is invalid.
    #[error("parameters.{0}")]
    Design(#[from] DesignAxisError),
    /// An extension is invalid.
    #[error("extension: {0}")]
    Extension(#[from] InstanceError),
    /// The features can't be extracted.
    #[error(transparent)]
    Features(#[from] FeatureError),
    /// The features lack one-third octaves that the library stores.
    #[error("features: the range must hold all one-third octaves from 50 to 4000 Hz")]
    Bands,
    /// The text is not the JSON of an experiment of this program version.
    #[error("not an experiment: {message}")]
    Json {
        /// Error of the parser.
        message: String,
    },
}
