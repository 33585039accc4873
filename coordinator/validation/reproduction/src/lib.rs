//! The results of the source paper (Shen et al. 2023) beside what this program gets, row by row.
//!
//! Owns the paper's claims, the tolerances behind a verdict, the tracks of its numerical examples
//! and the passes over them; goes from data to rows and plain pictures. Leaves to others where the
//! data come from (library, surrogate, evaluation) and how a page looks (report).

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
