//! Scale errors: positions that deviate from the stated speeds by the same factor at every speed.

use crate::along::{by_speed, ln_normal_bound};
use crate::median;
use tracktwin_signal::recording::{Pass, Recording};

/// Usual error of an odometer over a pass, as a share of the sleeper spacing: 3 mm on V-Track.
const WANDER: f64 = 0.024;
/// Smallest usual relative difference between odometer and stated speed; drives are calibrated to this
/// accuracy.
const USUAL_MIN: f64 = 3e-3;
/// Usual difference as a multiple of the change of the speed within a pass: the speed of a train is stated
/// no more exactly than its driver keeps it.
const DRIFTS: f64 = 2.0;
/// Largest difference of the factors at single speeds from their mean, in standard deviations; rounded
/// speeds exceed it.
const AGREE: f64 = 3.0;

/// Scale of the positions relative to the stated speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Recorded distance over true distance, minus one, and its standard deviation.
    pub scale: (f64, f64),
    /// Usual difference between odometer and stated speed, as a share of the speed.
    pub usual: f64,
    /// Number of speeds with this scale.
    pub speeds: usize,
    /// Natural logarithm of the probability of such a scale with a usual odometer and usual speeds.
    pub ln_p: f64,
}

/// Common scale of the passes at two speeds or more.
///
/// `None` for a single speed, or if the speeds give different scales: their nominal values are then
/// rounded.
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
    let of_pass =
        |&index: &usize| 3.6 * passes[index].mean_speed_m_s() / passes[index].speed_km_h - 1.0;
    let of_speed = |group: &Vec<usize>| group.iter().map(of_pass).sum::<f64>() / group.len() as f64;
    let each: Vec<f64> = groups.iter().map(of_speed).collect();
    let count = each.len() as f64;
    let mean = each.iter().sum::<f64>() / count;
    if each.iter().any(|one| (one - mean).abs() > AGREE * deviation) {
        return None;
    }
    let deviation = deviation / count.sqrt();
    let usual = USUAL_MIN.max(DRIFTS * median(passes.iter().map(Pass::speed_change).collect()));
    let ln_p = ln_normal_bound((mean.abs() - usual) / deviation);
    Some(Scale { scale: (mean, deviation), usual, speeds: each.len(), ln_p })
}
