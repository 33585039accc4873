//! The surface under the wheel: random irregularity, and the shapes of hidden effects.

use crate::assumptions::{Assumptions, SquatHollow};
use crate::hidden::Hidden;
use crate::nuisances::Nuisances;
use crate::scene::Scene;
use crate::vtrack::WHEEL_RADIUS_M;
use num_complex::Complex64;
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::{PI, TAU};

/// Factor `k` and cut-off `Omega_c` in rad/m of eq. B.6, and its level 1 in m2 rad/m.
const FACTOR: f64 = 0.25;
const CUTOFF_RAD_M: f64 = 0.8242;
const LEVEL_UNIT: f64 = 1e-4;
/// Shortest and longest wavelength in m.
const SHORTEST_M: f64 = 0.25e-3;
const LONGEST_M: f64 = 1.0;
/// All wavelengths in m.
pub(crate) const WAVES_M: [f64; 2] = [SHORTEST_M, LONGEST_M];
/// Knots on the shortest wave: cubics through heights and slopes are within 1e-3 of it.
const KNOTS_PER_WAVE: f64 = 8.0;
/// Wavelengths over which a corrugation grows and fades.
const FADE_WAVES: f64 = 2.0;

/// Random irregularity along a track, positive downwards.
#[derive(Clone, Debug)]
pub(crate) struct Irregularity {
    pub(crate) step_m: f64,
    /// Height in m and slope at every knot.
    pub(crate) knots: Vec<[f64; 2]>,
}

/// One-sided density of eq. B.6 at level one in m2/(rad/m).
pub(crate) fn density(wave_number: f64) -> f64 {
    let (square, cutoff) = (wave_number.powi(2), CUTOFF_RAD_M.powi(2));
    FACTOR * LEVEL_UNIT * cutoff / ((square + cutoff) * square)
}

impl Irregularity {
    /// Filtered noise with the spectrum of eq. B.6 at a level, on at least `length_m`, of the waves
    /// `waves_m` from the shortest to the longest: every harmonic has a Gaussian sine and cosine, so
    /// that its power is random too. The contact patch of `nuisances` averages it.
    pub(crate) fn draw(
        level: f64,
        length_m: f64,
        waves_m: [f64; 2],
        nuisances: &Nuisances,
        random: &mut ChaCha12Rng,
    ) -> Self {
        let step_m = SHORTEST_M / KNOTS_PER_WAVE;
        let count = ((length_m / step_m).ceil() as usize).next_power_of_two();
        let first = TAU / (count as f64 * step_m);
        let mut heights = vec![Complex64::ZERO; count / 2 + 1];
        let mut slopes = heights.clone();
        for index in 1..count / 2 {
            let wave_number = index as f64 * first;
            let [cosine, sine]: [f64; 2] = [0; 2].map(|_| StandardNormal.sample(random));
            if (TAU / waves_m[1]..=TAU / waves_m[0]).contains(&wave_number) {
                // The inverse transform adds the mirrored half: twice the real part.
                let amplitude = nuisances.patch(wave_number)
                    * (0.5 * (level * density(wave_number) * first).sqrt());
                heights[index] = amplitude * Complex64::new(cosine, sine);
                slopes[index] = heights[index] * Complex64::new(0.0, wave_number);
            }
        }
        let back = |mut lines: Vec<Complex64>| {
            let transform = tracktwin_fourier::real_inverse(count);
            let mut values = transform.make_output_vec();
            transform.process(&mut lines, &mut values).expect("lengths and ends are as planned");
            values
        };
        let knots = back(heights).into_iter().zip(back(slopes)).map(|(z, s)| [z, s]).collect();
        Self { step_m, knots }
    }

    /// The same with a `share` of its power replaced by that of another one of its length.
    pub(crate) fn blend(&self, other: &Self, share: f64) -> Self {
        let (kept, fresh) = ((1.0 - share).sqrt(), share.sqrt());
        let mixed = |(a, b): (&[f64; 2], &[f64; 2])| {
            [kept * a[0] + fresh * b[0], kept * a[1] + fresh * b[1]]
        };
        let knots = self.knots.iter().zip(&other.knots).map(mixed).collect();
        Self { step_m: self.step_m, knots }
    }

