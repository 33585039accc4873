//! Evaluation of samples while they are recorded; the result is one row per sleeper.

use std::io::BufRead;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};
use tracktwin_evaluation::{Error, Flag, Outcome, Row, Stream};
use tracktwin_signal::samples::{SampleReader, SamplesError};

/// Summary of an evaluated stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Streamed {
    /// Number of rows written.
    pub rows: usize,
    /// Number of sleepers with estimates.
    pub evaluated: usize,
    /// Number of sleepers with estimates that are outside the library.
    pub outside: usize,
    /// Number of sleepers with estimates that could not be tested against the library.
    pub not_tested: usize,
    /// Wall-clock time of computing all rows.
    pub computing: Duration,
    /// Longest wall-clock time of computing the rows that one sample completes.
    pub longest: Duration,
    /// Whether the stream ended inside a line or a record.
    pub is_cut: bool,
    /// Whether the reader of the rows ended before the samples.
    pub is_left: bool,
}

/// Errors that end a stream early.
#[derive(Debug, thiserror::Error)]
pub enum StreamingError {
    /// The samples are invalid or cannot be read.
    #[error(transparent)]
    Samples(#[from] SamplesError),
    /// A sleeper cannot be evaluated.
    #[error(transparent)]
    Evaluation(#[from] Error),
}

impl Streamed {
    /// Whether the stream has a negative result: less than half of the sleepers have estimates that the
    /// test found inside the library.
    pub const fn is_negative(&self) -> bool {
        2 * (self.evaluated - self.outside - self.not_tested) < self.rows
    }

    /// Counts rows and passes them to `write`.
    fn write(
        &mut self,
        rows: &[Row],
        write: &mut dyn FnMut(&Row) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        for row in rows {
            self.add(row);
            self.is_left = write(row).is_break();
            if self.is_left {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }

    fn add(&mut self, row: &Row) {
        self.rows += 1;
        if let Outcome::Evaluated(evaluated) = &row.outcome {
            self.evaluated += 1;
            let has = |flag| usize::from(evaluated.sleeper.flags.contains(&flag));
            self.outside += has(Flag::OutsideLibrary);
            self.not_tested += has(Flag::DomainNotTested);
        }
    }
}

/// Reads samples to their end, and passes each row to `write` as soon as the row is complete. Ends early if
/// `write` returns `Break`.
///
/// # Errors
/// Returns [`StreamingError`]. Rows completed before the error have been written.
pub fn run(
    samples: &mut SampleReader<impl BufRead>,
    mut stream: Stream<'_>,
    write: &mut dyn FnMut(&Row) -> ControlFlow<()>,
) -> Result<Streamed, StreamingError> {
    let mut streamed = Streamed::default();
    while let Some(sample) = samples.next_sample()? {
        let begun = Instant::now();
        let rows = stream.push(&sample)?;
        if rows.is_empty() {
            continue;
        }
        let took = begun.elapsed();
        streamed.computing += took;
        streamed.longest = streamed.longest.max(took);
        if streamed.write(&rows, write).is_break() {
            return Ok(streamed);
        }
    }
    streamed.is_cut = samples.is_cut();
    let begun = Instant::now();
    let rows = stream.finish()?;
    streamed.computing += begun.elapsed();
    // Whether anybody reads the last rows makes no difference any more.
    let _ = streamed.write(&rows, write);
    Ok(streamed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_has_no_answer_if_most_sleepers_have_no_valid_estimates() {
        let is_negative = |rows, evaluated, outside, not_tested| {
            let streamed = Streamed { rows, evaluated, outside, not_tested, ..Default::default() };
            streamed.is_negative()
        };
        assert!(!is_negative(10, 10, 0, 0) && !is_negative(10, 7, 2, 0));
        assert!(is_negative(10, 6, 2, 0) && is_negative(10, 4, 0, 0) && is_negative(10, 0, 0, 0));
        assert!(!is_negative(10, 10, 2, 3) && is_negative(10, 10, 0, 6));
    }
}
