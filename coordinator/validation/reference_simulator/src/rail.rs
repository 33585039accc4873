//! The rail: sine modes of a simply supported Timoshenko beam, and their residual flexibility.

use crate::system::LinearSystem;
use crate::vtrack::{
    DENSITY_KG_M3, RAIL_AREA_M2, RAIL_SECOND_MOMENT_M4, RAIL_SHEAR_COEFFICIENT, YOUNG_PA,
    shear_modulus_pa,
};
use std::f64::consts::PI;

/// Distance in m beyond which the cut modes say nothing that matters, and over which they fade.
const REACH_M: f64 = 0.25;
const FADE_M: f64 = 0.05;
/// Knots of the table of residual flexibility to a metre, and terms of its sums over kept modes.
const KNOTS_PER_M: f64 = 4000.0;
const TERMS: usize = 30;

/// Stiffness and inertia of the rail's section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossSection {
    /// `E I` in N m2.
    pub(crate) bending: f64,
    /// `kappa G A` in N.
    pub(crate) shear: f64,
    /// `rho A` in kg/m.
    pub(crate) mass: f64,
    /// `rho I` in kg m.
    pub(crate) rotary: f64,
}

/// The rail S7.
pub(crate) const fn cross_section() -> CrossSection {
    CrossSection {
        bending: YOUNG_PA * RAIL_SECOND_MOMENT_M4,
        shear: RAIL_SHEAR_COEFFICIENT * shear_modulus_pa() * RAIL_AREA_M2,
        mass: DENSITY_KG_M3 * RAIL_AREA_M2,
        rotary: DENSITY_KG_M3 * RAIL_SECOND_MOMENT_M4,
    }
}

/// The modes `w = sin k x`, `theta = r cos k x` with `k = n pi / L` of the branch that bends.
///
/// They are exact for a uniform beam (Timoshenko 1921). The branch that shears, above 12 kHz, and
/// all shorter waves give way as if they had no inertia: the residual flexibility.
#[derive(Clone, Debug)]
pub(crate) struct RailModes {
    length_m: f64,
    /// `k` in rad/m.
    pub(crate) wave_numbers: Vec<f64>,
    /// Angular frequency in rad/s.
    pub(crate) frequencies: Vec<f64>,
    /// Modal mass in kg.
    pub(crate) masses: Vec<f64>,
    /// Rotation over deflection `r` in rad/m.
    pub(crate) rotations: Vec<f64>,
    /// Residual flexibility `g` in m/N at evenly spaced distances.
    residual: Vec<f64>,
}

impl RailModes {
    /// The first `count` modes of a rail of this length in m.
    pub(crate) fn new(length_m: f64, count: usize) -> Self {
        let wave_numbers: Vec<f64> = (1..=count).map(|n| n as f64 * PI / length_m).collect();
        let (mut frequencies, mut masses, mut rotations) = (vec![], vec![], vec![]);
        for &k in &wave_numbers {
            let CrossSection { shear, mass, rotary, .. } = cross_section();
            let square = frequency_squared(k);
            let rotation = (shear * k * k - mass * square) / (shear * k);
            frequencies.push(square.sqrt());
            rotations.push(rotation);
            masses.push(0.5 * length_m * (mass + rotary * rotation * rotation));
        }
        let mut modes =
            Self { length_m, wave_numbers, frequencies, masses, rotations, residual: vec![] };
        modes.residual = modes.residual_table();
        modes
    }

    /// Number of modes.
    pub(crate) fn count(&self) -> usize {
        self.wave_numbers.len()
    }

    /// Deflection of every mode at a place in m.
    pub(crate) fn deflections(&self, x_m: f64) -> Vec<f64> {
        self.wave_numbers.iter().map(|k| (k * x_m).sin()).collect()
    }

    /// Rotation of every mode at a place in m.
    pub(crate) fn rotations_at(&self, x_m: f64) -> Vec<f64> {
        let modes = self.wave_numbers.iter().zip(&self.rotations);
        modes.map(|(k, rotation)| rotation * (k * x_m).cos()).collect()
    }

