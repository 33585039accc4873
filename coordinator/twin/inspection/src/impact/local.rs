//! Impacts that come at the same place of the track in every pass and at every speed.

use super::repeated::{Cells, ImpactKind, cells};
use super::shape::{Form, Observed, Shape, fit};
use crate::along::{bonferroni, combine_dependent_p_values};
use tracktwin_signal::recording::Recording;

/// Probability of one speed's power without an impact above which it doesn't repeat there.
const EACH_SPEED: f64 = 0.01;
/// Neighbouring cells that are examined: odometers differ by millimetres between speeds.
const NEIGHBOURS: usize = 1;
/// Share of the loudest impact's power below which another is its echo: the ringing of the track and
/// of the band's edges, spans away.
const ECHO: f64 = 0.02;
/// Key of the distance of the bogie's other wheel, and the part of a sleeper spacing within which an impact so
/// far from a louder one is that of the other wheel at the same place.
const WHEELBASE: &str = "wheelbase_m";
const OTHER_WHEEL_SPANS: f64 = 0.1;
/// Impacts beyond which a rail is rough rather than damaged at places.
const IMPACTS_MAX: usize = 8;

/// A short event at one place of the track.
#[derive(Clone, Debug)]
pub struct Impact {
    /// Its place along the track in m and the standard deviation of that.
    pub x_m: (f64, f64),
    /// Probability to see as much anywhere on a rail without defects, in logarithm.
    pub ln_p: f64,
    /// Power over what is normal around it, mean of all speeds.
    pub power_ratio: f64,
    /// Its shape as a wave of the surface; none if its signal is too weak.
    pub shape: Option<Shape>,
}

/// All impacts that are less likely than `alpha` on a rail without defects, most certain first.
///
/// Places in `except` (`[from, to]` in m) are passed over.
pub fn impacts(recording: &Recording, alpha: f64, except: &[[f64; 2]]) -> Vec<Impact> {
    let allowed = |x: f64| !except.iter().any(|[from, to]| (*from..=*to).contains(&x));
    let by_kind = ImpactKind::BOTH.map(|kind| cells(recording, kind, false));
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

/// `ln P` of a cell over all speeds: certain (0) where one speed doesn't show it.
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
    for pass in &recording.passes {
        if let Some(seen) = Observed::at(pass, x, width) {
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
    let shape = fit(&observed);
    // The loudest moment may be at either edge of a hollow.
    let edge = match &shape {
        Some(Shape { form: Form::Hollow, length_m: (length, _), .. }) => 0.5 * length,
        _ => 0.0,
    };
    Impact { x_m: (place, deviation.hypot(edge)), ln_p, power_ratio, shape }
}

/// Mean and standard deviation; the passes of one odometer err together, so it is not divided by
/// the root of their number.
fn mean_and_deviation(values: &[f64], least: f64) -> Option<(f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (!values.is_empty()).then(|| (mean, (square / count).sqrt().max(least)))
}
