//! A flat: one blow a turn of the wheel.

use crate::along::{bonferroni, combine_dependent_p_values, ln_gamma_tail};
use crate::impact::{Cells, ImpactKind, Observed, Shape, cells, fit};
use tracktwin_signal::recording::Recording;

/// How far wear and an odometer's scale may take the circumference from its nominal value.
const TOLERANCE: f64 = 0.02;
/// Turns that a pass must have: fewer blows are as well the track's.
const TURNS_MIN: f64 = 3.0;
/// The least logarithm that one blow contributes: one or two impacts of the track are no flat.
const BLOW_MIN: f64 = -7.0;

/// Weight of power beside probability in the choice of phase and circumference: clear blows all
/// reach the least logarithm, and the right choice is the loudest of these.
const LOUDNESS: f64 = 0.01;

/// A flat of the wheel.
#[derive(Clone, Debug)]
pub struct Flat {
    /// Circumference in m by the blows' distances, and its standard deviation.
    pub circumference_m: (f64, f64),
    /// Probability of such blows without a flat, in logarithm.
    pub ln_p: f64,
    /// Power of the blows over what is normal.
    pub power_ratio: f64,
    /// Places of the blows in m in each pass.
    pub blows_m: Vec<Vec<f64>>,
    /// The wave that the blows look like; its length is the flat's.
    pub shape: Option<Shape>,
}

/// The flat of a wheel of about this circumference, if less likely than `alpha` without one.
///
/// Each pass may meet the flat at its own phase. The circumference is searched around the given
/// one.
pub fn flat(recording: &Recording, circumference_m: f64, alpha: f64) -> Option<Flat> {
    let passes = cells(recording, ImpactKind::Blows, true);
    let length = passes.first().map(|cells| cells.ratio.len() as f64 * cells.step_m)?;
    if length < TURNS_MIN * circumference_m {
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

/// Circumferences apart by what shifts the last blow by half a cell.
fn trials(nominal: f64, length: f64, step_m: f64) -> Vec<f64> {
    let step = step_m * nominal / length;
    let count = (TOLERANCE * nominal / step).ceil() as i32;
    (-count..=count).map(|index| nominal + f64::from(index) * step).collect()
}

/// The phase of a pass at which blows at one distance are least likely by chance.
struct Fold {
    ln_p: f64,
    /// Sum of the roots of the blows' negative logarithms, uncut.
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
            let seen = Observed::at(&recording.passes[index], cells.place_m(cell), cells.width_m);
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
        shape: fit(&observed),
    }
}

/// Slope of a straight line through the places of successive blows: one turn in m.
fn slope(places: &[f64]) -> f64 {
    let count = places.len() as f64;
    let middle = 0.5 * (count - 1.0);
    let mean = places.iter().sum::<f64>() / count;
    let turn = |index: usize| index as f64 - middle;
    let cross: f64 = places.iter().enumerate().map(|(i, place)| turn(i) * (place - mean)).sum();
    cross / (0..places.len()).map(|i| turn(i).powi(2)).sum::<f64>()
}
