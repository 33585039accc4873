//! What a stream says of a sleeper.

use crate::SleeperEvaluation;
use serde::Serialize;

/// The format of a row.
const FORMAT: &str = "tracktwin-stream/1";

/// A sleeper of a stream: evaluated, or the reason why not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    format: &'static str,
    /// What is known of the sleeper.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What is known of a sleeper.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Outcome {
    /// Its estimates.
    Evaluated(Box<Evaluated>),
    /// There are none.
    Unevaluated {
        /// Its name.
        id: String,
        /// Its place along the track in m.
        x_m: f64,
        /// Why there are none.
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
    /// Unevenness of railpads and ballast that is assumed: scatter over mean.
    pub unevenness: f64,
}

/// Why a sleeper has no estimates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Reason {
    /// The stream begins or ends before two fifths of the window.
    NotCovered,
    /// Samples are missing or not finite, and two fifths of the window are not left in one piece.
    NotFinite,
    /// Times leave out samples, or a position is farther ahead than the wheel can roll.
    Gap,
    /// The position decreases.
    RunsBack,
    /// The speed is that of no model.
    OtherSpeed {
        /// Mean speed over the window and its margins in km/h.
        speed_km_h: f64,
    },
    /// The speeds of window and margins differ by more than 4 %.
    SpeedChanges {
        /// The lowest and the highest of the three in km/h.
        speeds_km_h: [f64; 2],
    },
    /// Positions advance in steps of several samples.
    CoarsePosition,
}

impl Row {
    pub(super) const fn new(outcome: Outcome) -> Self {
        Self { format: FORMAT, outcome }
    }

    /// The row as one line of JSON, without the end of the line.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("a record of numbers and names is JSON")
    }
}
