//! How the parameters of sleepers vary along the track.

mod change;
mod learn;
mod quadratic;
mod railpad_damping;

pub use change::{
    Amplitude, BALLAST_ERROR, FoundSupportChange, SupportChangeKind, joined_support_changes,
};
pub use learn::{EXCEPTION_NATS, expect_variation, learn_variation};
pub use quadratic::Quadratic;
pub use railpad_damping::learn_railpad_damping;

use crate::quantity::Own;
use nalgebra::DVector;
use std::ops::Range;

/// Smallest number of sleepers on either side of a change.
const BESIDE: usize = 2;

/// Largest number of sleepers on one side that a change is measured from.
const COMPARED: usize = 4;

/// Numbers of spacings over which a transition extends; one is a step between two sleepers.
const TRANSITIONS: [usize; 4] = [1, 2, 4, 8];

/// Smallest and largest number of sleepers of a spot; a single sleeper is an exception.
const SPOT: [usize; 2] = [2, 12];

/// Variation of the logarithm of a quantity along the track, about its mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// Standard deviation of the smooth part.
    pub smooth: f64,
    /// Length of the smooth part's Gaussian correlation, in sleepers.
    pub length: f64,
    /// Standard deviation of the part that is independent from sleeper to sleeper.
    pub independent: f64,
}

/// A sleeper at which one quantity is far from that of its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exception {
    /// The quantity.
    pub field: Own,
    /// Index of the sleeper among the compared ones.
    pub sleeper: usize,
}

/// A change of the ballast stiffness that is not part of its random variation between sleepers. Sleepers are
/// indices among the compared ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SupportChange {
    /// The logarithm of the stiffness changes linearly between two sleepers and keeps its new value.
    Transition {
        /// Last sleeper before the change.
        before: usize,
        /// First sleeper behind the change.
        after: usize,
    },
    /// The sleepers of a run differ from those on both sides.
    Spot {
        /// First sleeper of the run.
        first: usize,
        /// Last sleeper of the run.
        last: usize,
    },
}

impl SupportChange {
    /// All changes that a section with this number of sleepers can show.
    pub fn all(sleepers: usize) -> impl Iterator<Item = Self> {
        let transition = |before| {
            TRANSITIONS.map(|spacings| Self::Transition { before, after: before + spacings })
        };
        let spot = |first| {
            let [fewest, most] = SPOT;
            (fewest..=most).map(move |count| Self::Spot { first, last: first + count - 1 })
        };
        let all = (0..sleepers).flat_map(move |it| transition(it).into_iter().chain(spot(it)));
        all.filter(move |change| {
            let (before, after) = change.neighbours();
            before + 1 >= BESIDE && after + BESIDE <= sleepers
        })
    }

    /// The last sleeper before the change and the first one behind it.
    pub fn neighbours(self) -> (usize, usize) {
        match self {
            Self::Transition { before, after } => (before, after),
            Self::Spot { first, last } => (first.saturating_sub(1), last + 1),
        }
    }

    /// Weights of the sleepers' logarithms whose sum is the change: the sleepers behind a transition against those
    /// before it, those of a spot against those on both sides. Compared are at most four on a side, as far as the next
    /// one of `others`.
    pub fn contrast(self, sleepers: usize, others: &[Self]) -> DVector<f64> {
        let mut contrast = DVector::zeros(sleepers);
        let mut add = |range: Range<usize>, weight: f64| {
            let share = weight / range.len() as f64;
            range.for_each(|sleeper| contrast[sleeper] += share);
        };
        let (before, after) = self.neighbours();
        let behind_others = others.iter().map(|it| it.neighbours().1).filter(|&it| it <= before);
        let before_others = others.iter().map(|it| it.neighbours().0 + 1).filter(|&it| it > after);
        let from = behind_others.fold((before + 1).saturating_sub(COMPARED), usize::max);
        let to = before_others.fold((after + COMPARED).min(sleepers), usize::min);
        match self {
            Self::Transition { .. } => {
                add(from..before + 1, -1.0);
                add(after..to, 1.0);
            }
            Self::Spot { first, last } => {
                add(from..before + 1, -0.5);
                add(first..last + 1, 1.0);
                add(after..to, -0.5);
            }
        }
        contrast
    }

    /// The change at a sleeper, as a share of the whole change. The shares of a transition are -0.5 before it and
    /// 0.5 behind it.
    pub fn share(self, sleeper: usize) -> f64 {
        match self {
            Self::Transition { before, after } => {
                let done = (sleeper as f64 - before as f64) / (after - before) as f64;
                done.clamp(0.0, 1.0) - 0.5
            }
            Self::Spot { first, last } => f64::from(u8::from((first..=last).contains(&sleeper))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_a_change_is_not_that_of_the_next_one() {
        let step = SupportChange::Transition { before: 11, after: 12 };
        let spot = SupportChange::Spot { first: 14, last: 15 };
        let track = DVector::from_fn(24, |it, _| 0.6 * step.share(it) - 0.4 * spot.share(it));
        assert!((step.contrast(24, &[spot]).dot(&track) - 0.6).abs() < 1e-12);
        assert!((spot.contrast(24, &[step]).dot(&track) + 0.4).abs() < 1e-12);
        // Alone it is compared with four sleepers on each side.
        let alone = step.contrast(24, &[]);
        assert_eq!(alone.iter().filter(|weight| **weight != 0.0).count(), 8);
        assert!((alone.dot(&track) - 0.4).abs() < 1e-12);
    }
}
