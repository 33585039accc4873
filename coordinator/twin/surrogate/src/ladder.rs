//! Search for hyper-parameters on a grid (ladder), which lets parameters share a factorisation.
//!
//! The likelihood is flat near its maximum and decreases along a ridge: a longer length with a larger
//! signal variance fits nearly as well. A fixed step therefore loses little, the search needs bounds, and a
//! factor computed for one parameter often serves another.

use crate::{Error, Hyperparameters};
use std::collections::BTreeMap;

/// Two sets of hyper-parameters count as equally good if their log-likelihoods differ by at most this: half
/// the 95 % quantile of chi-squared with two degrees of freedom (likelihood-ratio test).
const INDISTINGUISHABLE: f64 = 3.0;

/// A point of the ladder, `[length, noise]`.
pub(crate) type Rung = [i32; 2];

/// Rungs of the length, half an octave each: from a quarter of the unit to 64 units.
const LENGTH_RUNGS: std::ops::RangeInclusive<i32> = -4..=12;
/// Rungs of the noise ratio, an octave each, from 6e-5 (inputs' own noise dominates) to 16 (no
/// information).
const NOISE_RUNGS: std::ops::RangeInclusive<i32> = -14..=4;

/// Conversion of rungs to hyper-parameters; `unit` is a typical distance.
#[derive(Clone, Copy)]
pub(crate) struct Ladder {
    pub(crate) unit: f64,
}

impl Ladder {
    pub(crate) fn at(self, [length, noise]: Rung) -> Hyperparameters {
        Hyperparameters {
            length: self.unit * (0.5 * f64::from(length)).exp2(),
            noise_ratio: f64::from(noise).exp2(),
        }
    }
}

/// Log-likelihoods of every target at every evaluated rung.
#[derive(Default)]
pub(crate) struct Tried(BTreeMap<Rung, Vec<f64>>);

impl Tried {
    /// Climbs for every target from `starts` until no neighbour at a distance of `stride` rungs has a
    /// higher likelihood.
    ///
    /// All targets share the evaluated rungs. The ladder is finite; the climb therefore ends.
    pub(crate) fn climb(
        &mut self,
        starts: &[Rung],
        stride: i32,
        evaluate: &mut dyn FnMut(Rung) -> Result<Vec<f64>, Error>,
    ) -> Result<(), Error> {
        let mut wanted: Vec<Rung> = starts.to_vec();
        loop {
            wanted.sort_unstable();
            wanted.dedup();
            wanted.retain(|rung| !self.0.contains_key(rung));
            if wanted.is_empty() {
                return Ok(());
            }
            for &rung in &wanted {
                self.0.insert(rung, evaluate(rung)?);
            }
            wanted = self.best().into_iter().flat_map(|rung| neighbours(rung, stride)).collect();
        }
    }

    /// The rung with the highest likelihood of every target.
    pub(crate) fn best(&self) -> Vec<Rung> {
        (0..self.targets()).map(|target| self.best_of(target).0).collect()
    }

    /// A rung for every target that is as good as its best rung. A greedy choice keeps the number of
    /// distinct rungs small.
    pub(crate) fn shared(&self) -> Vec<Rung> {
        let mut chosen = self.best();
        let mut open: Vec<usize> = (0..self.targets()).collect();
        while !open.is_empty() {
            let serves = |rung: &Rung| -> Vec<usize> {
                open.iter().copied().filter(|&target| self.is_good(target, *rung)).collect()
            };
            // The first of equals, so that the choice does not depend on chance.
            let Some(rung) = self.0.keys().rev().max_by_key(|rung| serves(rung).len()).copied()
            else {
                break;
            };
            let served = serves(&rung);
            for &target in &served {
                chosen[target] = rung;
            }
            open.retain(|target| !served.contains(target));
        }
        chosen
    }

    fn is_good(&self, target: usize, rung: Rung) -> bool {
        self.0[&rung][target] >= self.best_of(target).1 - INDISTINGUISHABLE
    }

    fn targets(&self) -> usize {
        self.0.values().next().map_or(0, Vec::len)
    }

    fn best_of(&self, target: usize) -> (Rung, f64) {
        self.0
            .iter()
            .map(|(&rung, likelihoods)| (rung, likelihoods[target]))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("something was tried")
    }
}

fn neighbours([length, noise]: Rung, stride: i32) -> impl Iterator<Item = Rung> {
    [[-stride, 0], [stride, 0], [0, -stride], [0, stride]]
        .into_iter()
        .map(move |[dl, dn]| [length + dl, noise + dn])
        .filter(|[l, n]| LENGTH_RUNGS.contains(l) && NOISE_RUNGS.contains(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hill(top: Rung, rung: Rung) -> f64 {
        -f64::from((rung[0] - top[0]).pow(2) + (rung[1] - top[1]).pow(2))
    }

    #[test]
    fn every_target_climbs_to_its_own_top() {
        let tops = [[3, -5], [8, 1]];
        let mut evaluations = 0;
        let mut tried = Tried::default();
        tried
            .climb(&[[0, 0]], 1, &mut |rung| {
                evaluations += 1;
                Ok(tops.iter().map(|&top| hill(top, rung)).collect())
            })
            .unwrap();
        assert_eq!(tried.best(), tops);
        assert!(evaluations < 100, "{evaluations} of 323 rungs");
    }

    #[test]
    fn targets_with_tops_close_by_share_a_rung() {
        let tops = [[3, -5], [4, -5], [10, 2]];
        let mut tried = Tried::default();
        tried
            .climb(&tops, 1, &mut |rung| Ok(tops.iter().map(|&top| hill(top, rung)).collect()))
            .unwrap();
        let shared = tried.shared();
        assert_eq!(shared[0], shared[1]);
        assert_ne!(shared[0], shared[2]);
    }

    #[test]
    fn the_climb_stays_on_the_ladder() {
        let mut tried = Tried::default();
        tried.climb(&[[0, 0]], 1, &mut |[l, n]| Ok(vec![f64::from(l - n)])).unwrap();
        assert_eq!(tried.best(), [[12, -14]]);
    }
}
