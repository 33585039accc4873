//! Wheel flat: one blow per turn of the wheel.

use crate::along::{bonferroni, combine_dependent_p_values, ln_gamma_tail};
use crate::impact::{Cells, ImpactKind, Observed, Shape, cells, fit};
use tracktwin_signal::recording::Recording;

/// Largest relative deviation of the circumference from its nominal value, from wear and odometer scale.
pub(crate) const TOLERANCE: f64 = 0.02;
/// Smallest number of turns in a pass; with fewer the blows may belong to the track.
const TURNS_MIN: f64 = 3.0;
/// Lower limit of the log probability of one blow: one or two impacts of the track are no flat.
const BLOW_MIN: f64 = -7.0;

/// Weight of the power relative to the log probability in the choice of phase and circumference. Strong
/// blows all reach the limit [`BLOW_MIN`]; the choice with the highest power is then correct.
const LOUDNESS: f64 = 0.01;

/// A flat of the wheel.
#[derive(Clone, Debug)]
pub struct Flat {
    /// Circumference in m from the distances of the blows, and its standard deviation.
    pub circumference_m: (f64, f64),
    /// Natural logarithm of the probability of such blows without a flat.
    pub ln_p: f64,
    /// Power of the blows relative to the normal power.
    pub power_ratio: f64,
    /// Positions of the blows in m, one list per pass.
    pub blows_m: Vec<Vec<f64>>,
    /// Surface shape that corresponds to the blows; its length is that of the flat.
    pub shape: Option<Shape>,
}

/// Detects a flat of a wheel with about this circumference, with a false-alarm rate of `alpha`.
///
/// Every pass has its own phase of the flat. The function searches the circumference near
/// `circumference_m`.
pub fn flat(recording: &Recording, circumference_m: f64, alpha: f64) -> Option<Flat> {
    let passes = cells(recording, ImpactKind::Blows, true);
    let length = passes.first().map(|cells| cells.ratio.len() as f64 * cells.step_m)?;
    // A wheel that turns within a few cells has no phase.
    let is_resolved = (1.0 - TOLERANCE) * circumference_m >= 2.0 * passes[0].step_m;
    if length < TURNS_MIN * circumference_m || !is_resolved {
        return None;
    }
    let trials = trials(circumference_m, length, passes[0].step_m);
    let at = |&period: &f64| {
        let folds: Vec<Fold> = passes.iter().map(|cells| Fold::best(cells, period)).collect();
        let each: Vec<f64> = folds.iter().map(|fold| fold.ln_p).collect();
        let loudness = folds.iter().map(|fold| fold.loudness).sum::<f64>() / folds.len() as f64;
        (combine_dependent_p_values(&each), loudness, folds)
    };
    let rank = |(ln_p, loudness, _): &(f64, f64, Vec<Fold>)| ln_p - LOUDNESS * loudness;
    let (ln_p, _, folds) = trials.iter().map(at).min_by(|a, b| rank(a).total_cmp(&rank(b)))?;
    let ln_p = bonferroni(ln_p, trials.len());
    if ln_p > alpha.ln() {
        return None;
    }
    Some(describe(recording, &passes, &folds, ln_p))
}

/// Tested circumferences in m; a step shifts the last blow by one cell step.
fn trials(nominal: f64, length: f64, step_m: f64) -> Vec<f64> {
    let step = step_m * nominal / length;
    let count = (TOLERANCE * nominal / step).ceil() as i32;
    (-count..=count).map(|index| nominal + f64::from(index) * step).collect()
}

/// The phase of a pass at which equidistant blows are least probable by chance.
struct Fold {
    ln_p: f64,
    /// Sum of the square roots of the blows' negative log probabilities, without the lower limit.
    loudness: f64,
    /// Cells of the blows.
    blows: Vec<usize>,
}

impl Fold {
    fn best(cells: &Cells, period_m: f64) -> Self {
        let period = period_m / cells.step_m;
        let phases = period as usize;
        let ln_tails: Vec<f64> = (0..cells.ratio.len()).map(|cell| cells.ln_tail(cell)).collect();
        let at = |phase: usize| {
            let blows: Vec<usize> = (0..=cells.ratio.len() / phases)
                .map(|turn| (phase as f64 + turn as f64 * period).round() as usize)
                .filter(|&cell| cell < cells.ratio.len())
                .collect();
            let sum: f64 = blows.iter().map(|&cell| -ln_tails[cell].max(BLOW_MIN)).sum();
            let loudness = blows.iter().map(|&cell| (-ln_tails[cell]).sqrt()).sum();
            // Each term is exponential with mean one without a flat, or smaller where it is cut.
            let turns = blows.len() as f64;
            Self { ln_p: ln_gamma_tail(turns, sum / turns), loudness, blows }
        };
        let rank = |fold: &Self| fold.ln_p - LOUDNESS * fold.loudness;
        let best = (0..phases).map(at).min_by(|a, b| rank(a).total_cmp(&rank(b)));
        let best = best.expect("a period has phases");
        Self { ln_p: bonferroni(best.ln_p, phases), ..best }
    }
}

fn describe(recording: &Recording, passes: &[Cells], folds: &[Fold], ln_p: f64) -> Flat {
    let mut blows_m = vec![Vec::new(); recording.passes.len()];
    let (mut observed, mut powers, mut slopes) = (Vec::new(), Vec::new(), Vec::new());
    for (cells, fold) in passes.iter().zip(folds) {
        let index = cells.passes[0];
        powers.extend(fold.blows.iter().map(|&cell| cells.ratio[cell]));
        for &cell in &fold.blows {
            let seen = Observed::at(recording, index, cells.place_m(cell), cells.width_m);
            blows_m[index].push(seen.as_ref().map_or(cells.place_m(cell), |seen| seen.x_m));
            observed.extend(seen);
        }
        slopes.push(slope(&blows_m[index]));
    }
    let count = slopes.len() as f64;
    let mean = slopes.iter().sum::<f64>() / count;
    let variance = slopes.iter().map(|slope| (slope - mean).powi(2)).sum::<f64>() / count;
    Flat {
        circumference_m: (mean, variance.sqrt().max(1e-4 * mean)),
        ln_p,
        power_ratio: powers.iter().sum::<f64>() / powers.len() as f64,
        blows_m,
        shape: fit(recording, &observed),
    }
}

/// Slope of a straight line through the positions of successive blows: the circumference in m.
fn slope(places: &[f64]) -> f64 {
    let count = places.len() as f64;
    let middle = 0.5 * (count - 1.0);
    let mean = places.iter().sum::<f64>() / count;
    let turn = |index: usize| index as f64 - middle;
    let cross: f64 = places.iter().enumerate().map(|(i, place)| turn(i) * (place - mean)).sum();
    cross / (0..places.len()).map(|i| turn(i).powi(2)).sum::<f64>()
}
