//! The spectrum that a surface has beside eq. B.6, and what wheel and contact patch feel of it.
//!
//! This module contains filters along the rail. The module `surface` draws the noise.

use std::f64::consts::PI;
use tracktwin_parameters::TrackDesign;

/// Wave number in rad/m above which the power of a line's surface falls less steeply than eq. B.6.
const BEND: f64 = 8.0;
/// Ratio of the wave numbers of neighbouring pairs of zero and pole. The ripple is below 0.2 dB.
const PERIOD: f64 = 6.0;
/// Pairs: from 8 rad/m to waves of 1 mm.
const PAIRS: i32 = 4;
/// Power of the wave number by which eq. B.6 falls.
const STEEPEST: f64 = 4.0;
/// Reach of the patch's weights in half lengths.
const REACH: f64 = 12.0;

/// What makes a surface from noise that has the spectrum of eq. B.6.
#[derive(Clone, Debug, Default)]
pub(crate) struct Texture {
    /// Wave numbers in rad/m of zeros and poles.
    lead: Vec<[f64; 2]>,
    /// Weights of the contact patch: of its middle, then of the samples on either side.
    patch: Vec<f64>,
    /// Radius in m of a wheel that does not reach the bottom of narrow hollows.
    wheel_m: Option<f64>,
}

impl Texture {
    /// Of a line: power falls with `exponent` above 8 rad/m; `patch_m` is the patch's half length.
    pub(crate) fn line(exponent: f64, patch_m: f64, wheel_m: f64, grid_m: f64) -> Self {
        let rise = (STEEPEST - exponent) / 2.0;
        let pair = |pair: i32| {
            let zero = BEND * PERIOD.powf(f64::from(pair) + (1.0 - rise) / 2.0);
            [zero, zero * PERIOD.powf(rise)]
        };
        Self {
            lead: (0..PAIRS).map(pair).collect(),
            patch: if patch_m > 0.0 { patch_weights(patch_m, grid_m) } else { Vec::new() },
            wheel_m: Some(wheel_m),
        }
    }

    /// Filters noise, sample by sample.
    pub(crate) fn raise(&self, depth_m: &mut [f64], grid_m: f64) {
        for &[zero, pole] in &self.lead {
            // (1 + s / zero) / (1 + s / pole) by the bilinear transform.
            let [a, b] = [zero, pole].map(|corner| 2.0 / (grid_m * corner));
            let (mut last_in, mut last_out) = (depth_m[0], depth_m[0]);
            for value in &mut *depth_m {
                let input = *value;
                *value =
                    ((1.0 + a) * input + (1.0 - a) * last_in - (1.0 - b) * last_out) / (1.0 + b);
                (last_in, last_out) = (input, *value);
            }
        }
    }

    /// Depth of hollows that the wheel feels as it rolls over them: its lowest point touches first.
    pub(crate) fn rolled(&self, depth_m: Vec<f64>, grid_m: f64) -> Vec<f64> {
        let range = depth_m.iter().fold([0.0_f64; 2], |[low, high], &d| [low.min(d), high.max(d)]);
        let Some(radius_m) = self.wheel_m.filter(|_| range != [0.0; 2]) else { return depth_m };
        let reach_m = (2.0 * radius_m * (range[1] - range[0])).sqrt();
        let reach = (reach_m / grid_m).ceil() as usize;
        let rise = |offset: usize| (offset as f64 * grid_m).powi(2) / (2.0 * radius_m);
        let rises: Vec<f64> = (0..=reach).map(rise).collect();
        let felt = |at: usize| {
            let first = at.saturating_sub(reach);
            let last = (at + reach).min(depth_m.len() - 1);
            let touching = (first..=last).map(|other| depth_m[other] + rises[other.abs_diff(at)]);
            touching.fold(f64::MAX, f64::min)
        };
        (0..depth_m.len()).map(felt).collect()
    }

    /// Mean of a surface over the contact patch at every sample.
    pub(crate) fn patched(&self, depth_m: Vec<f64>) -> Vec<f64> {
        let Some((middle, beside)) = self.patch.split_first() else { return depth_m };
        let last = depth_m.len() - 1;
        let mean = |at: usize| {
            let pair = |(offset, weight): (usize, &f64)| {
                weight * (depth_m[at.saturating_sub(offset)] + depth_m[(at + offset).min(last)])
            };
            middle * depth_m[at] + (1..).zip(beside).map(pair).sum::<f64>()
        };
        (0..depth_m.len()).map(mean).collect()
    }
}

