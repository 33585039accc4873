//! Outcome of a case.

use tracktwin_signal::Features;

/// Outcome of a case.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The features of one pass per speed, by ascending speed.
    Finished(Vec<PassFeatures>),
    /// The case cannot be simulated. This is a result, not an error of the farm.
    Failed {
        /// Reason of the failure.
        reason: String,
    },
}

/// The features of one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassFeatures {
    /// Speed in km/h.
    pub speed_km_h: f64,
    /// The features.
    pub features: Features,
    /// Share of the recorded time with contact loss, 0 to 1. `None` if the worker did not report this
    /// value.
    pub contact_loss_share: Option<f64>,
}
