//! From a recording to the track's parameters, sleeper by sleeper.
//!
//! Owns the features of a sleeper from several passes, their way through surrogates and model
//! selector, and the files that say the outcome. Leaves to others what a window and a feature is
//! (signal), what a model predicts (surrogate) and how it looks on a page (report).

mod check;
mod error;
mod estimate;
mod evaluation;
mod files;
mod matches;
mod outside;
mod stream;
#[cfg(test)]
mod testing;
mod unevenness;
mod windows;

pub use check::check_recording;
pub use error::Error;
pub use estimate::{METHOD_FEATURE, Twin, evaluate};
pub use evaluation::{
    Estimate, Estimates, Evaluation, FORMAT, Flag, Known, Measured, Provenance, Selected,
    SleeperEvaluation, Unevaluated,
};
pub use matches::MATCHES;
pub use outside::{BeyondEnd, Domains, OutsideLibrary};
pub use stream::{Evaluated, Outcome, Reason, Row, Stream};
pub use unevenness::Unevenness;
pub use windows::{SleeperFeatures, SpeedFeatures, features};
