//! Variation between the sleepers of a recording: the prior's variation, support changes and exceptions that
//! maximise the evidence.

use super::{Exception, Quadratic, SupportChange, Variation};
use crate::baseline::Unknowns;
use crate::quantity::Own;

/// Factors on a deviation or a length that the search tries.
const FACTORS: [f64; 4] = [0.5, 0.75, 1.35, 2.0];

/// Factors on the deviations over which the variance is averaged, in equal steps of the logarithm.
const AVERAGED: [f64; 7] = [0.5, 0.71, 1.0, 1.41, 2.0, 2.83, 4.0];

/// Bounds of deviations (of the logarithm) and of lengths (in sleepers). The error of an odometer alone
/// makes sleepers differ by 1 to 2 %, and no stiffness of a track varies by more than a factor of three
/// about its mean.
const DEVIATION: [f64; 2] = [0.01, 1.0];
const LENGTH: [f64; 2] = [1.5, 12.0];

/// Log-normal prior of deviations and lengths: median of `smooth`, `independent` and `length`, and
/// the standard deviation of their logarithms. Sleepers of ballasted track differ by 5 to 30 %.
const MEDIAN: [f64; 3] = [0.15, 0.12, 3.0];
const SPREAD: [f64; 3] = [0.8, 0.8, 0.5];

/// Largest number of rounds over all deviations and lengths.
const ROUNDS: usize = 6;

/// Increase of the log evidence, in nats, that an exception needs: its prior probability is about one in a
/// hundred sleepers.
pub const EXCEPTION_NATS: f64 = 5.0;

/// Largest number of exceptions in one quantity, as a share of all sleepers.
const EXCEPTIONS_MAX: f64 = 0.2;

/// Prior odds of a support change in a section.
const CHANGE_ODDS: f64 = 1.0;

/// Nothing is more probable than this, because the models of the variation are not exact.
const PROBABILITY_MAX: f64 = 0.97;

/// Largest number of support changes in a section.
const CHANGES_MAX: usize = 4;

/// Log evidence of a prior in nats, including the prior of its variation, up to a constant of the data.
fn log_evidence(data: &Quadratic, unknowns: &Unknowns) -> f64 {
    data.log_evidence(unknowns) + unknowns.variation.iter().map(log_prior).sum::<f64>()
}

/// Log density of a variation, up to a constant.
fn log_prior(variation: &Variation) -> f64 {
    let Variation { smooth, length, independent } = *variation;
    let of = |(value, (median, spread)): (f64, (f64, f64))| {
        -0.5 * ((value / median).ln() / spread).powi(2)
    };
    [smooth, independent, length].into_iter().zip(MEDIAN.into_iter().zip(SPREAD)).map(of).sum()
}

/// Sets the variation, the support changes and the exceptions of `unknowns` to the values with the greatest
/// evidence; those that it has are forgotten. Returns the probability of each support change (0.5 to 0.97), in the order
/// of `unknowns.support_changes`.
pub fn learn_variation(unknowns: &mut Unknowns, data: &Quadratic) -> Vec<f64> {
    unknowns.exceptions.clear();
    unknowns.support_changes.clear();
    vary(unknowns, data);
    while let Some(more) = with_one_more(unknowns, data) {
        *unknowns = more;
    }
    keep_probable(unknowns, data)
}

/// The unknowns with one more support change or exception, whichever is more probable, if one is probable enough.
fn with_one_more(unknowns: &Unknowns, data: &Quadratic) -> Option<Unknowns> {
    let tried = [with_change(unknowns, data), with_exception(unknowns, data)].into_iter().flatten();
    let best = tried.max_by(|(one, _), (other, _)| one.total_cmp(other));
    best.filter(|(log_odds, _)| *log_odds > 0.0).map(|(_, with)| with)
}

/// The unknowns with the most probable support change, and the logarithm of its odds. With it the rest of the track is
/// more even, so that the variation is estimated again.
fn with_change(unknowns: &Unknowns, data: &Quadratic) -> Option<(f64, Unknowns)> {
    let (_, change) = change(unknowns, data)?;
    let mut with = unknowns.clone();
    with.support_changes.push(change);
    vary(&mut with, data);
    Some((log_odds(&with, unknowns.support_changes.len(), data), with))
}

