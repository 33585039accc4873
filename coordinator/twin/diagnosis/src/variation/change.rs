//! Support changes that a recording shows: transitions, and soft or stiff spots.

use super::SupportChange;
use crate::baseline::Unknowns;
use crate::section::owner;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::ops::Range;
use tracktwin_number::NORMAL_90;

/// Error of a sleeper's ballast stiffness in addition to its posterior, as a share of the variation along the track. It
/// covers the difference between model and reality; measured with `tracktwin coverage --method inversion` on recordings
/// of two simulators.
pub const BALLAST_ERROR: f64 = 0.35;

/// Change of the logarithm of the ballast stiffness by a support change: a transition's stiffness behind it minus
/// before it, a spot's stiffness minus that on both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amplitude {
    /// Posterior mean.
    pub log: f64,
    /// Posterior standard deviation.
    pub deviation: f64,
    /// Probability that there is a change and not only variation between sleepers.
    pub probability: f64,
}

impl Amplitude {
    /// Amplitude of each support change of `unknowns`, in their order; [`super::learn_variation`] returns
    /// `probabilities` in the same order. `values` and `covariance` are the posterior of all unknowns or of more
    /// parameters behind them, as natural logarithms.
    pub fn all(
        unknowns: &Unknowns,
        probabilities: &[f64],
        values: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> Vec<Self> {
        let known = &unknowns.support_changes;
        let (ballast, variation) = (unknowns.ballast(), unknowns.variation[0]);
        let error = BALLAST_ERROR * variation.smooth.hypot(variation.independent);
        let of = |(&change, &probability): (&SupportChange, &f64)| {
            let others: Vec<_> = known.iter().copied().filter(|other| *other != change).collect();
            let contrast = change.contrast(ballast.len(), &others);
            let stiffness = values.rows(ballast.start, ballast.len());
            let within =
                covariance.view((ballast.start, ballast.start), (ballast.len(), ballast.len()));
            let variance =
                contrast.dot(&(within * &contrast)) + error.powi(2) * contrast.norm_squared();
            Self { log: contrast.dot(&stiffness), deviation: variance.sqrt(), probability }
        };
        known.iter().zip(probabilities).map(of).collect()
    }
}

/// A change of the ballast stiffness along the track that is more than its variation between sleepers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundSupportChange {
    /// Form of the change.
    pub kind: SupportChangeKind,
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

/// Form of a support change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SupportChangeKind {
    /// The stiffness changes and keeps its new value.
    Transition,
    /// A run of sleepers on softer support than those on both sides.
    SoftSpot,
    /// A run of sleepers on stiffer support than those on both sides.
    StiffSpot,
}

impl SupportChangeKind {
    /// The form in words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Transition => "transition",
            Self::SoftSpot => "soft spot",
            Self::StiffSpot => "stiff spot",
        }
    }
}

impl FoundSupportChange {
    /// The change with the ids of its sleepers.
    pub fn new(
        change: SupportChange,
        Amplitude { log, deviation, probability }: Amplitude,
        id: impl Fn(usize) -> String,
    ) -> Self {
        let (kind, ends) = match change {
            SupportChange::Transition { before, after } => {
                (SupportChangeKind::Transition, [before, after])
            }
            SupportChange::Spot { first, last } if log < 0.0 => {
                (SupportChangeKind::SoftSpot, [first, last])
            }
            SupportChange::Spot { first, last } => (SupportChangeKind::StiffSpot, [first, last]),
        };
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
        let form = self.kind.name();
        let where_to = match self.kind {
            SupportChangeKind::Transition => {
                format!("changes by {change} % from {first} to {last}")
            }
            SupportChangeKind::SoftSpot | SupportChangeKind::StiffSpot => {
                format!("from {first} to {last} differs by {change} % from that on both sides")
            }
        };
        format!(
            "The ballast stiffness {where_to} (90 % interval {lower} to {upper} %). With a probability of {sure:.0} % this is \
             more than its variation between sleepers, most likely a {form}."
        )
    }

    /// The change in a few words.
    pub fn summary(&self) -> String {
        let [first, last] = &self.sleepers;
        let (change, sure) = (100.0 * self.change, 100.0 * self.probability);
        format!(
            "{} from {first} to {last}, {change:+.0} % (probability {sure:.0} %)",
            self.kind.name()
        )
    }
}

