//! The irregularity of the railhead: spectrum, seed, and height at every place.
//!
//! This module implements eq. B.6 and the synthesis of a surface. The module `time` simulates the wheel
//! on the surface.

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rustfft::FftPlannerScalar;
use std::f64::consts::TAU;
use std::sync::Arc;
use tracktwin_parameters::unit;

/// Factor `k` of eq. B.6.
const SPECTRUM_FACTOR: f64 = 0.25;

/// Cut-off wave number `Omega_c` of eq. B.6 in rad/m.
const CUTOFF_RAD_M: f64 = 0.8242;

/// Level 1 in m2 rad/m: levels are normalised to 1..5 (paper, Table D1).
const LEVEL_UNIT: f64 = 1e-4;

/// Grid points on the shortest wave.
///
/// Of a wave with `n` points the cubic spline turns `1/(n-1)^4 + 1/(n+1)^4` into its images beyond
/// the grid: 1.4 % of the shortest, 0.1 % of one half as long again, far less of all others.
const POINTS_PER_SHORTEST_WAVE: f64 = 4.0;

/// Distribution of random surfaces: the spectrum of the paper at a level, between two wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness {
    /// Level `A_irr` in 1e-4 m2 rad/m.
    pub level: f64,
    /// Shortest wavelength in m.
    pub shortest_m: f64,
    /// Longest wavelength in m.
    pub longest_m: f64,
}

impl Roughness {
    /// The spectrum at a level, with the wavelengths 0.25 mm to 1 m.
    ///
    /// At 7 km/h the shortest wave passes at 7.8 kHz, at 13 km/h the longest at 3.6 Hz. Waves from
    /// 0.5 mm would end at 3.9 kHz at 7 km/h, inside the one-third octave of 4 kHz.
    pub const fn new(level: f64) -> Self {
        Self { level, shortest_m: 0.25e-3, longest_m: 1.0 }
    }

    /// The spectrum at a level, with wavelengths from the shortest to the longest in m.
    pub const fn between(level: f64, [shortest_m, longest_m]: [f64; 2]) -> Self {
        Self { level, shortest_m, longest_m }
    }

    /// One-sided power spectral density `S` in m2/(rad/m) at a wave number in rad/m: its integral
    /// over positive wave numbers is the mean square of the height.
    ///
    /// Source: paper, eq. B.6; zero outside the band of wavelengths.
    pub fn density(&self, wave_number_rad_m: f64) -> f64 {
        let band = TAU / self.longest_m..=TAU / self.shortest_m;
        if !band.contains(&wave_number_rad_m) {
            return 0.0;
        }
        let (omega, cutoff) = (wave_number_rad_m.powi(2), CUTOFF_RAD_M.powi(2));
        SPECTRUM_FACTOR * LEVEL_UNIT * self.level * cutoff / ((omega + cutoff) * omega)
    }

    /// The surface of this seed from 0 to at least `length_m`.
    ///
    /// A sum of cosines of random phase and of amplitude `sqrt(2 S dOmega)`, one for each harmonic
    /// of a period that holds `length_m`. Seed, length and wavelengths fix the surface; the level
    /// only scales it.
    pub fn surface(&self, seed: u64, length_m: f64) -> Surface {
        self.shaped_surface(seed, length_m, |_| 1.0)
    }

    /// The surface of this seed whose spectral density is `gain` times eq. B.6. The argument of `gain`
    /// is a wave number in rad/m.
    ///
    /// The phases are those of [`Roughness::surface`]: a gain of one gives the same surface.
    pub fn shaped_surface(&self, seed: u64, length_m: f64, gain: impl Fn(f64) -> f64) -> Surface {
        let step_m = self.shortest_m / POINTS_PER_SHORTEST_WAVE;
        let points = grid_points(length_m / step_m);
        let wave_number_step = TAU / (points as f64 * step_m);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut harmonics = vec![Complex64::ZERO; points];
        for (index, harmonic) in harmonics.iter_mut().enumerate().take(points / 2).skip(1) {
            let wave_number = index as f64 * wave_number_step;
            if wave_number > TAU / self.shortest_m {
                break;
            }
            let density = self.density(wave_number) * gain(wave_number);
            let amplitude = (2.0 * density * wave_number_step).sqrt();
            let phase = TAU * unit(random.next_u64());
            *harmonic = Complex64::from_polar(amplitude / spline_gain(wave_number * step_m), phase);
        }
        // The portable planner: the same bits on every processor.
        FftPlannerScalar::new().plan_fft_inverse(points).process(&mut harmonics);
        let coefficients = harmonics.iter().map(|value| value.re).collect();
        Surface { step_m, coefficients }
    }
}

