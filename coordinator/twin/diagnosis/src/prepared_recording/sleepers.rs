//! Selection of the compared sleepers, and their division into sections.

use super::{MARGIN_SPANS, PreparationError, SLEEPERS_MIN};
use crate::spectra::are_one_speed;
use std::ops::Range;
use tracktwin_signal::recording::{Pass, Recording};

/// What is not compared because not every pass covers all sleepers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Uncovered {
    /// Indices of the passes that cover so few sleepers that they are left out.
    pub short_passes: Vec<usize>,
    /// Number of sleepers that some of the compared passes cover, and not all.
    pub sleepers: usize,
}

impl Uncovered {
    /// Note on the passes that are left out.
    pub fn note(&self, recording: &Recording) -> Option<String> {
        let files: Vec<&str> =
            self.short_passes.iter().map(|&pass| &*recording.passes[pass].file).collect();
        (!files.is_empty()).then(|| {
            format!(
                "{}: not compared with the track, because fewer sleepers lie inside than inside the other passes.",
                files.join(", ")
            )
        })
    }

    /// Sentence on the sleepers that not every pass covers, beside the compared ones.
    pub(crate) fn lost(&self, first: &str, last: &str) -> String {
        let sleepers = match self.sleepers {
            1 => "another sleeper".to_owned(),
            count => format!("{count} further sleepers"),
        };
        format!(
            "Only {first} to {last} were compared; not every pass covers {sleepers} with a margin."
        )
    }
}

/// Passes whose omission gives more compared sleepers, counted once for each pass: those that begin late or end early.
/// Passes at two speeds are kept, if there are two. The passes with the indices `except` do not count.
pub fn short_passes(recording: &Recording, except: &[usize]) -> Vec<usize> {
    let mut short = Vec::new();
    loop {
        let left_out = [except, &short[..]].concat();
        let left: Vec<usize> =
            (0..recording.passes.len()).filter(|pass| !left_out.contains(pass)).collect();
        let compared = |without: &[usize], passes: usize| {
            passes * covered(recording, &[&left_out, without].concat()).len()
        };
        let keeps_speeds = |&&pass: &&usize| {
            let others: Vec<usize> = left.iter().copied().filter(|&it| it != pass).collect();
            speeds(recording, &others) >= speeds(recording, &left).min(2)
        };
        let candidates = left.iter().filter(keeps_speeds);
        let best = candidates
            .map(|&pass| (compared(&[pass], left.len() - 1), pass))
            .max()
            .filter(|(count, _)| *count > compared(&[], left.len()));
        let Some((_, pass)) = best else { break };
        short.push(pass);
    }
    short
}

/// Number of speeds of some passes.
fn speeds(recording: &Recording, passes: &[usize]) -> usize {
    let speed = |pass: usize| recording.passes[pass].speed_km_h;
    let is_new = |(at, &pass): (usize, &usize)| {
        passes[..at].iter().all(|&other| !are_one_speed(speed(pass), speed(other)))
    };
    passes.iter().enumerate().filter(|&it| is_new(it)).count()
}

/// Whether a pass covers a sleeper at a position in m with a margin.
fn covers(recording: &Recording, pass: &Pass, x_m: f64) -> bool {
    let reach_m = (0.5 + MARGIN_SPANS) * recording.spacing_m;
    let (first, last) = (pass.position_m[0], pass.position_m[pass.position_m.len() - 1]);
    first <= x_m - reach_m && x_m + reach_m <= last
}

/// The compared sleepers, the longest run that every pass covers, and what is not compared. The passes with the indices
/// `except` do not count.
pub(super) fn compared(recording: &Recording, except: &[usize]) -> (Range<usize>, Uncovered) {
    let short_passes = short_passes(recording, except);
    let left_out = [except, &short_passes].concat();
    let sleepers = covered(recording, &left_out);
    let passes = || recording.passes.iter().enumerate().filter(|(it, _)| !left_out.contains(it));
    let is_covered = |x_m: f64| passes().any(|(_, pass)| covers(recording, pass, x_m));
    let some = recording.sleepers.iter().filter(|sleeper| is_covered(sleeper.x_m)).count();
    let uncovered = Uncovered { short_passes, sleepers: some - sleepers.len() };
    (sleepers, uncovered)
}

/// The longest run of neighbouring sleepers that every pass covers with a margin, without the passes with the indices
/// `except`.
fn covered(recording: &Recording, except: &[usize]) -> Range<usize> {
    let inside = |x_m: f64| {
        let mut passes = recording.passes.iter().enumerate();
        passes.all(|(number, pass)| except.contains(&number) || covers(recording, pass, x_m))
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
    use super::*;
    use tracktwin_signal::Signal;
    use tracktwin_signal::recording::Sleeper;

    /// Passes over `[from, to]` in m at speeds in km/h, with 30 sleepers every 0.1 m from 0.1 m.
    fn recording(passes: &[(f64, [f64; 2])]) -> Recording {
        let pass = |&(speed_km_h, ends_m): &(f64, [f64; 2])| Pass {
            file: format!("{speed_km_h}"),
            speed_km_h,
            axle: None,
            signal: Signal::new(1e3, vec![0.0; 2]).unwrap(),
            position_m: ends_m.to_vec(),
            contact_loss_share: None,
        };
        let sleeper =
            |number: u32| Sleeper { id: number.to_string(), x_m: 0.1 * f64::from(number) };
        Recording {
            name: String::new(),
            sample_rate_hz: 1e3,
            channel: String::new(),
            passes: passes.iter().map(pass).collect(),
            sleepers: (1..=30).map(sleeper).collect(),
            nominal: serde_json::Map::default(),
            spacing_m: 0.1,
            doubts: Vec::new(),
        }
    }

    #[test]
    fn a_short_pass_does_not_cut_the_track_of_the_others() {
        let (whole, short) = ([-1.0, 4.0], [-1.0, 1.05]);
        let of = |passes: &[(f64, [f64; 2])]| compared(&recording(passes), &[]);
        let none = Uncovered::default();
        assert_eq!(of(&[(7.0, whole), (10.0, whole)]), (0..30, none.clone()));
        let left_out = Uncovered { short_passes: vec![1], sleepers: 0 };
        assert_eq!(of(&[(7.0, whole), (7.0, short), (10.0, whole)]), (0..30, left_out.clone()));
        // Another speed does not outweigh two thirds of the sleepers.
        assert_eq!(of(&[(7.0, whole), (13.0, short), (10.0, whole)]), (0..30, left_out));
        // Of two speeds none is left out, and it is known what is lost.
        let lost = Uncovered { short_passes: Vec::new(), sleepers: 21 };
        assert_eq!(of(&[(7.0, whole), (10.0, short)]), (0..9, lost));
        // A pass that is a little shorter says more than the sleepers that it lacks.
        let little = Uncovered { short_passes: Vec::new(), sleepers: 3 };
        let some = [-1.0, 2.85];
        assert_eq!(of(&[(7.0, whole), (7.0, some), (10.0, whole)]), (0..27, little));
        // A pass that the inspection left out does not count.
        let both = recording(&[(7.0, short), (7.0, whole), (10.0, whole)]);
        assert_eq!(compared(&both, &[0]), (0..30, none));
    }

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
