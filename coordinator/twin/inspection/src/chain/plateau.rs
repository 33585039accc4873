//! Plateaus: crests of a pass that stay at one level, because of clipping or of contact loss.

use crate::along::{bonferroni, ln_binomial_tail};
use std::ops::Range;

/// Half the thickness of the layer about a level, as a share of the level; a crest inside the layer counts
/// as at the level.
const LAYER: f64 = 0.03;
/// Height of a crest's foot below the level, as a share of the level.
const FOOT: f64 = 0.1;
/// Smallest share of its time above the foot that a flat crest is inside the layer. A parabola that reaches
/// the level is inside the layer for the square root of 0.03 / 0.1, which is 0.55.
const FLAT: f64 = 0.75;
/// Smallest number of samples of a flat crest.
const SAMPLES_MIN: usize = 4;
/// Number of cells of the histogram from which a level is determined, and its start as a share of the
/// greatest value.
const CELLS: usize = 20;
const CELLS_FROM: f64 = 0.8;
/// Probability that a crest which ends in the layer is flat by chance: of 5,838 such crests in the passes of 18
/// independent recordings 0.75 % were.
const FLAT_BY_CHANCE: f64 = 0.01;
/// Smallest share of flat crests among those that end in the layer: what stops a crest stops all. Of a tone in noise 4 % are
/// flat by chance, of contact loss in simulated passes at least half.
const FLAT_SHARE: f64 = 0.25;
/// Number of lowest cells of the histogram that cannot be a level: low values are more frequent than high
/// ones.
const CELLS_LOW: usize = 4;

/// Flat crests of a pass at one level.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plateaus {
    /// The level: mean of the values inside the layer.
    pub(super) level: f64,
    /// Sample range of each crest, from its first to its last sample inside the layer.
    pub(super) crests: Vec<Range<usize>>,
    /// Number of samples of all these crests inside the layer.
    pub(super) samples: usize,
    /// Number of crests that reach the layer, flat or not.
    reaching: usize,
}

impl Plateaus {
    /// The flat crests near a given level.
    pub(super) fn at(values: &[f64], level: f64) -> Self {
        let in_layer = |value: f64| (value - level).abs() <= LAYER * level;
        let mut found = Self { level, crests: Vec::new(), samples: 0, reaching: 0 };
        let (mut sum, mut end) = (0.0, 0);
        while let Some(start) = next(values, end, |value| value >= (1.0 - FOOT) * level) {
            end = next(values, start, |value| value < (1.0 - FOOT) * level).unwrap_or(values.len());
            let crest = &values[start..end];
            let count = crest.iter().filter(|&&value| in_layer(value)).count();
            found.reaching += usize::from(count > 0);
            let is_flat = count >= SAMPLES_MIN && count as f64 >= FLAT * crest.len() as f64;
            let ends = (
                crest.iter().position(|&value| in_layer(value)),
                crest.iter().rposition(|&value| in_layer(value)),
            );
            if let (true, (Some(first), Some(last))) = (is_flat, ends) {
                found.crests.push(start + first..start + last + 1);
                found.samples += count;
                sum += crest.iter().filter(|&&value| in_layer(value)).sum::<f64>();
            }
        }
        if found.samples > 0 {
            found.level = sum / found.samples as f64;
        }
        found
    }

    /// Natural logarithm of the probability of at least this number of flat crests by chance, for a level
    /// that was determined from the same pass.
    pub(super) fn ln_p(&self) -> f64 {
        if (self.crests.len() as f64) < FLAT_SHARE * self.reaching as f64 {
            return 0.0;
        }
        let of_one = ln_binomial_tail(self.crests.len(), self.reaching, FLAT_BY_CHANCE);
        bonferroni(of_one, CELLS)
    }

    /// The flat crests at the level at which the highest values accumulate; `None` if there is no such
    /// level.
    pub(super) fn at_top(values: &[f64]) -> Option<Self> {
        let greatest = values.iter().copied().fold(0.0, f64::max);
        let (from, width) = (CELLS_FROM * greatest, (1.0 - CELLS_FROM) * greatest / CELLS as f64);
        let mut counts = [0_usize; CELLS];
        for value in values.iter().filter(|&&value| value >= from && width > 0.0) {
            counts[(((value - from) / width) as usize).min(CELLS - 1)] += 1;
        }
        let fullest = (0..CELLS).rev().max_by_key(|&cell| counts[cell])?;
        let level = from + (fullest as f64 + 0.5) * width;
        let found = (fullest >= CELLS_LOW).then(|| Self::at(values, level))?;
        (!found.crests.is_empty()).then_some(found)
    }
}

/// The first index, not below `from`, whose value meets the condition.
fn next(values: &[f64], from: usize, is: impl Fn(f64) -> bool) -> Option<usize> {
    let place = values[from..].iter().position(|&value| is(value))?;
    Some(from + place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A wave of rising and falling strength, at most 120 high.
    fn wave() -> Vec<f64> {
        let value = |index: u32| {
            let turn = f64::from(index) / 400.0;
            120.0 * (TAU * turn / 40.0).sin().abs() * (TAU * turn).sin()
        };
        (0..16_000).map(value).collect()
    }

    #[test]
    fn round_crests_are_none_and_cut_ones_are_found_with_their_level() {
        assert_eq!(Plateaus::at_top(&wave()), None);
        let cut: Vec<f64> = wave().into_iter().map(|value| value.min(90.0)).collect();
        let found = Plateaus::at_top(&cut).unwrap();
        assert!((found.level - 90.0).abs() < 0.5, "{found:?}");
        assert!(found.crests.len() > 5, "{found:?}");
        let at_level = cut.iter().filter(|&&value| value == 90.0).count();
        assert!(found.samples.abs_diff(at_level) * 4 < at_level, "{} {at_level}", found.samples);
    }

    #[test]
    fn a_level_that_is_known_needs_one_crest_only() {
        let mut values = wave();
        for value in &mut values {
            *value *= 0.5;
        }
        values[8000..8100].fill(100.0);
        let found = Plateaus::at(&values, 101.0);
        assert_eq!(found.crests.len(), 1);
        assert_eq!(found.crests[0], 8000..8100);
        assert_eq!((found.level, found.samples), (100.0, 100));
        assert!(Plateaus::at(&values, 80.0).crests.is_empty());
    }
}