    /// Height in m at a place in m; repeats itself beyond its length.
    pub(crate) fn height(&self, x_m: f64) -> f64 {
        let place = (x_m / self.step_m).rem_euclid(self.knots.len() as f64);
        let t = place.fract();
        // A place that rounds to the length is the origin again.
        let index = place as usize % self.knots.len();
        let [z_0, s_0] = self.knots[index];
        let [z_1, s_1] = self.knots[(index + 1) % self.knots.len()];
        let (s_0, s_1) = (s_0 * self.step_m, s_1 * self.step_m);
        // Hermite's cubic.
        let (bend, twist) = (3.0 * (z_1 - z_0) - 2.0 * s_0 - s_1, 2.0 * (z_0 - z_1) + s_0 + s_1);
        z_0 + t * (s_0 + t * (bend + t * twist))
    }
}

/// Angle of the wheel at the origin of the track.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelAngle {
    /// Distance in m that the wheel rolled before it reached the origin of the track.
    pub rolled_m: f64,
}

/// Height in m, positive downwards, that hidden effects and the wheel's orders add at a place.
pub(crate) fn shapes(scene: &Scene, angle: WheelAngle, x_m: f64) -> f64 {
    let rolled_m = x_m + angle.rolled_m;
    let hidden = scene.left_out.iter();
    let hidden: f64 = hidden.map(|it| shape(it, &scene.assumptions, rolled_m, x_m)).sum();
    hidden + scene.nuisances.wheel_m(rolled_m)
}

