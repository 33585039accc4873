//! Rows of a stream: the result of one sleeper each.

use crate::SleeperEvaluation;
use serde::Serialize;

/// Value of the field `format` of a row.
const FORMAT: &str = "tracktwin-stream/1";

/// Result of one sleeper of a stream.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    format: &'static str,
    /// Estimates, or the reason for missing estimates.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// Estimates of a sleeper, or the reason for missing estimates.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Outcome {
    /// The sleeper has estimates.
    Evaluated(Box<Evaluated>),
    /// The sleeper has no estimates.
    Unevaluated {
        /// Id of the sleeper.
        id: String,
        /// Position along the track in m.
        x_m: f64,
        /// Reason for the missing estimates.
        #[serde(flatten)]
        reason: Reason,
    },
}

/// Estimates of a sleeper.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluated {
    /// The sleeper, as in `evaluation.json`.
    #[serde(flatten)]
    pub sleeper: SleeperEvaluation,
    /// Assumed unevenness of railpad and ballast stiffness: standard deviation divided by the mean.
    pub unevenness: f64,
}

/// Reason for missing estimates of a sleeper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Reason {
    /// The segments cover less than two fifths of the window, because the stream begins or ends there.
    NotCovered,
    /// Samples are missing or not finite, and no piece covers two fifths of the window.
    NotFinite,
    /// The times skip samples, or a position is farther ahead than the wheel can roll in one sample
    /// interval.
    Gap,
    /// The position decreases.
    RunsBack,
    /// No model has this speed.
    OtherSpeed {
        /// Mean speed over the window and its margins in km/h.
        speed_km_h: f64,
    },
    /// The speeds of window and margins differ by more than 4 %.
    SpeedChanges {
        /// The lowest and the highest of these speeds in km/h.
        speeds_km_h: [f64; 2],
    },
    /// Positions advance in steps of several samples.
    CoarsePosition,
}

impl Row {
    pub(super) const fn new(outcome: Outcome) -> Self {
        Self { format: FORMAT, outcome }
    }

    /// The row as one line of JSON, without a line break.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("a record of numbers and names is JSON")
    }
}
