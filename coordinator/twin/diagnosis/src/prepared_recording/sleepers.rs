//! Selection of the compared sleepers, and their division into sections.

use super::{MARGIN_SPANS, PreparationError, SLEEPERS_MIN};
use crate::spectra::passes_by_speed;
use std::ops::Range;
use tracktwin_signal::recording::Recording;

/// Smallest share of a sleeper's window that a pass must cover.
const SHARE_MIN: f64 = 0.98;

/// What is not compared because no pass at some speed covers it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Uncovered {
    /// Indices of the passes at speeds whose passes cover so few sleepers that they are left out.
    pub short_passes: Vec<usize>,
    /// Number of sleepers that some of the compared passes cover, but not at every speed.
    pub sleepers: usize,
}

impl Uncovered {
    /// Note on the passes that are left out.
    pub fn note(&self, recording: &Recording) -> Option<String> {
        let files: Vec<&str> =
            self.short_passes.iter().map(|&pass| &*recording.passes[pass].file).collect();
        (!files.is_empty()).then(|| {
            format!(
                "{}: not compared with the track, because fewer sleepers were passed at this speed than at the others.",
                files.join(", ")
            )
        })
    }

    /// Sentence on the sleepers that are not covered at every speed, beside the compared ones.
    pub(crate) fn lost(&self, first: &str, last: &str) -> String {
        let sleepers = match self.sleepers {
            1 => "another sleeper is".to_owned(),
            count => format!("{count} further sleepers are"),
        };
        format!("Only {first} to {last} were compared; {sleepers} not covered at every speed.")
    }
}

/// Passes of a recording, by speed.
struct BySpeed<'r> {
    recording: &'r Recording,
    /// Indices of the passes at each speed.
    speeds: Vec<Vec<usize>>,
}

impl<'r> BySpeed<'r> {
    /// The passes except those with the indices `except`.
    fn new(recording: &'r Recording, except: &[usize]) -> Self {
        let speeds = passes_by_speed(recording, except);
        Self { recording, speeds }
    }

    /// The longest run of neighbouring sleepers that some pass covers at every speed.
    fn covered(&self) -> Range<usize> {
        let at_speed = |passes: &Vec<usize>, sleeper: usize| {
            passes.iter().any(|&pass| covers(self.recording, pass, sleeper))
        };
        let mut longest = 0..0;
        let mut start = 0;
        for sleeper in 0..self.recording.sleepers.len() {
            if !self.speeds.iter().all(|passes| at_speed(passes, sleeper)) {
                start = sleeper + 1;
            } else if sleeper + 1 - start > longest.len() {
                longest = start..sleeper + 1;
            }
        }
        longest
    }

    /// Without one speed.
    fn without(&self, speed: usize) -> Self {
        let mut speeds = self.speeds.clone();
        speeds.remove(speed);
        Self { recording: self.recording, speeds }
    }

    /// Number of compared sleepers, counted once for each speed.
    fn data(&self) -> usize {
        self.speeds.len() * self.covered().len()
    }
}

/// Whether a pass covers the window of a sleeper with a margin.
pub(crate) fn covers(recording: &Recording, pass: usize, sleeper: usize) -> bool {
    let reach_m = (0.5 + MARGIN_SPANS) * recording.spacing_m;
    let x_m = recording.sleepers[sleeper].x_m;
    let positions_m = &recording.passes[pass].position_m;
    let (first_m, last_m) = (positions_m[0], positions_m[positions_m.len() - 1]);
    let is_inside = first_m <= x_m - reach_m && x_m + reach_m <= last_m;
    is_inside && recording.window_share(pass, sleeper) >= SHARE_MIN
}

/// Passes at speeds without which there are more compared sleepers, counted once for each speed. Two speeds are kept, if
/// there are two. The passes with the indices `except` do not count.
pub fn short_passes(recording: &Recording, except: &[usize]) -> Vec<usize> {
    let mut left = BySpeed::new(recording, except);
    let mut short = Vec::new();
    while left.speeds.len() > 2 {
        let fewer = (0..left.speeds.len()).map(|speed| (left.without(speed).data(), speed));
        let Some((data, speed)) = fewer.max() else { break };
        if data <= left.data() {
            break;
        }
        short.extend(left.speeds.remove(speed));
    }
    short
}