    /// Mean curvature `theta'` of every mode over a length around a place, both in m.
    pub(crate) fn curvatures(&self, x_m: f64, length_m: f64) -> Vec<f64> {
        let modes = self.wave_numbers.iter().zip(&self.rotations);
        modes
            .map(|(k, rotation)| -rotation * k * (k * x_m).sin() * mean_wave(*k, length_m))
            .collect()
    }

    /// Static flexibility of the modes between two ports, `sum a_n b_n / (m_n omega_n²)`.
    pub(crate) fn flexibility(&self, a: &[f64], b: &[f64]) -> f64 {
        let terms = self.masses.iter().zip(&self.frequencies).zip(a.iter().zip(b));
        terms.map(|((mass, omega), (a, b))| a * b / (mass * omega * omega)).sum()
    }

    /// Receptance of the rail without supports, in m/N: real part only, for tests of the modes.
    #[cfg(test)]
    fn receptance(&self, a: &[f64], b: &[f64], omega: f64) -> f64 {
        let terms = self.masses.iter().zip(&self.frequencies).zip(a.iter().zip(b));
        terms.map(|((mass, own), (a, b))| a * b / (mass * (own * own - omega * omega))).sum()
    }

    /// One oscillator a mode, by its damping over critical damping and the time step in s.
    pub(crate) fn oscillators(&self, damping_ratio: f64, step_s: f64) -> Vec<LinearSystem> {
        let modes = self.masses.iter().zip(&self.frequencies);
        let oscillator = |(&mass, &omega): (&f64, &f64)| {
            let damping = 2.0 * damping_ratio * mass * omega;
            LinearSystem::oscillator(mass, damping, mass * omega * omega, step_s)
        };
        modes.map(oscillator).collect()
    }

    /// Static deflection in m/N at one place under a force at another, so far apart in m, that the
    /// modes leave out.
    ///
    /// What the ends of the track reflect of it is left out too: it dies out within 0.25 m.
    pub(crate) fn residual_flexibility(&self, distance_m: f64) -> f64 {
        let place = distance_m.abs() * KNOTS_PER_M;
        let knot = place as usize;
        if knot + 1 >= self.residual.len() {
            return 0.0;
        }
        let share = place - knot as f64;
        (1.0 - share) * self.residual[knot] + share * self.residual[knot + 1]
    }

    /// `g(d) = 1/L sum (s_n - L / (2 m_n omega_n²)) cos k_n d`, the second term for kept modes
    /// only, with the static flexibility `s_n = 1/(kappa G A k²) + 1/(E I k⁴)` of a wave.
    ///
    /// With it `g(x - y) - g(x + y)` is the exact static flexibility less that of the modes.
    fn residual_table(&self) -> Vec<f64> {
        let CrossSection { bending, shear, .. } = cross_section();
        let terms: Vec<(f64, f64)> = (1..=TERMS * self.count())
            .map(|n| {
                let k = n as f64 * PI / self.length_m;
                let all = 1.0 / (shear * k * k) + 1.0 / (bending * k.powi(4));
                let kept = self.masses.get(n - 1).map_or(0.0, |mass| {
                    0.5 * self.length_m / (mass * self.frequencies[n - 1].powi(2))
                });
                (k, (all - kept) / self.length_m)
            })
            .collect();
        let knots = (REACH_M * KNOTS_PER_M) as usize;
        let value = |knot: usize| {
            let distance_m = knot as f64 / KNOTS_PER_M;
            let fade = ((REACH_M - distance_m) / FADE_M).min(1.0);
            fade * terms.iter().map(|(k, term)| term * (k * distance_m).cos()).sum::<f64>()
        };
        (0..=knots).map(value).collect()
    }
}