/// As [`with_change`], with the most probable exception.
fn with_exception(unknowns: &Unknowns, data: &Quadratic) -> Option<(f64, Unknowns)> {
    let mut with = unknowns.clone();
    with.exceptions.push(exception(unknowns, data)?);
    vary(&mut with, data);
    let gain = log_evidence(data, &with) - log_evidence(data, unknowns);
    Some((gain - EXCEPTION_NATS, with))
}

/// Removes the support changes that the later ones made improbable. Returns the probabilities of the others.
fn keep_probable(unknowns: &mut Unknowns, data: &Quadratic) -> Vec<f64> {
    loop {
        let count = unknowns.support_changes.len();
        let all: Vec<f64> = (0..count).map(|index| log_odds(unknowns, index, data)).collect();
        let least = (0..count).min_by(|&one, &other| all[one].total_cmp(&all[other]));
        let Some(index) = least.filter(|&index| all[index] <= 0.0) else {
            let probability = |log_odds: f64| 1.0 / (1.0 + (-log_odds).exp());
            return all.into_iter().map(|it| probability(it).min(PROBABILITY_MAX)).collect();
        };
        unknowns.support_changes.remove(index);
        vary(unknowns, data);
    }
}

/// Logarithm of the posterior odds of the support change with this index, wherever it is and whatever its form,
/// against its absence. Without it the rest of the track varies more.
fn log_odds(unknowns: &Unknowns, index: usize, data: &Quadratic) -> f64 {
    let mut without = unknowns.clone();
    let known = without.support_changes.remove(index);
    vary(&mut without, data);
    let Some((log_odds, _)) = change(&without, data) else { return f64::NEG_INFINITY };
    let mut with = without;
    with.support_changes.push(known);
    log_odds + log_evidence(data, unknowns) - log_evidence(data, &with)
}

/// Changes one deviation or length after the other while the evidence rises.
fn vary(unknowns: &mut Unknowns, data: &Quadratic) {
    let mut best = log_evidence(data, unknowns);
    for _ in 0..ROUNDS {
        let before = best;
        for field in Own::ALL {
            for which in 0..3 {
                for factor in FACTORS {
                    let mut tried = unknowns.clone();
                    scale(&mut tried.variation[field as usize], which, factor);
                    let evidence = log_evidence(data, &tried);
                    if evidence > best {
                        best = evidence;
                        unknowns.variation = tried.variation;
                    }
                }
            }
        }
        if best - before < 0.1 {
            break;
        }
    }
}

/// Multiplies the deviations of each quantity by the root mean square of seven factors (0.5 to 4), weighted by the
/// evidence.
///
/// Few sleepers do not tell how much they differ. The variation with the greatest evidence is then often too small,
/// and with it the uncertainty of each sleeper. The mean of the variance is what a prediction needs.
pub fn expect_variation(unknowns: &mut Unknowns, data: &Quadratic) {
    for field in Own::ALL {
        let scaled = |factor: f64| {
            let mut scaled = unknowns.clone();
            let variation = &mut scaled.variation[field as usize];
            (0..2).for_each(|which| scale(variation, which, factor));
            scaled
        };
        let evidence = AVERAGED.map(|factor| log_evidence(data, &scaled(factor)));
        let highest = evidence.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let weights = evidence.map(|it| (it - highest).exp());
        let squares = weights.iter().zip(AVERAGED).map(|(weight, factor)| weight * factor * factor);
        let factor = (squares.sum::<f64>() / weights.iter().sum::<f64>()).sqrt();
        unknowns.variation = scaled(factor).variation;
    }
}

fn scale(variation: &mut Variation, which: usize, factor: f64) {
    let [low, high] = if which == 2 { LENGTH } else { DEVIATION };
    let value = match which {
        0 => &mut variation.smooth,
        1 => &mut variation.independent,
        _ => &mut variation.length,
    };
    *value = (*value * factor).clamp(low, high);
}

/// The support change with the greatest evidence, and the logarithm of the odds that there is one anywhere, if the
/// variation stays the same. `None` if there is no room for another one.
fn change(unknowns: &Unknowns, data: &Quadratic) -> Option<(f64, SupportChange)> {
    let known = &unknowns.support_changes;
    if known.len() == CHANGES_MAX {
        return None;
    }
    let all = SupportChange::all(unknowns.ballast().len()).filter(|change| !known.contains(change));
    let changes: Vec<SupportChange> = all.collect();
    let directions: Vec<_> = changes.iter().map(|&it| unknowns.along_change(it)).collect();
    let gains = data.gains(unknowns, &directions)?;
    let (highest, &change) = greatest(&gains, &changes)?;
    // Places and lengths are equally probable.
    let all: f64 =
        gains.iter().map(|gain| (gain - highest).exp()).sum::<f64>() / changes.len() as f64;
    Some((highest + (CHANGE_ODDS * all).ln(), change))
}

