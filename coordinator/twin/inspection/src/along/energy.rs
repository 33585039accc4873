//! Power of a whitened pass between any two positions.

use num_complex::Complex64;
use tracktwin_signal::recording::Pass;

/// Cumulative power of a pass along the track.
#[derive(Clone, Debug)]
pub(crate) struct Energy<'a> {
    position_m: &'a [f64],
    /// Sum of the squared magnitudes before each sample.
    summed: Vec<f64>,
}

impl<'a> Energy<'a> {
    /// Sums the power of a whitened signal of the pass.
    pub(crate) fn new(pass: &'a Pass, whitened: &[Complex64]) -> Self {
        let mut summed = Vec::with_capacity(whitened.len() + 1);
        let mut sum = 0.0;
        summed.push(sum);
        for value in whitened {
            sum += value.norm_sqr();
            summed.push(sum);
        }
        Self { position_m: &pass.position_m, summed }
    }

    /// Mean power between two positions in m; zero if the pass has no sample there.
    pub(crate) fn mean(&self, from_m: f64, to_m: f64) -> f64 {
        let [start, end] =
            [from_m, to_m].map(|place| self.position_m.partition_point(|&x| x < place));
        if end <= start {
            return 0.0;
        }
        (self.summed[end] - self.summed[start]) / (end - start) as f64
    }
}

/// Smallest ratio of two speeds that separates a line of constant wavelength from a line of constant
/// frequency by more than the width of a resonance of track or vehicle.
pub const SPEED_RATIO: f64 = 1.2;

/// Share of [`SPEED_RATIO`] that is enough, because true speeds differ from their nominal values by a few tenths of a
/// per cent.
const ROUNDING: f64 = 0.99;

/// Indices of the passes at each speed, the fastest speed first.
///
/// Nominal speeds within 2 % count as equal, because a drive holds its speed no more closely.
pub(crate) fn by_speed(passes: &[Pass]) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..passes.len()).collect();
    order.sort_by(|&a, &b| passes[b].speed_km_h.total_cmp(&passes[a].speed_km_h));
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for index in order {
        let speed = passes[index].speed_km_h;
        match groups.last_mut() {
            Some(group) if passes[group[0]].speed_km_h / speed < 1.02 => group.push(index),
            _ => groups.push(vec![index]),
        }
    }
    groups
}

/// Whether the ratio of the highest to the lowest of these speeds separates effects of constant wavelength
/// (surface, wheel) from effects of constant frequency (track, vehicle).
pub fn separate_wavelengths(speeds: &[f64]) -> bool {
    let [lowest, highest] =
        speeds.iter().fold([f64::MAX, 0.0], |[low, high], &it| [it.min(low), it.max(high)]);
    highest >= ROUNDING * SPEED_RATIO * lowest
}