fn shape(hidden: &Hidden, assumptions: &Assumptions, rolled_m: f64, x_m: f64) -> f64 {
    match hidden {
        Hidden::RailJoint { x_m: place, dip_m, length_m, .. } => {
            dip_m * assumptions.joint.at(x_m - middle(*place), *length_m)
        }
        Hidden::Squat { x_m: place, depth_m, length_m } => {
            depth_m * assumptions.squat.at((x_m - middle(*place)) / length_m)
        }
        Hidden::Corrugation { x_m: stretch, wavelength_m, amplitude_m } => {
            let inside = (x_m - stretch[0]).min(stretch[1] - x_m) / (FADE_WAVES * wavelength_m);
            let fade = 0.5 * (1.0 - (PI * inside.clamp(0.0, 1.0)).cos());
            fade * amplitude_m * assumptions.corrugation.at(x_m, *stretch, *wavelength_m)
        }
        Hidden::WheelFlat { length_m } => {
            let turn = TAU * WHEEL_RADIUS_M;
            let from_flat = (rolled_m + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
            let depth_m = length_m * length_m / (16.0 * WHEEL_RADIUS_M);
            depth_m * SquatHollow::Cosine.at(from_flat / length_m)
        }
        Hidden::WheelOutOfRound { order, amplitude_m } => {
            amplitude_m * (f64::from(*order) * rolled_m / WHEEL_RADIUS_M).cos()
        }
        _ => 0.0,
    }
}

fn middle(place: [f64; 2]) -> f64 {
    0.5 * (place[0] + place[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::testing::NOMINAL;
    use rand_chacha::rand_core::SeedableRng;

    fn drawn(seed: u64) -> Irregularity {
        Irregularity::draw(
            3.0,
            5.0,
            WAVES_M,
            &Nuisances::default(),
            &mut ChaCha12Rng::seed_from_u64(seed),
        )
    }

    #[test]
    fn its_power_in_a_band_is_that_of_the_spectrum() {
        // Mean square of z(x + d) - z(x) over surfaces: integral of 2 S (1 - cos k d).
        let distance = 2e-3;
        let steps = 40_000;
        let expected: f64 = (0..steps)
            .map(|index| {
                let (low, high) = (TAU / LONGEST_M, TAU / SHORTEST_M);
                let ratio: f64 = (high / low).powf(1.0 / f64::from(steps));
                let k = low * ratio.powf(f64::from(index) + 0.5);
                6.0 * density(k) * (1.0 - (k * distance).cos()) * k * ratio.ln()
            })
            .sum();
        let mean: f64 = (0..24)
            .map(|seed| {
                let surface = drawn(seed);
                let change = |n: u32| {
                    let x = f64::from(n) * 2.5e-3;
                    surface.height(x + distance) - surface.height(x)
                };
                (0..2000).map(|n| change(n).powi(2)).sum::<f64>() / 2000.0 / 24.0
            })
            .sum();
        // Half of it comes from some ten longest waves on each of 24 surfaces: 10 % by chance.
        assert!((mean / expected - 1.0).abs() < 0.2, "{mean} {expected}");
    }

    #[test]
    fn between_knots_it_is_smooth_and_a_blend_keeps_its_level() {
        let (one, other) = (drawn(1), drawn(2));
        let x = 1000.0 * one.step_m;
        let jump = one.height(x + 1e-12) - one.height(x - 1e-12);
        assert!(jump.abs() < 1e-12);
        // Curvature, for in it all wavelengths weigh alike.
        let power = |surface: &Irregularity| -> f64 {
            surface.knots.windows(2).map(|pair| (pair[1][1] - pair[0][1]).powi(2)).sum()
        };
        let blended = power(&one.blend(&other, 0.05));
        let mean = 0.95 * power(&one) + 0.05 * power(&other);
        // The product of two independent surfaces, of 16 thousand waves, adds up to little.
        assert!((blended / mean - 1.0).abs() < 0.02, "{blended} {mean}");
    }

    #[test]
    fn hidden_shapes_are_those_of_the_catalogue() {
        let at = |hidden: &Hidden, x_m: f64, rolled_m: f64| {
            let scene = Scene { left_out: vec![hidden.clone()], ..Scene::uniform(40, NOMINAL) };
            shapes(&scene, WheelAngle { rolled_m }, x_m)
        };
        let joint = Hidden::RailJoint {
            x_m: [2.0, 2.0],
            dip_m: 8e-5,
            length_m: 0.02,
            bending_factor: 1.0,
            bending_length_m: 0.025,
        };
        assert!((at(&joint, 1.98, 0.0) / (8e-5 / 1.0_f64.exp()) - 1.0).abs() < 1e-12);
        let squat = Hidden::Squat { x_m: [2.0, 2.0], depth_m: 2e-5, length_m: 6e-3 };
        assert!((at(&squat, 2.0, 0.0) - 2e-5).abs() < 1e-18);
        assert!((at(&squat, 2.0015, 0.0) - 1e-5).abs() < 1e-12 && at(&squat, 2.0031, 0.0) == 0.0);
        let waves = Hidden::Corrugation { x_m: [2.0, 3.0], wavelength_m: 8e-3, amplitude_m: 1e-6 };
        assert!((at(&waves, 2.498, 0.0).abs() - 1e-6).abs() < 1e-12);
        assert_eq!(at(&waves, 1.999, 0.0), 0.0);
        // A wheel that has rolled half a turn more meets its flat half a turn earlier.
        let (flat, turn) = (Hidden::WheelFlat { length_m: 3.5e-3 }, TAU * WHEEL_RADIUS_M);
        let depth = 3.5e-3 * 3.5e-3 / (16.0 * WHEEL_RADIUS_M);
        assert!((at(&flat, turn, 0.0) / depth - 1.0).abs() < 1e-9);
        assert!((at(&flat, 0.5 * turn, 0.5 * turn) / depth - 1.0).abs() < 1e-9);
        assert_eq!(at(&flat, 0.5 * turn, 0.0), 0.0);
        let round = Scene::uniform(40, NOMINAL);
        assert_eq!(shapes(&round, WheelAngle::default(), 2.0), 0.0);
        let oval = Hidden::WheelOutOfRound { order: 2, amplitude_m: 1e-6 };
        assert!((at(&oval, 0.25 * turn, 0.0) + 1e-6).abs() < 1e-12);
    }

    #[test]
    fn a_scene_has_the_shapes_that_it_assumes_and_the_orders_of_its_wheel() {
        let squat = Hidden::Squat { x_m: [2.0, 2.0], depth_m: 2e-5, length_m: 6e-3 };
        let mut scene = Scene { left_out: vec![squat], ..Scene::uniform(40, NOMINAL) };
        scene.assumptions.squat = SquatHollow::Gaussian;
        let at = |scene: &Scene, rolled_m: f64| shapes(scene, WheelAngle { rolled_m }, 2.003);
        assert!((at(&scene, 0.0) - 2e-5 * (-PI).exp()).abs() < 1e-15);
        scene.left_out.clear();
        scene.nuisances.wheel_orders[0].amplitude_m = 1e-6;
        let [one, opposite] = [0.0, 0.5 * TAU * WHEEL_RADIUS_M].map(|it| at(&scene, it));
        assert!(one != 0.0 && (one + opposite).abs() < 1e-18);
    }
}
