//! Kinks of the rail: a change of slope hits the wheel at once, upwards in every pass.
//!
//! A long dip has most of its power where the track resonates; there the power of the surface varies by as
//! much along the track. The blow at its kink is short only after the ringing is removed. On a surface whose
//! spectrum falls with the cube of the wave number, the innovations of a kink fall with the square root of the
//! distance behind it. The level of the surface changes along the track, so that innovations count relative to those
//! around them.

use super::coherent::coherent_shape;
use super::shape::Shape;
use crate::along::{Innovations, Surface, bonferroni, ln_normal_bound};
use tracktwin_number::NORMAL_QUARTILE;
use tracktwin_signal::recording::{Pass, Recording};

/// Highest wave number in cycles per sleeper spacing: waves of 10 mm on a line.
const WAVES_PER_SPACING: f64 = 60.0;
/// Lengths in sleeper spacings over which innovations are added up behind a kink: 2, 4 and 8 cm on a line.
const LENGTHS: [f64; 3] = [1.0 / 30.0, 1.0 / 15.0, 2.0 / 15.0];
/// Distance in sleeper spacings, on either side, over which the usual size of an innovation is determined.
const NEAR: f64 = 2.0;
/// Distance in sleeper spacings by which the odometers of two passes may differ, on either side.
const REACH: f64 = 0.01;
/// Step of the places in sleeper spacings.
const STEP: f64 = 1.0 / 300.0;
/// Distance from either end of a pass in sleeper spacings.
const ROOM: f64 = 1.5;
/// Shortest track in sleeper spacings.
const SPANS_MIN: f64 = 6.0;
/// A kink is present in a pass if its innovation is this many standard deviations above the median.
const EACH_PASS: f64 = 2.0;
/// A louder innovation counts as this many standard deviations: one pass alone proves no kink.
const LOUDEST: f64 = 8.0;
/// Smallest distance of two kinks in sleeper spacings.
const APART: f64 = 0.5;

/// A kink at one position of the track.
#[derive(Clone, Debug)]
pub(super) struct Kink {
    /// Position in m and its standard deviation.
    pub x_m: (f64, f64),
    /// Natural logarithm of the probability of such a kink anywhere on a rail without defects.
    pub ln_p: f64,
    /// Power of the innovations relative to that of the surroundings, as mean of all passes.
    pub power_ratio: f64,
    /// Shape of the surface that fits the innovations.
    pub shape: Shape,
}

/// A place where the innovations point upwards in every pass.
struct Found {
    x_m: f64,
    /// Natural logarithm of the probability by chance, first at this place and then anywhere.
    ln_p: f64,
    power_ratio: f64,
}

/// Kinks whose probability by chance is below `alpha`, the most significant one first.
pub(super) fn kinks(recording: &Recording, alpha: f64) -> Vec<Kink> {
    let spacing_m = recording.spacing_m;
    let top_hz = |pass: &Pass| WAVES_PER_SPACING * pass.mean_speed_m_s() / spacing_m;
    let passes = recording.passes.iter();
    let innovations = passes.map(|pass| Innovations::of(pass, top_hz(pass)));
    let Some(innovations) = innovations.collect::<Option<Vec<_>>>() else { return Vec::new() };
    let Some(places_m) = places(&innovations, spacing_m) else { return Vec::new() };
    // As many as there are innovations on the track, for every length.
    let spans = places_m.len() as f64 * STEP;
    let tries = (2.0 * WAVES_PER_SPACING * spans) as usize * LENGTHS.len();
    let levelled = innovations.iter().map(|pass| pass.levelled(NEAR * spacing_m));
    let levelled: Vec<Innovations> = levelled.collect();
    let of_length = |length: f64| {
        let passes = levelled.iter();
        let each: Vec<Vec<f64>> =
            passes.map(|pass| blows(pass, length * spacing_m, &places_m)).collect();
        found(&each, &places_m)
    };
    let mut places: Vec<Found> = LENGTHS.into_iter().flat_map(of_length).collect();
    for place in &mut places {
        place.ln_p = bonferroni(place.ln_p, tries);
    }
    places.retain(|place| place.ln_p <= alpha.ln());
    places.sort_by(|a, b| a.ln_p.total_cmp(&b.ln_p));
    let mut first: Vec<Found> = Vec::new();
    for place in places {
        if first.iter().all(|other| (other.x_m - place.x_m).abs() > APART * spacing_m) {
            first.push(place);
        }
    }
    if first.is_empty() {
        return Vec::new();
    }
    let surface = Surface::of(recording);
    let step_m = 0.5 * spacing_m / WAVES_PER_SPACING;
    let kink = |Found { x_m, ln_p, power_ratio }| Kink {
        x_m: (x_m, REACH * spacing_m),
        ln_p,
        power_ratio,
        shape: coherent_shape(&surface, &innovations, x_m, step_m, spacing_m),
    };
    first.into_iter().map(kink).collect()
}