/// The compared sleepers, the longest run that some pass covers at every speed, and what is not compared. The passes with
/// the indices `except` do not count.
pub(super) fn compared(recording: &Recording, except: &[usize]) -> (Range<usize>, Uncovered) {
    let short_passes = short_passes(recording, except);
    let passes = BySpeed::new(recording, &[except, &short_passes].concat());
    let sleepers = passes.covered();
    let is_covered = |&sleeper: &usize| {
        passes.speeds.iter().flatten().any(|&pass| covers(recording, pass, sleeper))
    };
    let some = (0..recording.sleepers.len()).filter(is_covered).count();
    let uncovered = Uncovered { short_passes, sleepers: some - sleepers.len() };
    (sleepers, uncovered)
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
        BySpeed::new(recording, &others).covered().len() >= SLEEPERS_MIN
    };
    if recording.sleepers.is_empty() || passes.clone().any(is_long) {
        return Ok(());
    }
    Err(too_short(recording, BySpeed::new(recording, &[]).covered().len()))
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
    use tracktwin_signal::recording::{Pass, Sleeper};

    /// Passes over `[from, to]` in m at speeds in km/h, with 30 sleepers every 0.1 m from 0.1 m.
    fn recording(passes: &[(f64, [f64; 2])]) -> Recording {
        let pass = |&(speed_km_h, [from_m, to_m]): &(f64, [f64; 2])| {
            let position_m: Vec<f64> =
                (0..=(1e3 * (to_m - from_m)) as usize).map(|n| from_m + 1e-3 * n as f64).collect();
            Pass {
                file: format!("{speed_km_h}"),
                speed_km_h,
                axle: None,
                signal: Signal::new(1e3, vec![0.0; position_m.len()]).unwrap(),
                position_m,
                contact_loss_share: None,
            }
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

    const WHOLE: [f64; 2] = [-1.0, 4.0];
    const SHORT: [f64; 2] = [-1.0, 1.05];

    fn of(passes: &[(f64, [f64; 2])]) -> (Range<usize>, Uncovered) {
        compared(&recording(passes), &[])
    }

    /// A pass is split where its data have a gap.
    #[test]
    fn a_sleeper_needs_a_pass_at_every_speed_and_not_every_pass() {
        let none = Uncovered::default();
        assert_eq!(of(&[(7.0, WHOLE), (10.0, WHOLE)]), (0..30, none.clone()));
        assert_eq!(of(&[(7.0, WHOLE), (7.0, SHORT), (10.0, WHOLE)]), (0..30, none.clone()));
        let halves = [(7.0, [-1.0, 1.5]), (7.0, [1.52, 4.0])];
        let gap = Uncovered { short_passes: Vec::new(), sleepers: 16 };
        assert_eq!(of(&[halves[0], halves[1], (10.0, WHOLE)]), (16..30, gap));
        assert_eq!(of(&[halves[0], halves[1], (7.0, WHOLE), (10.0, WHOLE)]), (0..30, none));
    }

    #[test]
    fn a_speed_with_short_passes_does_not_cut_the_track_of_the_others() {
        let left_out = Uncovered { short_passes: vec![1], sleepers: 0 };
        assert_eq!(of(&[(7.0, WHOLE), (13.0, SHORT), (10.0, WHOLE)]), (0..30, left_out));
        // Of two speeds none is left out, and it is known what is lost.
        let lost = Uncovered { short_passes: Vec::new(), sleepers: 21 };
        assert_eq!(of(&[(7.0, WHOLE), (10.0, SHORT)]), (0..9, lost));
        // A speed whose passes are a little shorter says more than the sleepers that it lacks.
        let little = Uncovered { short_passes: Vec::new(), sleepers: 3 };
        let some = [-1.0, 2.85];
        assert_eq!(of(&[(7.0, WHOLE), (13.0, some), (10.0, WHOLE)]), (0..27, little));
        // A pass that the inspection left out does not count.
        let both = recording(&[(7.0, SHORT), (7.0, WHOLE), (10.0, WHOLE)]);
        assert_eq!(compared(&both, &[1]).0, 0..9);
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
