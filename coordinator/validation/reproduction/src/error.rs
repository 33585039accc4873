//! Why a figure cannot be compared.

use crate::Figure;

/// Errors of a reproduction.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The library lacks the speed of the figure of the paper.
    #[error("{figure} is at {wanted} km/h; the library has {} km/h", join(known))]
    NoSpeed {
        /// The figure.
        figure: Figure,
        /// The speed in km/h.
        wanted: f64,
        /// Speeds of the library in km/h.
        known: Vec<f64>,
    },
    /// The library has only one speed, but the figure compares speeds.
    #[error("{figure} compares speeds, but the library has one; use a campaign with several")]
    OneSpeed {
        /// The figure.
        figure: Figure,
    },
    /// A parameter is the same in all cases.
    #[error("{figure}: the library does not vary {symbol}; use a library over all of Table D1")]
    NotVaried {
        /// The figure.
        figure: Figure,
        /// The parameter's symbol.
        symbol: &'static str,
    },
    /// There are too few cases to compare.
    #[error("{figure}: {found} finished cases are too few; at least {least} are needed")]
    TooFewCases {
        /// The figure.
        figure: Figure,
        /// Number of finished cases.
        found: usize,
        /// Smallest sufficient number of cases.
        least: usize,
    },
    /// There is no such model.
    #[error("{figure}: the {feature} model at {speed_km_h} km/h is missing; train again")]
    NoModel {
        /// The figure.
        figure: Figure,
        /// The feature set.
        feature: &'static str,
        /// The speed in km/h.
        speed_km_h: f64,
    },
    /// An estimate is missing at a sleeper of an example.
    #[error("{figure}: sleeper {sleeper} of an example has no estimate of {symbol}")]
    NotEstimated {
        /// The figure.
        figure: Figure,
        /// Number of the sleeper, from 1.
        sleeper: usize,
        /// The parameter's symbol.
        symbol: &'static str,
    },
    /// A regression other than the Gaussian processes cannot be fitted.
    #[error("{figure}: {method}: {message}; use a library with more cases")]
    Regression {
        /// The figure.
        figure: Figure,
        /// The regression.
        method: &'static str,
        /// Error message of the crate of the regression.
        message: String,
    },
    /// The track cannot be built.
    #[error(transparent)]
    Model(#[from] tracktwin_track::model::ModelError),
    /// A pass over an example cannot be simulated.
    #[error("an example's pass: {0}")]
    Pass(#[from] tracktwin_track::time::PassError),
    /// The acceleration or the surface of an example is not a valid signal.
    #[error("an example: {0}")]
    Signal(#[from] tracktwin_signal::SignalError),
    /// A surface is too short for its spectrum.
    #[error("the spectrum of a surface: {0}")]
    Spectrum(#[from] tracktwin_signal::WelchError),
    /// A signal has no features of this kind.
    #[error(transparent)]
    Features(#[from] tracktwin_signal::FeatureError),
    /// A pass does not reach a sleeper.
    #[error("{figure}: the pass does not cover sleeper {sleeper}")]
    NotCovered {
        /// The figure.
        figure: Figure,
        /// Number of the sleeper, from 1.
        sleeper: usize,
    },
    /// Error of the model selector or a model.
    #[error(transparent)]
    Surrogate(#[from] tracktwin_surrogate::Error),
}

fn join(speeds: &[f64]) -> String {
    speeds.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}