/// Places in m that all passes reach; `None` if there are too few.
fn places(passes: &[Innovations], spacing_m: f64) -> Option<Vec<f64>> {
    let first = passes.iter().map(|pass| pass.position_m[0]).fold(f64::MIN, f64::max);
    let last = passes.iter().filter_map(|pass| pass.position_m.last()).copied();
    let (from_m, to_m) =
        (first + ROOM * spacing_m, last.fold(f64::MAX, f64::min) - ROOM * spacing_m);
    let count = ((to_m - from_m) / (STEP * spacing_m)) as usize;
    let places = (0..count).map(|index| from_m + index as f64 * STEP * spacing_m);
    (to_m - from_m > SPANS_MIN * spacing_m).then(|| places.collect())
}

/// Upward blows of a pass behind each place, added up over `length_m` with the weights of a kink and relative
/// to their usual size; the largest within reach.
fn blows(pass: &Innovations, length_m: f64, places_m: &[f64]) -> Vec<f64> {
    let positions = &pass.position_m;
    let step_m = (positions[positions.len() - 1] - positions[0]) / (positions.len() - 1) as f64;
    let count = ((length_m / step_m).round() as usize).max(1);
    let weights: Vec<f64> = (0..count).map(|index| (index as f64 + 0.5).sqrt().recip()).collect();
    // Accelerations are positive downwards.
    let summed = |start: usize| {
        -pass.values[start..]
            .iter()
            .zip(&weights)
            .map(|(value, weight)| value * weight)
            .sum::<f64>()
    };
    let sums: Vec<f64> = (0..positions.len()).map(summed).collect();
    let sums = Innovations { position_m: positions.clone(), values: sums };
    let usual = sums.usual();
    let at = |place: f64| (sums.at(place) / usual).clamp(-LOUDEST, LOUDEST);
    let at_places: Vec<f64> = places_m.iter().map(|&place| at(place)).collect();
    let reach = (REACH / STEP).round() as usize;
    let largest = |index: usize| {
        let around = index.saturating_sub(reach)..(index + reach + 1).min(at_places.len());
        at_places[around].iter().copied().fold(f64::MIN, f64::max)
    };
    (0..at_places.len()).map(largest).collect()
}

/// Local maxima of the mean over all passes, with the probability at one place.
fn found(passes: &[Vec<f64>], places_m: &[f64]) -> Vec<Found> {
    let mean =
        |index: usize| passes.iter().map(|pass| pass[index]).sum::<f64>() / passes.len() as f64;
    let standard = standardised(&(0..places_m.len()).map(mean).collect::<Vec<f64>>());
    let each: Vec<Vec<f64>> = passes.iter().map(|pass| standardised(pass)).collect();
    let reach = (2.0 * REACH / STEP).round() as usize;
    let is_largest = |index: usize| {
        let around = index.saturating_sub(reach)..(index + reach + 1).min(standard.len());
        standard[around].iter().all(|&other| other <= standard[index])
    };
    let is_kink =
        |&index: &usize| is_largest(index) && each.iter().all(|pass| pass[index] > EACH_PASS);
    let at = |index: usize| Found {
        x_m: places_m[index],
        ln_p: ln_normal_bound(standard[index]),
        power_ratio: mean(index).powi(2),
    };
    (0..standard.len()).filter(is_kink).map(at).collect()
}

