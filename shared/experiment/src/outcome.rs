//! Outcome of a case.

use tracktwin_signal::Features;

/// Outcome of a case.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Features, one pass a speed, by ascending speed.
    Finished(Vec<PassFeatures>),
    /// It cannot be simulated. That is a result, not an error of the farm.
    Failed {
        /// Why.
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
    /// Share of the recorded time, 0 to 1, in which the wheel did not touch the rail; none if the
    /// worker did not report it.
    pub contact_loss_share: Option<f64>,
}
