//! Local impacts: they occur at the same position of the track in every pass and at every speed.

use super::kink::{Kink, kinks};
use super::repeated::{Cells, ImpactKind, cells};
use super::shape::{Form, Observed, Shape, fit};
use crate::along::{bonferroni, combine_dependent_p_values, separate_wavelengths};
use tracktwin_signal::recording::Recording;

/// An impact is present at a speed if the probability of its power by chance is below this.
const EACH_SPEED: f64 = 0.01;
/// Number of neighbouring cells that are tested on either side: odometers differ by millimetres between
/// speeds.
const NEIGHBOURS: usize = 1;
/// Share of the strongest impact's power below which another impact counts as its echo. Ringing of the
/// track and of the band's edges causes echoes several spans away.
const ECHO: f64 = 0.02;
/// Name of the wheelbase in the recording. An impact at this distance from a stronger one belongs to the
/// other wheel at the same position; `OTHER_WHEEL_SPANS` is the tolerance in sleeper spacings.
const WHEELBASE: &str = "wheelbase_m";
const OTHER_WHEEL_SPANS: f64 = 0.1;
/// Largest number of impacts; with more the rail is rough rather than damaged locally.
const IMPACTS_MAX: usize = 8;

/// A short event at one position of the track.
#[derive(Clone, Debug)]
pub struct Impact {
    /// Position along the track in m and its standard deviation.
    pub x_m: (f64, f64),
    /// Natural logarithm of the probability of such an impact anywhere on a rail without defects.
    pub ln_p: f64,
    /// Power relative to the surroundings, as mean of all speeds.
    pub power_ratio: f64,
    /// Shape of the surface at the impact; `None` if the signal is too weak.
    pub shape: Option<Shape>,
}

/// Detects impacts by their power, and kinks, each with a false-alarm rate of `alpha`. Impacts that stand out by
/// their power come first, and the more significant ones first.
///
/// Positions in `except` (`[from, to]` in m) are skipped.
pub fn impacts(recording: &Recording, alpha: f64, except: &[[f64; 2]]) -> Vec<Impact> {
    let allowed = |x: f64| !except.iter().any(|[from, to]| (*from..=*to).contains(&x));
    // At one speed, the band of long hollows is that of the track's resonances as well.
    let is_usable =
        |kind| kind != ImpactKind::LongHollows || separate_wavelengths(&recording.speeds_km_h());
    let kinds = ImpactKind::ALL.into_iter().filter(|kind| is_usable(*kind));
    let by_kind: Vec<Vec<Cells>> = kinds.map(|kind| cells(recording, kind, false)).collect();
    let tries: usize = by_kind.iter().filter_map(|cells| Some(cells.first()?.ratio.len())).sum();
    let mut candidates = Vec::new();
    for speeds in by_kind.iter().filter(|speeds| !speeds.is_empty()) {
        let places = (0..speeds[0].ratio.len()).filter(|&cell| allowed(speeds[0].place_m(cell)));
        let certain = places.map(|cell| (speeds, cell, bonferroni(ln_p(speeds, cell), tries)));
        candidates.extend(certain.filter(|(_, _, ln_p)| *ln_p <= alpha.ln()));
    }
    candidates.sort_by(|a, b| a.2.total_cmp(&b.2));
    let mut found: Vec<Impact> = Vec::new();
    for (speeds, cell, ln_p) in candidates {
        let x = speeds[0].place_m(cell);
        let apart = |x_m: f64| {
            found.iter().all(|other| (other.x_m.0 - x_m).abs() > 0.5 * recording.spacing_m)
        };
        if found.len() < IMPACTS_MAX && apart(x) {
            let impact = impact(recording, speeds, cell, ln_p);
            // A loud impact's flank may lead back to its middle.
            if apart(impact.x_m.0) && allowed(impact.x_m.0) {
                found.push(impact);
            }
        }
    }
    for kink in kinks(recording, alpha) {
        let apart = |other: &Impact| (other.x_m.0 - kink.x_m.0).abs() > 0.5 * recording.spacing_m;
        if found.len() < IMPACTS_MAX && allowed(kink.x_m.0) && found.iter().all(apart) {
            let Kink { x_m, ln_p, power_ratio, shape } = kink;
            found.push(Impact { x_m, ln_p, power_ratio, shape: Some(shape) });
        }
    }
    let loudest = found.iter().map(|impact| impact.power_ratio).fold(0.0, f64::max);
    found.retain(|impact| impact.power_ratio > ECHO * loudest);
    let louder: Vec<(f64, f64)> =
        found.iter().map(|impact| (impact.x_m.0, impact.power_ratio)).collect();
    if let Some(wheelbase_m) = recording.nominal_value("wheel", WHEELBASE) {
        let is_of_other_wheel = |impact: &Impact| {
            let tolerance_m = OTHER_WHEEL_SPANS * recording.spacing_m + 2.0 * impact.x_m.1;
            louder.iter().any(|&(x_m, power_ratio)| {
                let apart_m = (impact.x_m.0 - x_m).abs();
                power_ratio > impact.power_ratio && (apart_m - wheelbase_m).abs() < tolerance_m
            })
        };
        found.retain(|impact| !is_of_other_wheel(impact));
    }
    found
}

/// `ln P` of a cell over all speeds; 0 if the impact is absent at one speed.
fn ln_p(speeds: &[Cells], cell: usize) -> f64 {
    let best = |cells: &Cells| {
        let around =
            cell.saturating_sub(NEIGHBOURS)..(cell + NEIGHBOURS + 1).min(cells.ratio.len());
        let tries = around.len();
        bonferroni(around.map(|other| cells.ln_tail(other)).fold(0.0, f64::min), tries)
    };
    let each: Vec<f64> = speeds.iter().map(best).collect();
    if each.iter().any(|&ln_p| ln_p > EACH_SPEED.ln()) {
        0.0
    } else {
        combine_dependent_p_values(&each)
    }
}

fn impact(recording: &Recording, speeds: &[Cells], cell: usize, ln_p: f64) -> Impact {
    let x = speeds[0].place_m(cell);
    let width = speeds[0].width_m;
    let mut places = Vec::new();
    let mut observed = Vec::new();
    for pass in 0..recording.passes.len() {
        if let Some(seen) = Observed::at(recording, pass, x, width) {
            places.push(seen.x_m);
            observed.push(seen);
        }
    }
    let power = |cells: &Cells| {
        let around =
            cell.saturating_sub(NEIGHBOURS)..(cell + NEIGHBOURS + 1).min(cells.ratio.len());
        around.map(|other| cells.ratio[other]).fold(0.0, f64::max)
    };
    let power_ratio = speeds.iter().map(power).sum::<f64>() / speeds.len() as f64;
    // A millimetre is what the ringing of the contact hides; a single pass has no other to differ.
    let least = if places.len() > 1 { 1e-3 } else { 0.5 * width };
    let (place, deviation) = mean_and_deviation(&places, least).unwrap_or((x, width));
    let shape = fit(recording, &observed);
    // The loudest moment may be at either edge of a hollow.
    let edge = match &shape {
        Some(Shape { form: Form::Hollow, length_m: (length, _), .. }) => 0.5 * length,
        _ => 0.0,
    };
    Impact { x_m: (place, deviation.hypot(edge)), ln_p, power_ratio, shape }
}

/// Mean and standard deviation, at least `least`; `None` for an empty list. The standard deviation is not
/// divided by the root of the count, because the passes of one odometer share their errors.
fn mean_and_deviation(values: &[f64], least: f64) -> Option<(f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (!values.is_empty()).then(|| (mean, (square / count).sqrt().max(least)))
}