/// Values as distances from their median in standard deviations; the quartiles give both.
fn standardised(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let [low, middle, high] = [1, 2, 3].map(|quarter| sorted[(sorted.len() - 1) * quarter / 4]);
    let deviation = ((high - low) / (2.0 * NORMAL_QUARTILE)).max(f64::MIN_POSITIVE);
    values.iter().map(|value| (value - middle) / deviation).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::Rolled;

    /// Share of false alarms.
    const ALPHA: f64 = 0.002;

    /// Kinks of a surface with a dip of `depth_m` at 1.3 m in those passes for which `is_there` is true.
    fn of_dip(depth_m: f64, is_there: fn(usize) -> bool) -> Vec<Kink> {
        let height = |pass: usize, x: f64| {
            if is_there(pass) { depth_m * (-(x - 1.3).abs() / 0.03).exp() } else { 0.0 }
        };
        kinks(&Rolled { height_m: &height, ..Rolled::faultless(2) }.recording(), ALPHA)
    }

    #[test]
    fn a_dip_has_a_kink_at_its_place() {
        let found = of_dip(8e-5, |_| true);
        assert!(!found.is_empty());
        for kink in found {
            assert!((kink.x_m.0 - 1.3).abs() < 4.0 * kink.x_m.1, "{kink:?}");
            assert!(kink.power_ratio > 10.0, "{kink:?}");
        }
    }

    /// Kinks of a surface with a dip of `depth_m` at 1.3 m whose acceleration is multiplied by `gain` of the position.
    fn of_level(seed: u64, depth_m: f64, gain: &dyn Fn(f64) -> f64) -> Vec<Kink> {
        let height = |_, x: f64| depth_m * (-(x - 1.3).abs() / 0.03).exp();
        let chain = |_, samples: &mut [f64], position_m: &mut [f64]| {
            for (sample, x_m) in samples.iter_mut().zip(position_m) {
                *sample *= gain(*x_m);
            }
        };
        let recording = Rolled { seed, height_m: &height, chain: &chain }.recording();
        kinks(&recording, ALPHA)
    }

    #[test]
    fn a_change_of_level_along_the_track_has_no_kink() {
        let step = |x: f64| 1.0 + 2.0 / (1.0 + (-(x - 2.1) / 0.02).exp());
        let sharp = |x: f64| if x < 2.1 { 1.0 } else { 3.0 };
        let wave = |x: f64| 2f64.powf((std::f64::consts::TAU * x / 1.5).sin());
        let gains: [&dyn Fn(f64) -> f64; 3] = [&step, &sharp, &wave];
        for (number, gain) in gains.into_iter().enumerate() {
            for seed in 0..6 {
                let found = of_level(seed, 0.0, gain);
                assert!(found.is_empty(), "gain {number}, seed {seed}: {found:?}");
            }
        }
    }

    #[test]
    fn a_dip_at_a_step_of_the_level_has_a_kink() {
        for (low, high) in [(1.0, 2.0), (2.0, 1.0)] {
            let found = of_level(2, 1.6e-4, &|x| if x < 1.3 { low } else { high });
            assert!(!found.is_empty(), "{low} to {high}");
            assert!((found[0].x_m.0 - 1.3).abs() < 4.0 * found[0].x_m.1, "{found:?}");
        }
    }

    #[test]
    fn a_hump_and_a_dip_in_some_passes_have_none() {
        assert!(of_dip(-8e-5, |_| true).is_empty());
        assert!(of_dip(8e-5, |pass| pass != 2).is_empty());
    }
}
