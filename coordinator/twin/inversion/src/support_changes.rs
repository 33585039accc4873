//! Support changes along a recording: transitions, and soft or stiff spots.

use crate::fit::{Amplitude, Fitted};
use serde::Serialize;
use std::cmp::Reverse;
use std::ops::Range;
use tracktwin_diagnosis::{PreparedRecording, SupportChange, owner};
use tracktwin_number::NORMAL_90;
use tracktwin_signal::recording::Recording;

/// A change of the ballast stiffness along the track that is more than its variation between sleepers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Form of the change.
    pub kind: ChangeKind,
    /// Ids of the last sleeper before a transition and of the first behind it, or of the first and the last sleeper
    /// of a spot.
    pub sleepers: [String; 2],
    /// Probability that there is a change and not only variation between sleepers.
    pub probability: f64,
    /// Relative change of the ballast stiffness: -0.4 if 40 % less.
    pub change: f64,
    /// Ends of the 90 % interval of `change`.
    pub interval_90: [f64; 2],
}

/// Form of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// The stiffness changes and keeps its new value.
    Transition,
    /// A run of sleepers on softer support than those on both sides.
    SoftSpot,
    /// A run of sleepers on stiffer support than those on both sides.
    StiffSpot,
}

/// A change that a section found; its sleepers are indices in the recording.
#[derive(Clone, Copy)]
struct Found {
    section: usize,
    change: SupportChange,
    amplitude: Amplitude,
}

/// All changes of the fitted sections of a recording.
pub(crate) fn changes(
    recording: &Recording,
    sections: &[(PreparedRecording, Fitted)],
) -> Vec<Change> {
    let ranges: Vec<_> = sections.iter().map(|(prepared, _)| prepared.sleepers()).collect();
    let mut all = Vec::new();
    for (section, (prepared, fitted)) in sections.iter().enumerate() {
        for (change, &amplitude) in fitted.unknowns.support_changes.iter().zip(&fitted.changes) {
            let change = change.behind(prepared.first_sleeper);
            all.push(Found { section, change, amplitude });
        }
    }
    let mut kept: Vec<Found> =
        all.iter().copied().filter(|it| is_stated(it, &all, &ranges)).collect();
    kept.sort_by_key(Found::middle);
    kept.into_iter().map(|it| Change::new(recording, it)).collect()
}

/// Whether a change is stated. One that a single section found is stated if its middle belongs to that section. If
/// several sections found it, a spot explains more than a transition, of which a section shows one end; otherwise it
/// is that of the section in which it lies farthest from the ends.
fn is_stated(found: &Found, all: &[Found], sections: &[Range<usize>]) -> bool {
    let rank = |it: &Found| {
        let Range { start, end } = sections[it.section];
        let is_spot = matches!(it.change, SupportChange::Spot { .. });
        (is_spot, (it.middle() - start).min(end - 1 - it.middle()), Reverse(it.section))
    };
    let mut same = all.iter().filter(|other| found.is_same(other)).peekable();
    if same.peek().is_none() {
        return owner(sections, found.middle()) == Some(found.section);
    }
    same.all(|other| rank(found) > rank(other))
}

impl Found {
    fn middle(&self) -> usize {
        let (before, after) = self.change.neighbours();
        usize::midpoint(before, after)
    }

    /// Whether another section found the same change: they overlap.
    fn is_same(&self, other: &Self) -> bool {
        let (before, after) = self.change.neighbours();
        let (other_before, other_after) = other.change.neighbours();
        self.section != other.section && before <= other_after && other_before <= after
    }
}

impl Change {
    fn new(
        recording: &Recording,
        Found { change, amplitude: Amplitude { log, deviation, probability }, .. }: Found,
    ) -> Self {
        let (kind, ends) = match change {
            SupportChange::Transition { before, after } => {
                (ChangeKind::Transition, [before, after])
            }
            SupportChange::Spot { first, last } if log < 0.0 => {
                (ChangeKind::SoftSpot, [first, last])
            }
            SupportChange::Spot { first, last } => (ChangeKind::StiffSpot, [first, last]),
        };
        let id = |sleeper: usize| recording.sleepers[sleeper].id.clone();
        let end = |way: f64| (log + way * NORMAL_90 * deviation).exp_m1();
        Self {
            kind,
            sleepers: ends.map(id),
            probability,
            change: log.exp_m1(),
            interval_90: [end(-1.0), end(1.0)],
        }
    }

    /// The change in a sentence.
    pub fn sentence(&self) -> String {
        let [first, last] = &self.sleepers;
        let per_cent = |change: f64| format!("{:+.0}", 100.0 * change);
        let [lower, upper] = self.interval_90.map(per_cent);
        let (change, sure) = (per_cent(self.change), 100.0 * self.probability);
        let form = match self.kind {
            ChangeKind::Transition => "transition",
            ChangeKind::SoftSpot => "soft spot",
            ChangeKind::StiffSpot => "stiff spot",
        };
        let where_to = match self.kind {
            ChangeKind::Transition => {
                format!("changes by {change} % from {first} to {last}")
            }
            ChangeKind::SoftSpot | ChangeKind::StiffSpot => {
                format!("from {first} to {last} differs by {change} % from that on both sides")
            }
        };
        format!(
            "The ballast stiffness {where_to} (90 % interval {lower} to {upper} %). With a probability of {sure:.0} % this is \
             more than its variation between sleepers, most likely a {form}."
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_tells_place_size_and_probability() {
        let change = Change {
            kind: ChangeKind::SoftSpot,
            sleepers: ["SN16", "SN21"].map(str::to_owned),
            probability: 0.9,
            change: -0.43,
            interval_90: [-0.47, -0.39],
        };
        let expected = "The ballast stiffness from SN16 to SN21 differs by -43 % from that on both sides (90 % interval -47 \
                        to -39 %). With a probability of 90 % this is more than its variation between sleepers, most \
                        likely a soft spot.";
        assert_eq!(change.sentence(), expected);
    }

    /// Those of the changes found in the sections 0..26 and 18..44 that are stated.
    fn stated(found: &[(usize, SupportChange)]) -> Vec<SupportChange> {
        let amplitude = Amplitude { log: 0.5, deviation: 0.1, probability: 0.9 };
        let all = found.iter().map(|&(section, change)| Found { section, change, amplitude });
        let all: Vec<Found> = all.collect();
        let kept = all.iter().filter(|it| is_stated(it, &all, &[0..26, 18..44]));
        kept.map(|it| it.change).collect()
    }

    #[test]
    fn a_change_in_two_sections_is_stated_once() {
        let step = |before| SupportChange::Transition { before, after: before + 1 };
        let spot = SupportChange::Spot { first: 20, last: 27 };
        // The first section does not see the end of the spot.
        assert_eq!(stated(&[(0, step(19)), (1, spot)]), [spot]);
        // Both sections see it, and differ by a sleeper where the middle between them lies.
        assert_eq!(stated(&[(0, step(22)), (1, step(21))]), [step(22)]);
        assert_eq!(stated(&[(0, step(21)), (1, step(22))]), [step(21)]);
        // The second section lies deeper around it and does not see it.
        assert_eq!(stated(&[(0, step(23))]), []);
        assert_eq!(stated(&[(0, step(10)), (1, step(30))]), [step(10), step(30)]);
    }
}