/// Height of the rail's surface along the track, twice continuously differentiable.
///
/// **Sign**: positive downwards, like every displacement. Wheel and rail approach each other by
/// `u_wheel - u_rail - z`, so that a bump is negative. It repeats itself beyond its length.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Distance between the knots in m.
    step_m: f64,
    /// Coefficients of a periodic cubic B-spline in m.
    coefficients: Arc<[f64]>,
}

impl Surface {
    /// A surface without irregularity.
    pub fn smooth() -> Self {
        Self { step_m: 1.0, coefficients: Arc::from([0.0]) }
    }

    /// The paper's surface of this seed and level `A_irr` (in 1e-4 m2 rad/m), from 0 to at least
    /// `length_m`; see [`Roughness::surface`].
    pub fn rough(seed: u64, level: f64, length_m: f64) -> Self {
        Roughness::new(level).surface(seed, length_m)
    }

    /// The surface with a `share` (0..1) of its power replaced by the power of an independent surface.
    /// The mean level does not change.
    ///
    /// # Panics
    /// If the two surfaces have different lengths or wavelengths.
    #[must_use]
    pub fn blend(&self, independent: &Self, share: f64) -> Self {
        assert_eq!(self.coefficients.len(), independent.coefficients.len(), "unequal surfaces");
        assert!(self.step_m.total_cmp(&independent.step_m).is_eq(), "unequal surfaces");
        let (kept, fresh) = ((1.0 - share).sqrt(), share.sqrt());
        let pairs = self.coefficients.iter().zip(&*independent.coefficients);
        let coefficients = pairs.map(|(a, b)| kept * a + fresh * b).collect();
        Self { step_m: self.step_m, coefficients }
    }

    /// Height in m at the place `x_m`, positive downwards.
    pub fn height(&self, x_m: f64) -> f64 {
        let count = self.coefficients.len();
        let mut place = x_m / self.step_m;
        if !(0.0..count as f64).contains(&place) {
            place = place.rem_euclid(count as f64);
        }
        let knot = place as usize;
        let weights = spline_weights(place - knot as f64);
        if let Some(four) =
            knot.checked_sub(1).and_then(|first| self.coefficients.get(first..first + 4))
        {
            return weights.iter().zip(four).map(|(w, coefficient)| w * coefficient).sum();
        }
        let around = knot + count - 1..;
        weights.iter().zip(around).map(|(w, index)| w * self.coefficients[index % count]).sum()
    }
}

/// Weights of four neighbouring coefficients, a fraction `t` of the step after the second.
fn spline_weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    let weights =
        [s * s * s, 4.0 - 3.0 * t * t * (2.0 - t), 4.0 - 3.0 * s * s * (2.0 - s), t * t * t];
    weights.map(|weight| weight / 6.0)
}

/// Height at the knots over coefficient, for a wave of that phase a step: dividing by it makes the
/// spline pass through the wave at its knots.
fn spline_gain(phase_per_step: f64) -> f64 {
    (2.0 + phase_per_step.cos()) / 3.0
}