/// The exception with the greatest evidence. `None` if there is no room for another one.
fn exception(unknowns: &Unknowns, data: &Quadratic) -> Option<Exception> {
    let known = &unknowns.exceptions;
    let sleepers = unknowns.ballast().len();
    let most = (EXCEPTIONS_MAX * sleepers as f64).ceil() as usize;
    let room = |field: Own| known.iter().filter(|known| known.field == field).count() < most;
    let fields = Own::ALL.into_iter().filter(|&field| room(field));
    let all = fields.flat_map(|field| (0..sleepers).map(move |it| (field, it)));
    let all = all.map(|(field, sleeper)| Exception { field, sleeper });
    let new: Vec<Exception> = all.filter(|exception| !known.contains(exception)).collect();
    let directions: Vec<_> = new.iter().map(|&it| unknowns.along_exception(it)).collect();
    let gains = data.gains(unknowns, &directions)?;
    greatest(&gains, &new).map(|(_, &exception)| exception)
}

/// The greatest gain and what it belongs to.
fn greatest<'a, T>(gains: &[f64], all: &'a [T]) -> Option<(f64, &'a T)> {
    gains.iter().copied().zip(all).max_by(|one, other| one.0.total_cmp(&other.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::forward::Forward;
    use crate::section::Section;
    use nalgebra::{DMatrix, DVector};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use tracktwin_parameters::TrackDesign;

    const SLEEPERS: usize = 24;

    fn unknowns() -> Unknowns {
        let section = Section::new(TrackDesign::v_track(), SLEEPERS, 1.0);
        Forward::new(section, Bands::new(200.0, 800.0), &[13.0], vec![0.0]).unknowns
    }

    /// Ballast measured with a deviation of 3 % at every sleeper: `scatter` is its own, and one sleeper
    /// is softer by a factor.
    fn measured(unknowns: &Unknowns, scatter: f64, soft: Option<(usize, f64)>) -> Quadratic {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut information = DMatrix::zeros(unknowns.count(), unknowns.count());
        let mut slope = DVector::zeros(unknowns.count());
        for (sleeper, index) in unknowns.ballast().enumerate() {
            let normal: f64 = StandardNormal.sample(&mut random);
            let softer = soft.filter(|(at, _)| *at == sleeper).map_or(0.0, |(_, by)| by);
            information[(index, index)] = 0.03f64.powi(-2);
            slope[index] = (scatter * normal - softer) / 0.03f64.powi(2);
        }
        Quadratic { information, slope, mean: unknowns.typical() }
    }

    #[test]
    fn the_scatter_of_a_track_is_learned_from_its_sleepers() {
        for scatter in [0.05, 0.15, 0.3] {
            let mut unknowns = unknowns();
            let data = measured(&unknowns, scatter, None);
            learn_variation(&mut unknowns, &data);
            let Variation { smooth, independent, .. } = unknowns.variation[0];
            let learned = smooth.hypot(independent);
            // Twenty-four values know a deviation to 15 %; the prior's median adds its own pull.
            assert!((0.6..1.7).contains(&(learned / scatter)), "{scatter}: {learned}");
            assert!(unknowns.exceptions.is_empty());
        }
    }

    /// Ballast measured with a deviation of 5 % at every sleeper, whose logarithm is given.
    fn measured_as(unknowns: &Unknowns, logarithm: impl Fn(usize) -> f64) -> Quadratic {
        let mut information = DMatrix::zeros(unknowns.count(), unknowns.count());
        let mut slope = DVector::zeros(unknowns.count());
        for (sleeper, index) in unknowns.ballast().enumerate() {
            information[(index, index)] = 0.05f64.powi(-2);
            slope[index] = logarithm(sleeper) / 0.05f64.powi(2);
        }
        Quadratic { information, slope, mean: unknowns.typical() }
    }

    #[test]
    fn the_less_is_known_the_more_variation_is_expected() {
        let rise = |information: f64| {
            let mut unknowns = unknowns();
            let mut data = measured(&unknowns, 0.1, None);
            data.information *= information;
            data.slope *= information;
            learn_variation(&mut unknowns, &data);
            let learned = unknowns.variation[0];
            expect_variation(&mut unknowns, &data);
            let expected = unknowns.variation[0];
            expected.smooth.hypot(expected.independent) / learned.smooth.hypot(learned.independent)
        };
        let (known, hardly_known) = (rise(1.0), rise(1e-4));
        assert!(known < 1.2 && hardly_known > 1.3, "{known} {hardly_known}");
    }

    /// Variation along a track with a Gaussian correlation of `length` sleepers.
    fn varied(deviation: f64, length: f64, seed: u64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let white: Vec<f64> =
            (0..3 * SLEEPERS).map(|_| StandardNormal.sample(&mut random)).collect();
        let at = |sleeper: usize| {
            let weight = |other: usize| {
                let distance = (other as f64 - (sleeper + SLEEPERS) as f64) / length;
                (-distance.powi(2)).exp()
            };
            let sum: f64 = (0..white.len()).map(|it| weight(it) * white[it]).sum();
            let power: f64 = (0..white.len()).map(|it| weight(it).powi(2)).sum();
            deviation * sum / power.sqrt()
        };
        (0..SLEEPERS).map(at).collect()
    }

    #[test]
    fn a_step_and_a_soft_spot_are_found_at_their_places_beside_random_variation() {
        let spot = SupportChange::Spot { first: 9, last: 14 };
        let step = SupportChange::Transition { before: 11, after: 12 };
        for change in [spot, step] {
            let mut found = 0;
            for seed in 0..10 {
                let mut unknowns = unknowns();
                let varied = varied(0.08, 0.6, seed);
                let data = measured_as(&unknowns, |it| varied[it] - 0.6 * change.share(it));
                learn_variation(&mut unknowns, &data);
                found += usize::from(unknowns.support_changes.contains(&change));
            }
            assert!(found >= 8, "{change:?}: {found} of 10");
        }
    }

    #[test]
    fn correlated_variation_is_rarely_a_change() {
        let mut found = 0;
        for (deviation, length) in [(0.1, 0.6), (0.15, 3.0), (0.3, 5.0)] {
            for seed in 0..20 {
                let mut unknowns = unknowns();
                let varied = varied(deviation, length, 100 + seed);
                let data = measured_as(&unknowns, |it| varied[it]);
                learn_variation(&mut unknowns, &data);
                found += usize::from(!unknowns.support_changes.is_empty());
            }
        }
        assert!(found <= 4, "{found} of 60");
    }

    #[test]
    fn an_exception_is_no_evidence_of_a_change_and_hides_none() {
        let step = SupportChange::Transition { before: 11, after: 12 };
        let (mut found, mut false_alarms) = (0, 0);
        for seed in 0..10 {
            for size in [0.0, 0.6] {
                let mut unknowns = unknowns();
                let varied = varied(0.08, 0.6, seed);
                let soft = |it| if it == 5 { -1.2 } else { 0.0 };
                let data =
                    measured_as(&unknowns, |it| varied[it] + soft(it) - size * step.share(it));
                let probabilities = learn_variation(&mut unknowns, &data);
                assert_eq!(probabilities.len(), unknowns.support_changes.len());
                assert!(probabilities.iter().all(|it| (0.5..=0.97).contains(it)));
                let changes = &unknowns.support_changes;
                found += usize::from(size > 0.0 && changes.contains(&step));
                false_alarms += usize::from(size == 0.0 && !changes.is_empty());
            }
        }
        assert!(found >= 8 && false_alarms <= 1, "{found} found, {false_alarms} false alarms");
    }

    #[test]
    fn a_sleeper_far_from_its_neighbours_is_an_exception_and_leaves_theirs_alone() {
        let mut unknowns = unknowns();
        let data = measured(&unknowns, 0.05, Some((9, 0.9)));
        learn_variation(&mut unknowns, &data);
        assert_eq!(unknowns.exceptions, [Exception { field: Own::BallastStiffness, sleeper: 9 }]);
        assert!(unknowns.variation[0].independent < 0.12, "{:?}", unknowns.variation[0]);
        let best = data.best(&unknowns).unwrap() - &data.mean;
        assert!((best[9] + 0.9).abs() < 0.12, "{}", best[9]);
        assert!(best[8].abs() < 0.15 && best[10].abs() < 0.15);
    }
}
