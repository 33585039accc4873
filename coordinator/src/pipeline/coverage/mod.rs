//! Coverage of the intervals, and error rates of the domain check. Unseen tracks are simulated inside the
//! library's ranges, beyond each end of a range, and with unevenness. Then they are evaluated.

mod inversion;
mod plan;
mod score;
mod track;

pub use inversion::{InversionCoverageError, InversionRow, InversionScore, inversion_rows};
pub use plan::{Counts, Kind};
pub use score::{Compared, CoverageRow};
pub use track::TrackError;

use crate::pipeline::evaluate::Evaluator;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use track::Track;
use tracktwin_experiment::Experiment;
use tracktwin_parameters::{Parameter, ParameterSet};

/// Number of tracks that are simulated together.
const TOGETHER: usize = 8;

/// Errors of measuring the coverage.
#[derive(Debug, thiserror::Error)]
pub enum CoverageError {
    /// A track can't be simulated.
    #[error("cannot simulate a track: {0}")]
    Track(#[from] TrackError),
    /// A recording can't be evaluated.
    #[error("cannot evaluate a simulated recording: {0}")]
    Evaluation(#[from] tracktwin_evaluation::Error),
}

/// Tracks to simulate, and the models that evaluate them.
pub struct Coverage<'a> {
    /// The models with their library.
    pub evaluator: &'a Evaluator,
    /// Experiment of the library's cases.
    pub experiment: &'a Experiment,
    /// Values of the parameters that the library does not vary.
    pub fixed: ParameterSet,
    /// Additional tracks with one parameter at a value given by the user.
    pub settings: Vec<(Parameter, f64)>,
    /// Numbers of tracks and sleepers, and the seed.
    pub counts: Counts,
}

impl Coverage<'_> {
    /// Simulates and evaluates all tracks on all cores. Progress is reported as number of completed tracks
    /// and total number.
    ///
    /// # Errors
    /// Returns the [`CoverageError`] of the first track that fails.
    pub fn rows(
        &self,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<Vec<CoverageRow>, CoverageError> {
        let library = self.evaluator.set();
        let rows = plan::rows(library, &self.fixed, &self.settings, self.counts);
        let total = rows.iter().map(|(_, tracks)| tracks.len()).sum();
        let done = AtomicUsize::new(0);
        rows.into_iter()
            .map(|(kind, tracks)| {
                let answers = tracks
                    .par_chunks(TOGETHER)
                    .map(|together| {
                        let answers = self.answers(together)?;
                        let before = done.fetch_add(together.len(), Ordering::Relaxed);
                        progress(before + together.len(), total);
                        Ok(answers)
                    })
                    .collect::<Result<Vec<_>, CoverageError>>()?;
                let answers: Vec<_> =
                    tracks.iter().cloned().zip(answers.into_iter().flatten()).collect();
                Ok(score::row(kind, &answers))
            })
            .collect()
    }

    fn answers(
        &self,
        tracks: &[Track],
    ) -> Result<Vec<tracktwin_evaluation::Evaluation>, CoverageError> {
        let recordings = track::record(self.experiment, tracks)?;
        recordings.iter().map(|recording| Ok(self.evaluator.evaluate(recording)?)).collect()
    }
}