/// Joins the support changes of overlapping sections, each with its range of indices in `ids`, the ids of all sleepers,
/// into those of the track, in its order. Changes at sleepers that are not in `ids` are left out.
///
/// Of changes in two sections that overlap, a spot is kept rather than a transition, of which a section shows one end;
/// otherwise that of the section in which it lies farther from the ends. A change that a single section found is kept
/// if its middle belongs to that section.
pub fn joined_support_changes(
    ids: &[String],
    sections: &[(Range<usize>, &[FoundSupportChange])],
) -> Vec<FoundSupportChange> {
    let ranges: Vec<_> = sections.iter().map(|(range, _)| range.clone()).collect();
    let mut all = Vec::new();
    for (section, (_, changes)) in sections.iter().enumerate() {
        all.extend(changes.iter().filter_map(|change| OfSection::new(section, change, ids)));
    }
    all.sort_by_key(|it| Reverse(it.rank(&ranges)));
    let is_stated = |it: &OfSection<'_>, kept: &[&OfSection<'_>]| {
        let is_alone = !all.iter().any(|other| it.is_same(other));
        let is_own = owner(&ranges, it.middle()) == Some(it.section);
        !kept.iter().any(|kept| it.is_same(kept)) && (is_own || !is_alone)
    };
    let mut kept: Vec<&OfSection<'_>> = Vec::new();
    for found in &all {
        if is_stated(found, &kept) {
            kept.push(found);
        }
    }
    kept.sort_by_key(|it| it.middle());
    kept.into_iter().map(|it| it.change.clone()).collect()
}

/// A change that a section found.
struct OfSection<'a> {
    section: usize,
    change: &'a FoundSupportChange,
    /// Indices in the recording of the last sleeper before the change and of the first one behind it.
    neighbours: (usize, usize),
}

impl<'a> OfSection<'a> {
    /// `None` if a sleeper is not in the recording.
    fn new(section: usize, change: &'a FoundSupportChange, ids: &[String]) -> Option<Self> {
        let index = |id: &String| ids.iter().position(|known| known == id);
        let [first, last] = [index(&change.sleepers[0])?, index(&change.sleepers[1])?];
        let change_of = match change.kind {
            SupportChangeKind::Transition => {
                SupportChange::Transition { before: first, after: last }
            }
            SupportChangeKind::SoftSpot | SupportChangeKind::StiffSpot => {
                SupportChange::Spot { first, last }
            }
        };
        Some(Self { section, change, neighbours: change_of.neighbours() })
    }

    fn middle(&self) -> usize {
        let (before, after) = self.neighbours;
        usize::midpoint(before, after)
    }

    /// The higher of two ranks belongs to the better description.
    fn rank(&self, sections: &[Range<usize>]) -> (bool, usize, Reverse<usize>) {
        let Range { start, end } = sections[self.section];
        let is_spot = self.change.kind != SupportChangeKind::Transition;
        (is_spot, (self.middle() - start).min(end - 1 - self.middle()), Reverse(self.section))
    }

    /// Whether another section found the same change: they overlap.
    fn is_same(&self, other: &Self) -> bool {
        let ((before, after), (other_before, other_after)) = (self.neighbours, other.neighbours);
        self.section != other.section && before <= other_after && other_before <= after
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_tells_place_size_and_probability() {
        let change = FoundSupportChange {
            kind: SupportChangeKind::SoftSpot,
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
    fn stated(found: &[(usize, SupportChange)]) -> Vec<FoundSupportChange> {
        let ids: Vec<String> = (0..44).map(|sleeper| format!("SN{sleeper}")).collect();
        let of = |number| {
            let own = found.iter().filter(|(section, _)| *section == number);
            own.map(|(_, change)| recorded(*change)).collect::<Vec<_>>()
        };
        let (first, second) = (of(0), of(1));
        joined_support_changes(&ids, &[(0..26, &first), (18..44, &second)])
    }

    fn recorded(change: SupportChange) -> FoundSupportChange {
        let amplitude = Amplitude { log: 0.5, deviation: 0.1, probability: 0.9 };
        FoundSupportChange::new(change, amplitude, |sleeper| format!("SN{sleeper}"))
    }

    #[test]
    fn a_change_in_two_sections_is_stated_once() {
        let step = |before| SupportChange::Transition { before, after: before + 1 };
        let spot = SupportChange::Spot { first: 20, last: 27 };
        // The first section does not see the end of the spot.
        assert_eq!(stated(&[(0, step(19)), (1, spot)]), [recorded(spot)]);
        // Both sections see it, and differ by a sleeper where the middle between them lies.
        assert_eq!(stated(&[(0, step(22)), (1, step(21))]), [recorded(step(22))]);
        assert_eq!(stated(&[(0, step(21)), (1, step(22))]), [recorded(step(21))]);
        // The long one is given up for the first step, which is no reason to give up the second one, too.
        let long = SupportChange::Transition { before: 20, after: 24 };
        assert_eq!(
            stated(&[(0, step(20)), (0, step(23)), (1, long)]),
            [recorded(step(20)), recorded(step(23))]
        );
        // The second section lies deeper around it and does not see it.
        assert_eq!(stated(&[(0, step(23))]), []);
        assert_eq!(
            stated(&[(0, step(10)), (1, step(30))]),
            [recorded(step(10)), recorded(step(30))]
        );
    }
}
