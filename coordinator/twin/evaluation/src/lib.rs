//! Evaluation of a recording: estimates of the track parameters at every sleeper.
//!
//! This crate computes the features of a sleeper from several passes, applies surrogates and model
//! selector, and writes the files of the result. Other crates define windows and features (signal), predict
//! parameters from features (surrogate) and make pages (report).

mod by_speeds;
mod check;
mod error;
mod estimate;
mod evaluation;
mod files;
mod matches;
mod outside;
mod speeds;
mod stream;
#[cfg(test)]
mod testing;
mod unevenness;
mod windows;

pub use by_speeds::BySpeeds;
pub use check::check_recording;
pub use error::Error;
pub use estimate::{METHOD_FEATURE, Twin, evaluate};
pub use evaluation::{
    Estimate, Estimates, Evaluation, FORMAT, Flag, Known, Measured, Provenance, Selected,
    SleeperEvaluation, Unevaluated,
};
pub use matches::MATCHES;
pub use outside::{BeyondEnd, OutsideLibrary};
pub use speeds::ModelSpeeds;
pub use stream::{Evaluated, Outcome, Reason, Row, Stream};
pub use unevenness::Unevenness;
pub use windows::{SleeperFeatures, SpeedFeatures, features};
