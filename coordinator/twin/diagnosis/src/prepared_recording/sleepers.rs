//! Selection of the compared sleepers, and their division into sections.

use super::{MARGIN_SPANS, PreparationError, SLEEPERS_MIN};
use std::ops::Range;
use tracktwin_signal::recording::Recording;

/// The longest run of neighbouring sleepers that every pass covers with a margin, without the passes with the indices
/// `except`.
pub(super) fn covered(recording: &Recording, except: &[usize]) -> Range<usize> {
    let reach_m = (0.5 + MARGIN_SPANS) * recording.spacing_m;
    let inside = |x_m: f64| {
        recording.passes.iter().enumerate().all(|(number, pass)| {
            let (first, last) = (pass.position_m[0], pass.position_m[pass.position_m.len() - 1]);
            except.contains(&number) || (first <= x_m - reach_m && x_m + reach_m <= last)
        })
    };
    let mut longest = 0..0;
    let mut start = 0;
    for (number, sleeper) in recording.sleepers.iter().enumerate() {
        if !inside(sleeper.x_m) {
            start = number + 1;
        } else if number + 1 - start > longest.len() {
            longest = start..number + 1;
        }
    }
    longest
}

/// Checks that some pass covers enough sleepers, before it is known which passes are compared. A recording without
/// sleeper positions passes the check.
///
/// # Errors
/// [`PreparationError::TooShort`].
pub fn check_length(recording: &Recording) -> Result<(), PreparationError> {
    let passes = 0..recording.passes.len();
    let is_long = |pass: usize| {
        let others: Vec<usize> = passes.clone().filter(|&other| other != pass).collect();
        covered(recording, &others).len() >= SLEEPERS_MIN
    };
    if recording.sleepers.is_empty() || passes.clone().any(is_long) {
        return Ok(());
    }
    Err(too_short(recording, covered(recording, &[]).len()))
}

/// Error of a recording whose compared passes share this number of sleepers.
pub(super) fn too_short(recording: &Recording, sleepers: usize) -> PreparationError {
    PreparationError::TooShort { sleepers, margin_m: MARGIN_SPANS * recording.spacing_m }
}

/// Ranges of at most `length` that cover a range; each shares at least `overlap` with the next.
pub(crate) fn overlapping(whole: Range<usize>, length: usize, overlap: usize) -> Vec<Range<usize>> {
    let rest = whole.len().saturating_sub(length);
    let steps = rest.div_ceil(length - overlap);
    let length = length.min(whole.len());
    let first = |step: usize| whole.start + (step * rest).checked_div(steps).unwrap_or(0);
    (0..=steps).map(|step| first(step)..first(step) + length).collect()
}

#[cfg(test)]
mod tests {
    use super::overlapping;

    #[test]
    fn sections_cover_a_track_and_overlap() {
        for short in [3..23, 3..27] {
            assert_eq!(overlapping(short.clone(), 24, 6), std::slice::from_ref(&short));
        }
        assert_eq!(overlapping(0..40, 24, 6), [0..24, 16..40]);
        let many = overlapping(5..106, 24, 6);
        assert_eq!((many[0].start, many[many.len() - 1].end), (5, 106));
        for pair in many.windows(2) {
            assert!(pair[0].end - pair[1].start >= 6, "{pair:?}");
        }
    }
}