/// Smaller root `omega²` of the wave number's two frequencies:
/// `rho A rho I w⁴ - (rho A (E I k² + kappa G A) + rho I kappa G A k²) w² + kappa G A E I k⁴ = 0`.
fn frequency_squared(k: f64) -> f64 {
    let CrossSection { bending, shear, mass, rotary } = cross_section();
    let linear = mass * (bending * k * k + shear) + rotary * shear * k * k;
    let constant = shear * bending * k.powi(4);
    // The form that doesn't lose digits where the roots are far apart.
    2.0 * constant / (linear + (linear * linear - 4.0 * mass * rotary * constant).sqrt())
}

/// Mean of a wave over a length centred at its crest.
fn mean_wave(k: f64, length_m: f64) -> f64 {
    let half = 0.5 * k * length_m;
    if half == 0.0 { 1.0 } else { half.sin() / half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_waves_are_those_of_a_slender_beam() {
        let CrossSection { bending, mass, .. } = cross_section();
        let k: f64 = 0.3;
        let slender = bending / mass * k.powi(4);
        // Shear and rotary inertia take (E I / kappa G A + I / A) k² = 0.5 per mille.
        assert!((frequency_squared(k) / slender - 1.0).abs() < 1e-3);
    }

    #[test]
    fn modes_and_residual_give_the_static_deflection_at_midspan_and_beside() {
        let length: f64 = 5.0;
        let CrossSection { bending, shear, .. } = cross_section();
        let midspan = length.powi(3) / (48.0 * bending) + length / (4.0 * shear);
        for count in [80, 240] {
            let modes = RailModes::new(length, count);
            let middle = modes.deflections(2.5);
            let modal = modes.flexibility(&middle, &middle);
            let full = modal + modes.residual_flexibility(0.0);
            // The sums of the table end at 30 times the kept modes: 1/30 of the residual is left.
            let left = 0.05 * modes.residual_flexibility(0.0);
            assert!((full - midspan).abs() < left, "{full} against {midspan}");
            assert!((modal - midspan).abs() > left, "the modes alone leave more out");
        }
    }

    #[test]
    fn the_rail_has_the_receptance_of_an_infinite_one_above_6_khz_between_its_own_resonances() {
        // Without damping and supports the beam's receptance swings about that of the infinite
        // one; at the frequency where its reflected waves stand in quadrature, both agree. So the
        // mean over many resonances, of |alpha| in logarithm, is compared.
        let modes = RailModes::new(40.0, 1200);
        let middle = modes.deflections(20.013);
        let mut sum = 0.0;
        let count = 1000;
        for index in 0..count {
            let omega = 2.0 * PI * (6e3 + 1.0 * f64::from(index));
            let own = modes.receptance(&middle, &middle, omega) + modes.residual_flexibility(0.0);
            sum += own.abs().ln() / f64::from(count);
        }
        let infinite = infinite_receptance(2.0 * PI * 6.5e3).ln();
        // Chance of 1000 places on some hundred resonances: a few per cent.
        assert!((sum - infinite).abs() < 0.35, "{sum} against {infinite}");
    }

    /// Point receptance of an infinite Timoshenko rail below its second cut-on, its modulus: from
    /// the roots of the dispersion relation, one wave that runs and one that decays.
    fn infinite_receptance(omega: f64) -> f64 {
        let CrossSection { bending, shear, mass, rotary } = cross_section();
        let square = omega * omega;
        // E I kGA k⁴ - (rho A E I + rho I kGA) w² k² + rho A w² (rho I w² - kGA) = 0, times -1.
        let (a, b) = (bending * shear, -(mass * bending + rotary * shear) * square);
        let c = mass * square * (rotary * square - shear);
        let root = (b * b - 4.0 * a * c).sqrt();
        let running = ((-b + root) / (2.0 * a)).sqrt();
        let decaying = ((root + b) / (2.0 * a)).sqrt();
        // alpha = sum over roots of (E I k² + kGA - rho I w²) / (d/dk of the determinant), i.
        let numerator = |k2: f64| bending * k2 + shear - rotary * square;
        let split = 2.0 * a * (running.powi(2) + decaying.powi(2));
        let real = -numerator(-decaying * decaying) / (split * decaying);
        let imaginary = numerator(running * running) / (split * running);
        real.hypot(imaginary)
    }
}
