//! Support changes along a recording: transitions, and soft or stiff spots.

use crate::fit::{Amplitude, Fitted};
use serde::Serialize;
use tracktwin_diagnosis::{PreparedRecording, SupportChange};
use tracktwin_signal::recording::Recording;

/// Half width of a 90 % interval in standard deviations.
const NINETY_PER_CENT: f64 = 1.645;

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

/// All changes of the fitted sections of a recording. A change in several sections is taken from the one in which its
/// distance from an end is largest.
pub(crate) fn changes(
    recording: &Recording,
    sections: &[(PreparedRecording, Fitted)],
) -> Vec<Change> {
    let covered = |prepared: &PreparedRecording| {
        prepared.first_sleeper..prepared.first_sleeper + prepared.forward.section.sleepers
    };
    let mut placed = Vec::new();
    for (number, (prepared, fitted)) in sections.iter().enumerate() {
        for (&change, amplitude) in fitted.unknowns.support_changes.iter().zip(&fitted.changes) {
            let (before, after) = change.neighbours();
            let middle = prepared.first_sleeper + usize::midpoint(before, after);
            let from_end = |(other, _): &(PreparedRecording, Fitted)| {
                let range = covered(other);
                range.contains(&middle).then(|| (middle - range.start).min(range.end - 1 - middle))
            };
            let farthest = (0..sections.len()).max_by_key(|&other| from_end(&sections[other]));
            if farthest == Some(number) {
                placed.push((middle, Change::new(recording, prepared, change, *amplitude)));
            }
        }
    }
    placed.sort_by_key(|(middle, _)| *middle);
    placed.into_iter().map(|(_, change)| change).collect()
}

impl Change {
    fn new(
        recording: &Recording,
        prepared: &PreparedRecording,
        change: SupportChange,
        Amplitude { log, deviation, probability }: Amplitude,
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
        let id = |sleeper: usize| recording.sleepers[prepared.first_sleeper + sleeper].id.clone();
        let end = |way: f64| (log + way * NINETY_PER_CENT * deviation).exp_m1();
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
                format!("changes by {change} % from {first} to {last} and stays so")
            }
            ChangeKind::SoftSpot | ChangeKind::StiffSpot => {
                format!("from {first} to {last} differs by {change} % from that on both sides")
            }
        };
        format!(
            "The ballast stiffness {where_to} (90 % interval {lower} to {upper} %): a {form}, {sure:.0} % probable."
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
                        to -39 %): a soft spot, 90 % probable.";
        assert_eq!(change.sentence(), expected);
    }
}
