//! Positions that advance at another rate than the stated speeds, by one factor at every speed.

use crate::along::{by_speed, ln_normal_bound, speed_m_s};
use tracktwin_signal::recording::Recording;

/// How far an odometer usually wanders over a pass, as a share of the sleeper spacing: 3 mm on V-Track.
const WANDER: f64 = 0.024;
/// Difference of odometer and stated speed that is usual: drives are calibrated to that.
const USUAL: f64 = 3e-3;
/// Deviations within which the speeds must agree on the factor: rounded speeds don't.
const AGREE: f64 = 3.0;

/// A scale that positions have against the stated speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Recorded over true way, minus one, and its standard deviation.
    pub scale: (f64, f64),
    /// Speeds that agree on it.
    pub speeds: usize,
    /// Probability of it between a usual odometer and usual speeds, in logarithm.
    pub ln_p: f64,
}

/// The scale that the passes at two speeds or more agree on.
///
/// None for a single speed, and where speeds disagree: then their nominal values are rounded.
pub fn scale(recording: &Recording) -> Option<Scale> {
    let passes = &recording.passes;
    let groups = by_speed(passes);
    if groups.len() < 2 {
        return None;
    }
    let length = |index: usize| {
        let positions = &passes[index].position_m;
        positions[positions.len() - 1] - positions[0]
    };
    let shortest = (0..passes.len()).map(length).fold(f64::INFINITY, f64::min);
    let deviation = WANDER * recording.spacing_m / shortest;
    let of_pass = |&index: &usize| 3.6 * speed_m_s(&passes[index]) / passes[index].speed_km_h - 1.0;
    let of_speed = |group: &Vec<usize>| group.iter().map(of_pass).sum::<f64>() / group.len() as f64;
    let each: Vec<f64> = groups.iter().map(of_speed).collect();
    let count = each.len() as f64;
    let mean = each.iter().sum::<f64>() / count;
    if each.iter().any(|one| (one - mean).abs() > AGREE * deviation) {
        return None;
    }
    let deviation = deviation / count.sqrt();
    let ln_p = ln_normal_bound((mean.abs() - USUAL) / deviation);
    Some(Scale { scale: (mean, deviation), speeds: each.len(), ln_p })
}
