//! The rail's surface: filtered white noise, and hidden defects on it.
//!
//! This module realises eq. B.6 by white noise through two filters of first order along the rail. The
//! spectrum of the paper has no longest wavelength. Here waves longer than 2 m are attenuated, on a line
//! waves longer than 3 m. The module `texture` gives a line's surface another slope.

use crate::biquad::Biquad;
use crate::defect::{drift_phase, rail_depth_m};
use crate::random::{Random, Topic};
use crate::scale::Scale;
use crate::texture::Texture;
use std::f64::consts::PI;
use tracktwin_reference_simulator::{RoughRail, Scene};

/// `k` of eq. B.6.
const K: f64 = 0.25;
/// `Omega_c` of eq. B.6 in rad/m.
const CUT_OFF: f64 = 0.8242;
/// Unit of the level in m2 rad/m.
const LEVEL: f64 = 1e-4;
/// Way in m over which the filters settle before the track begins.
const SETTLE_M: f64 = 1.0;
/// Wavelengths in m that are stronger on rough rails.
const ROUGH_BAND_M: [f64; 2] = [0.9e-3, 5.2e-3];

/// Depth of the surface along the track.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// In m, downwards, from position 0 at every step of the grid.
    depth_m: Vec<f64>,
    grid_m: f64,
}

/// What the surfaces of all passes have in common.
#[derive(Debug)]
pub(crate) struct Ground<'a> {
    scene: &'a Scene,
    scale: &'a Scale,
    texture: &'a Texture,
    /// Depth that all passes share.
    shared_m: Vec<f64>,
}

impl<'a> Ground<'a> {
    /// Of a scene.
    pub(crate) fn new(scene: &'a Scene, scale: &'a Scale, texture: &'a Texture) -> Self {
        let mut ground = Self { scene, scale, texture, shared_m: Vec::new() };
        ground.shared_m = ground.irregularity([Topic::Surface, Topic::Rough], 0);
        ground
    }

    /// The surface of a pass.
    pub(crate) fn of_pass(&self, pass: usize) -> Surface {
        let own = self.irregularity([Topic::PassSurface, Topic::PassRough], pass + 1);
        let grid_m = self.scale.grid_m;
        let unrepeated = self.scene.chain.unrepeated;
        let [of_all, of_one] = [(1.0 - unrepeated).sqrt(), unrepeated.sqrt()];
        let phase = drift_phase(self.scene);
        let defect = |index: usize| {
            let x_m = index as f64 * grid_m;
            self.scene.left_out.iter().map(|hidden| rail_depth_m(hidden, phase, x_m)).sum::<f64>()
        };
        let defects = self.texture.rolled((0..own.len()).map(defect).collect(), grid_m);
        let parts = self.shared_m.iter().zip(&own).zip(defects);
        let sum = parts.map(|((shared, own), defects)| of_all * shared + of_one * own + defects);
        Surface { depth_m: self.texture.patched(sum.collect()), grid_m }
    }

    /// The irregularity in m along the scene.
    fn irregularity(&self, [plain, rough]: [Topic; 2], pass: usize) -> Vec<f64> {
        let Self { scene, scale, .. } = *self;
        let level = |x_m: f64| {
            scene.irregularity_level * rail_at(scene, x_m).map_or(1.0, |r| r.level_factor)
        };
        let count = (scene.length_m() / scale.grid_m).ceil() as usize + 2;
        let mut depth_m = filtered(scale, Random::new(scene.seed, plain, pass), count, level);
        if scene.rough_rails.iter().any(|rail| rail.band_factor > 1.0) {
            let more = |x_m| rail_at(scene, x_m).map_or(0.0, |rail| rail.band_factor - 1.0);
            let random = Random::new(scene.seed, rough, pass);
            let mut waves = filtered(scale, random, count, |x_m| level(x_m) * more(x_m));
            let [short, long] = ROUGH_BAND_M.map(|length| scale.grid_m / length);
            let low = [Biquad::low_pass(short); 2];
            let high = [Biquad::high_pass(long); 2];
            for mut filter in low.into_iter().chain(high) {
                for value in &mut waves {
                    *value = filter.next(*value);
                }
            }
            for (depth, wave) in depth_m.iter_mut().zip(waves) {
                *depth += wave;
            }
        }
        self.texture.raise(&mut depth_m, scale.grid_m);
        depth_m
    }
}