/// Half length of the contact patch in m: of Hertz's circle, stretched along the rail by the ratio of radii.
pub(crate) fn patch_half_length_m(design: &TrackDesign) -> f64 {
    let [wheel_m, rail_m] = [design.wheel.radius_m, design.railhead_radius_m];
    let radius_m = 2.0 / (1.0 / wheel_m + 1.0 / rail_m);
    let plane = design.rail.youngs_modulus_pa / (1.0 - design.rail.poisson.powi(2));
    let circle_m = (1.5 * design.wheel.load_n * radius_m / plane).cbrt();
    circle_m * (wheel_m / rail_m).cbrt()
}

/// Weights whose power response is `1 / (1 + pi/4 (k a)^3)` (Remington 1976), without phase.
fn patch_weights(half_length_m: f64, grid_m: f64) -> Vec<f64> {
    let count = (REACH * half_length_m / grid_m).ceil() as usize;
    let steps = 4 * count;
    let wave = |step: usize| (step as f64 + 0.5) * PI / grid_m / steps as f64;
    let gains: Vec<[f64; 2]> = (0..steps)
        .map(|step| {
            let turned = (wave(step) * half_length_m).powi(3);
            [wave(step), (1.0 + PI / 4.0 * turned).powf(-0.5)]
        })
        .collect();
    let weight = |offset: usize| {
        let x_m = offset as f64 * grid_m;
        gains.iter().map(|[wave, gain]| gain * (wave * x_m).cos()).sum::<f64>() / steps as f64
    };
    let mut weights: Vec<f64> = (0..=count).map(weight).collect();
    // A plane surface stays where it is.
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    for weight in &mut weights {
        *weight /= sum;
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::Preset;

    const GRID_M: f64 = 2e-4;

    /// Amplitude over the middle of a filtered wave.
    fn gain(wave: f64, filter: impl Fn(Vec<f64>) -> Vec<f64>) -> f64 {
        let sine = (0..60_000).map(|i| (wave * f64::from(i) * GRID_M).sin()).collect();
        let heard = &filter(sine)[20_000..50_000];
        (2.0 * heard.iter().map(|value| value * value).sum::<f64>() / heard.len() as f64).sqrt()
    }

    #[test]
    fn the_patch_filters_as_remingtons_formula_says() {
        let patch_m = patch_half_length_m(&Preset::Concrete60E1.design());
        assert!((5.5e-3..6.5e-3).contains(&patch_m), "{patch_m}");
        let texture = Texture::line(3.0, patch_m, 0.46, GRID_M);
        for length_m in [0.2, 0.05, 0.02, 8e-3] {
            let wave = 2.0 * PI / length_m;
            let found = gain(wave, |depth| texture.patched(depth));
            let closed = (1.0 + PI / 4.0 * (wave * patch_m).powi(3)).powf(-0.5);
            assert!((found / closed - 1.0).abs() < 0.02, "{length_m} m: {found} and {closed}");
        }
    }

    #[test]
    fn the_power_falls_with_the_exponent_above_the_bend() {
        for exponent in [4.0, 3.4, 3.0, 2.6] {
            let texture = Texture::line(exponent, 0.0, 0.46, GRID_M);
            let raised = |wave: f64| {
                gain(wave, |mut depth| {
                    texture.raise(&mut depth, GRID_M);
                    depth
                })
            };
            for wave in [20.0, 60.0, 200.0, 600.0, 1500.0] {
                let level_db = 20.0 * raised(wave).log10();
                let closed_db = 10.0 * (4.0 - exponent) * (wave / BEND).log10();
                assert!(
                    (level_db - closed_db).abs() < 0.6,
                    "{exponent}, {wave}: {level_db} and {closed_db}"
                );
            }
        }
    }

    #[test]
    fn a_wheel_spans_a_narrow_hollow_and_follows_a_wide_one() {
        let texture = Texture::line(3.0, 0.0, 0.46, GRID_M);
        for (length_m, share) in [(0.01, [0.0, 0.2]), (0.3, [0.97, 1.0])] {
            let hollow = |i: i32| {
                let way = f64::from(i - 2000) * GRID_M / length_m;
                if way.abs() < 0.5 { 2e-4 * (1.0 - 4.0 * way * way) } else { 0.0 }
            };
            let felt = texture.rolled((0..4000).map(hollow).collect(), GRID_M)[2000] / 2e-4;
            assert!((share[0]..=share[1]).contains(&felt), "{length_m} m: {felt}");
        }
    }
}
