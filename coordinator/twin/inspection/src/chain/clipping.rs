//! Clipping: crests that end at one level.

use super::contact::{airborne, is_at_flight_level};
use super::plateau::Plateaus;
use super::standstill::Standstill;
use crate::along::{bonferroni, ln_binomial_tail};
use tracktwin_signal::recording::{Pass, Recording};

/// Thickness of the layer below the greatest value, as a share of it.
const LAYER: f64 = 0.01;

/// Smallest level of flat crests, as a share of the greatest value: only the recorder's noise exceeds the
/// limit of a recorder.
const TOP: f64 = 0.95;

/// A clipped pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Clipping {
    /// Index of the pass.
    pub pass: usize,
    /// Acceleration in m/s2 at the limit.
    pub level_m_s2: f64,
    /// Number of crests within 1 % of the limit, on its side.
    pub crests: usize,
    /// Samples within 1 % of the limit, as a share of all samples.
    pub share: f64,
    /// Natural logarithm of the probability of at least this number of crests without a limit.
    pub ln_p: f64,
}

/// Detects clipped passes, with a false-alarm rate of `alpha` for the recording.
///
/// High crests are rarer than low ones. Without a limit, of the crests in two layers of equal thickness
/// below the greatest value at most half lie in the upper layer, except by chance. The crests of a tone are of one
/// height, too; so half of the upper crests must have equal samples at the top. Also, no crest is
/// constant for longer than the steps of the recorder explain. A side on which the wheel loses contact, or
/// nearly does, is not attributed to the recorder; see [`super::loss_of_contact`].
pub fn clipping(recording: &Recording, alpha: f64) -> Vec<Clipping> {
    let flying = airborne(recording);
    let is_recorder_s = |pass: usize, sign: f64, level: f64| {
        let flies = flying[pass].as_ref().is_some_and(|found| found.sign * sign > 0.0);
        !(flies || sign > 0.0 && is_at_flight_level(recording, level))
    };
    let passes = recording.passes.iter().enumerate();
    let sides = passes.flat_map(|(index, pass)| {
        let both = [1.0, -1.0].map(|sign| (sign, side(index, pass, sign)));
        let kept = both.into_iter().filter(|(sign, it)| is_recorder_s(index, *sign, it.level_m_s2));
        kept.map(|(_, side)| side).collect::<Vec<_>>()
    });
    // Two sides, three tests.
    let tries = 6 * recording.passes.len();
    let cut = sides.map(|side| Clipping { ln_p: bonferroni(side.ln_p, tries), ..side });
    let mut all: Vec<Clipping> = cut.filter(|side| side.ln_p <= alpha.ln()).collect();
    // One entry a pass: the side that is cut more surely.
    all.sort_by(|a, b| a.pass.cmp(&b.pass).then(a.ln_p.total_cmp(&b.ln_p)));
    all.dedup_by_key(|side| side.pass);
    all
}

fn side(index: usize, pass: &Pass, sign: f64) -> Clipping {
    let samples = pass.signal.samples();
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let values: Vec<f64> = samples.iter().map(|sample| sign * (sample - mean)).collect();
    let greatest = values.iter().copied().fold(0.0, f64::max);
    let [upper, lower] = [1.0 - LAYER, 1.0 - 2.0 * LAYER].map(|share| share * greatest);
    // A crest is what lies between two descents below both layers.
    let crests = values.split(|&value| value <= lower).filter(|crest| !crest.is_empty());
    let (tops, others): (Vec<&[f64]>, Vec<&[f64]>) =
        crests.partition(|crest| crest.iter().any(|&value| value > upper));
    let (high, next) = (tops.len(), others.len());
    let level = tops.iter().filter(|crest| is_level(crest, upper, greatest)).count();
    let within = values.iter().filter(|&&value| value > upper).count();
    let ln_thinned = if 2 * level >= high { ln_binomial_tail(high, high + next, 0.5) } else { 0.0 };
    Clipping {
        pass: index,
        level_m_s2: sign * greatest + mean,
        crests: high,
        share: within as f64 / samples.len() as f64,
        ln_p: ln_thinned.min(ln_even(samples, sign)).min(ln_flat(&values, greatest)),
    }
}

/// Whether a crest has equal neighbours above `upper`, or the greatest value of the pass.
fn is_level(crest: &[f64], upper: f64, greatest: f64) -> bool {
    let is_even = |pair: &[f64]| pair[0] > upper && pair[0].total_cmp(&pair[1]).is_eq();
    crest.windows(2).any(is_even) || crest.iter().any(|value| value.total_cmp(&greatest).is_eq())
}

/// `ln P` of flat crests at the greatest value; 0 without flat crests.
fn ln_flat(values: &[f64], greatest: f64) -> f64 {
    let found = Plateaus::at_top(values).filter(|found| found.level >= TOP * greatest);
    found.map_or(0.0, |found| found.ln_p().min(0.0))
}

/// `ln P` of a constant crest at the greatest value, as long as the longest one; 0 without such a crest.
fn ln_even(samples: &[f64], sign: f64) -> f64 {
    let standstill = Standstill::longest(samples);
    if standstill.is_at_limit(samples, sign) { standstill.ln_p.min(0.0) } else { 0.0 }
}
