//! From samples while they are recorded to a row a sleeper.

use std::io::BufRead;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};
use tracktwin_evaluation::{Error, Flag, Outcome, Row, Stream};
use tracktwin_signal::samples::{SampleReader, SamplesError};

/// What came of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Streamed {
    /// Rows written.
    pub rows: usize,
    /// Sleepers with estimates.
    pub evaluated: usize,
    /// Those of them outside the library.
    pub outside: usize,
    /// Time by the clock of the computation of all rows.
    pub computing: Duration,
    /// The longest computation of the rows that one sample completes, by the clock.
    pub longest: Duration,
    /// The stream ended inside a line or a record.
    pub is_cut: bool,
    /// Nobody read rows any more before the samples ended.
    pub is_left: bool,
}

/// Why a stream ends before its samples do.
#[derive(Debug, thiserror::Error)]
pub enum StreamingError {
    /// The samples.
    #[error(transparent)]
    Samples(#[from] SamplesError),
    /// A sleeper cannot be evaluated.
    #[error(transparent)]
    Evaluation(#[from] Error),
}

impl Streamed {
    /// Whether the stream as a whole has no answer: most sleepers have no estimates or are outside the
    /// library.
    pub const fn is_negative(&self) -> bool {
        2 * (self.evaluated - self.outside) < self.rows
    }

    /// Counts rows and hands them on.
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
            let is_outside = evaluated.sleeper.flags.contains(&Flag::OutsideLibrary);
            self.outside += usize::from(is_outside);
        }
    }
}

/// Reads samples to their end and hands each row to `write` as soon as it is complete; ends early
/// when `write` breaks.
///
/// # Errors
/// [`StreamingError`]; the rows before it are written.
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
        let is_negative = |rows, evaluated, outside| {
            Streamed { rows, evaluated, outside, ..Streamed::default() }.is_negative()
        };
        assert!(!is_negative(10, 10, 0) && !is_negative(10, 7, 2));
        assert!(is_negative(10, 6, 2) && is_negative(10, 4, 0) && is_negative(10, 0, 0));
    }
}
