//! Comparison of the results of the source paper (Shen et al. 2023) with those of this program, row by
//! row.
//!
//! This crate contains the claims of the paper, the tolerances of the verdicts, the tracks of the
//! numerical examples, and the passes over these tracks. It converts data to rows and pictures. Other
//! crates provide the data (library, surrogate, evaluation) and make the pages (report).

mod agreement;
mod average;
mod best_matches;
mod bound;
mod compared_regressions;
mod error;
mod example;
mod example_track;
mod example_tracks;
mod figure;
mod irregularity_spectrum;
mod local_change;
mod local_spectra;
mod one_parameter;
mod picture;
mod receptance;
mod regression;
mod row;
mod selector;
mod sensitivity;
mod source;
mod spectrum;
mod speed;
mod step;
mod test_errors;
#[cfg(test)]
mod testing;
mod time_frequency;

pub use agreement::SURE;
pub use error::Error;
pub use example::{EvaluatedExample, Example, examples};
pub use example_track::{EXAMPLE_SPANS, RecordedExample, Recordings, recordings};
pub use figure::Figure;
pub use picture::{Curve, Picture, Scale, Style};
pub use row::{ClaimRow, ClaimVerdict, Compared, FORMAT, Provenance, Reproduction};
pub use source::{Predictions, Results, Source};
pub use spectrum::SPEED_KM_H;