impl Surface {
    /// Depth in m at `x_m`.
    pub(crate) fn at(&self, x_m: f64) -> f64 {
        let place = (x_m / self.grid_m).clamp(0.0, (self.depth_m.len() - 2) as f64);
        let index = place as usize;
        let share = place - index as f64;
        self.depth_m[index] + share * (self.depth_m[index + 1] - self.depth_m[index])
    }
}

fn rail_at(scene: &Scene, x_m: f64) -> Option<&RoughRail> {
    scene.rough_rails.iter().find(|rail| (rail.x_m[0]..rail.x_m[1]).contains(&x_m))
}

/// White noise through both filters; its level may change along the way, the surface stays continuous.
fn filtered(
    scale: &Scale,
    mut random: Random,
    count: usize,
    level: impl Fn(f64) -> f64,
) -> Vec<f64> {
    let grid_m = scale.grid_m;
    // White noise of deviation s has the one-sided density s^2 dx / pi over wave numbers.
    let unit = (PI * K * LEVEL * CUT_OFF * CUT_OFF / grid_m).sqrt();
    let settle = (SETTLE_M / grid_m) as usize;
    let [keep_slope, keep_depth] = [scale.leak, CUT_OFF].map(|rate| (-rate * grid_m).exp());
    let (mut slope, mut depth) = (0.0, 0.0);
    let mut next = |step: usize| {
        let x_m = (step as f64 - settle as f64) * grid_m;
        let before = slope;
        slope = keep_slope * slope + grid_m * unit * level(x_m).sqrt() * random.normal();
        depth = keep_depth * depth + grid_m * 0.5 * (before + slope);
        depth
    };
    (0..settle + count).map(&mut next).skip(settle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_reference_simulator::SleeperTruth;

    /// Of the test rig.
    const GRID_M: f64 = 2e-5;

    fn shared(scene: &Scene) -> Vec<f64> {
        Ground::new(scene, &Scale::of(scene), &Texture::default()).shared_m
    }

    fn scene(seed: u64) -> Scene {
        let sleeper = SleeperTruth {
            railpad_stiffness_n_m: 1.5e8,
            ballast_stiffness_n_m: 1.2e7,
            sleeper_ei_n_m2: 5000.0,
        };
        Scene { seed, ..Scene::uniform(80, sleeper) }
    }

    /// Mean power in m2 of wavelengths between two in m.
    fn power(scene: &Scene, [short, long]: [f64; 2], range_m: [f64; 2]) -> f64 {
        let mut depth = shared(scene);
        let filters = [Biquad::low_pass(GRID_M / short); 3]
            .into_iter()
            .chain([Biquad::high_pass(GRID_M / long); 3]);
        for mut filter in filters {
            for value in &mut depth {
                *value = filter.next(*value);
            }
        }
        let [from, to] = range_m.map(|x| (x / GRID_M) as usize);
        depth[from..to].iter().map(|value| value * value).sum::<f64>() / (to - from) as f64
    }

    #[test]
    fn the_power_is_that_of_the_spectrum() {
        // Integral of eq. B.6 far above its cut-off, through the filters of the test.
        let [short, long] = [2e-3, 8e-3];
        let density = |wave: f64| K * LEVEL * 3.0 * CUT_OFF * CUT_OFF / wave.powi(4);
        let [high, low] = [short, long].map(|length| 2.0 * PI / length);
        let step = 0.5;
        let through = |wave: f64| {
            let [below, above] = [(wave / high).powi(4), (low / wave).powi(4)];
            (1.0 / (1.0 + below) / (1.0 + above)).powi(3)
        };
        let waves = (200..20_000).map(|i| f64::from(i) * step);
        let expected: f64 = waves.map(|wave| density(wave) * through(wave) * step).sum();
        let found =
            (0..4).map(|seed| power(&scene(seed), [short, long], [1.0, 10.0])).sum::<f64>() / 4.0;
        assert!((found / expected - 1.0).abs() < 0.06, "{found} and {expected}");
    }

    #[test]
    fn a_rough_rail_has_more_power_and_no_step_at_its_ends() {
        let rough = RoughRail { x_m: [5.0, 8.0], level_factor: 2.0, band_factor: 3.0 };
        let scene = Scene { rough_rails: vec![rough], ..scene(5) };
        let band = [1.5e-3, 3e-3];
        let ratio = power(&scene, band, [5.1, 8.0]) / power(&scene, band, [0.5, 5.0]);
        assert!((ratio / 6.0 - 1.0).abs() < 0.25, "{ratio}");
        let depth = shared(&scene);
        let largest = depth.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert!(largest < 5e-7, "{largest}");
    }
}