/// The next length `2^n` or `3 * 2^n`, which the transform handles fast.
fn grid_points(at_least: f64) -> usize {
    let points = (at_least.ceil() as usize).max(4).next_power_of_two();
    if points as f64 * 0.75 >= at_least { points / 4 * 3 } else { points }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Length of 40 V-Track spans in m.
    const LENGTH_M: f64 = 5.0;

    /// Complex amplitude of the wave of `waves` periods over the surface's own period.
    fn amplitude(surface: &Surface, waves: usize) -> Complex64 {
        let count = 4 * surface.coefficients.len();
        let step_m = surface.step_m / 4.0;
        (0..count)
            .map(|index| {
                let phase = -TAU * (waves * index % count) as f64 / count as f64;
                surface.height(index as f64 * step_m) * Complex64::cis(phase)
            })
            .sum::<Complex64>()
            * (2.0 / count as f64)
    }

    #[test]
    fn the_periodogram_is_equation_b6() {
        let roughness = Roughness::new(3.0);
        let surface = roughness.surface(1, LENGTH_M);
        let period_m = surface.step_m * surface.coefficients.len() as f64;
        for wavelength_m in [0.5, 0.1, 31e-3, 6e-3, 0.7e-3] {
            let waves = (period_m / wavelength_m).round();
            let wave_number = TAU * waves / period_m;
            let power = amplitude(&surface, waves as usize).norm_sqr() / 2.0;
            let density = power / (TAU / period_m);
            let expected = 0.25 * 3e-4 * 0.8242_f64.powi(2)
                / ((wave_number.powi(2) + 0.8242_f64.powi(2)) * wave_number.powi(2));
            // The spline's error at its shortest waves, twice because of the square.
            assert!(
                (density / expected - 1.0).abs() < 1e-3,
                "{wavelength_m}: {}",
                density / expected
            );
        }
    }

    #[test]
    fn waves_outside_the_band_are_absent() {
        let surface = Surface::rough(1, 3.0, LENGTH_M);
        let period_m = surface.step_m * surface.coefficients.len() as f64;
        let inside = amplitude(&surface, (period_m / 0.3e-3) as usize).norm();
        let outside = amplitude(&surface, (period_m / 0.2e-3) as usize).norm();
        assert!(outside < 1e-6 * inside, "{outside} of {inside}");
        assert!(amplitude(&surface, (period_m / 1.5) as usize).norm() < 1e-15);
    }

    #[test]
    fn the_spline_passes_through_a_wave_between_its_knots() {
        let coefficients: Vec<f64> = (0..16)
            .map(|index| (TAU * f64::from(index) / 16.0).sin() / spline_gain(TAU / 16.0))
            .collect();
        let surface = Surface { step_m: 1.0, coefficients: coefficients.into() };
        let error = |x: f64| (surface.height(x) - (TAU * x / 16.0).sin()).abs();
        // The two nearest images hold (1/15)^4 + (1/17)^4 = 3.2e-5 of the wave, and the wave lacks
        // as much: together 6.4e-5 between the knots, nothing at them.
        assert!((0..160).map(|i| error(f64::from(i) / 10.0)).fold(0.0, f64::max) < 6.5e-5);
        assert!((-16..32).map(|i| error(f64::from(i))).fold(0.0, f64::max) < 1e-14);
    }

    #[test]
    fn a_seed_gives_the_same_surface_again_and_another_seed_another() {
        let heights = |seed| {
            let surface = Surface::rough(seed, 3.0, LENGTH_M);
            (0..5000).map(|i| surface.height(f64::from(i) * 1e-3)).collect::<Vec<f64>>()
        };
        let (one, again, other) = (heights(1), heights(1), heights(2));
        assert_eq!(one, again);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let correlation = dot(&one, &other) / (dot(&one, &one) * dot(&other, &other)).sqrt();
        // A handful of metre-long waves holds nearly all the power: independent surfaces correlate
        // by chance up to about a half.
        assert!(correlation.abs() < 0.7, "{correlation}");
    }

    #[test]
    fn height_grows_with_the_root_of_the_level() {
        let (low, high) = (Surface::rough(5, 1.0, LENGTH_M), Surface::rough(5, 4.0, LENGTH_M));
        for x in [0.1, 1.234_567, 4.9] {
            assert!((high.height(x) / low.height(x) - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn blending_keeps_the_mean_power() {
        let waves = 300;
        let mean_power = |share: f64| {
            (0..20)
                .map(|seed| {
                    let surface = Surface::rough(seed, 3.0, 0.5);
                    let other = Surface::rough(1000 + seed, 3.0, 0.5);
                    amplitude(&surface.blend(&other, share), waves).norm_sqr()
                })
                .sum::<f64>()
        };
        let ratio = mean_power(0.05) / mean_power(0.0);
        // Twenty cross terms of relative size 2 sqrt(0.05) cos(phase): 0.07 is one deviation.
        assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
        assert!((ratio - 1.0).abs() > 1e-6, "something must be blended in");
    }

    #[test]
    fn a_smooth_surface_is_flat() {
        assert_eq!([-1.0, 0.0, 2.5].map(|x| Surface::smooth().height(x)), [0.0; 3]);
    }
}
