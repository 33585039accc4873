//! Errors of a ring study.

use crate::plan::SLEEPERS;

/// Errors of a ring study.
#[derive(Debug, thiserror::Error)]
pub enum RingError {
    /// The text does not describe a stretch.
    #[error("`{text}` is no stretch of the ring; write it as FIRST-LAST, for example 86-98")]
    NoStretch {
        /// The text.
        text: String,
    },
    /// The stretch is empty, too short or beyond the ring.
    #[error(
        "sleepers {first} to {last} are no stretch of the ring: give at least {least} sleepers \
             from 1 to {SLEEPERS}"
    )]
    Stretch {
        /// Number of the first sleeper.
        first: usize,
        /// Number of the last sleeper.
        last: usize,
        /// Smallest number of sleepers for an evaluation.
        least: usize,
    },
    /// No speed is given.
    #[error("a ring needs at least one speed")]
    NoSpeed,
    /// A speed is too low or too high.
    #[error("{speed_km_h} km/h cannot be simulated: give speeds from 3 to 40 km/h")]
    Speed {
        /// The speed.
        speed_km_h: f64,
    },
    /// A speed is given twice.
    #[error("{speed_km_h} km/h is given twice; --laps repeats every speed")]
    SpeedTwice {
        /// The speed.
        speed_km_h: f64,
    },
    /// The content of a file of estimates is not an evaluation.
    #[error("not an evaluation: {0}")]
    NoEvaluation(#[from] serde_json::Error),
    /// An evaluation lacks its sleepers.
    #[error("not an evaluation: it has no list `sleepers`")]
    NoSleepers,
}
