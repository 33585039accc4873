//! The Hertzian spring between wheel and rail.

use std::f64::consts::{FRAC_PI_4, PI};
use tracktwin_parameters::TrackDesign;

/// Change of the approach, relative to it, at which Newton's iteration has converged: a few
/// roundings of a double.
const NEWTON_TOLERANCE: f64 = 1e-14;
/// Newton's steps on a convex scalar function; it takes three to six, more means not-a-number.
const NEWTON_STEPS_MAX: usize = 50;

/// Exponent of the ratio of the contact ellipse's axes.
const ELLIPSE_EXPONENT: f64 = 0.636;

/// Contact force `F = C_H δ^1.5` of the approach `δ = u_wheel - u_rail - z`, zero on separation
/// (paper, eq. B.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzContact {
    /// Hertzian coefficient `C_H` in N/m^1.5.
    pub coefficient: f64,
}

impl HertzContact {
    /// The contact of the design's wheel and railhead: `C_H = 2 E √R / (3 (1 - ν²))` (paper,
    /// eq. B.5), with the rail's steel for both and the railhead's lateral radius.
    pub fn new(design: &TrackDesign) -> Self {
        let steel = &design.rail;
        let plane_strain = 1.0 - steel.poisson * steel.poisson;
        let root = design.railhead_radius_m.sqrt();
        Self { coefficient: 2.0 * steel.youngs_modulus_pa * root / (3.0 * plane_strain) }
    }

    /// Contact force in N at an approach in m.
    pub fn force(&self, approach_m: f64) -> f64 {
        let compressed = approach_m.max(0.0);
        self.coefficient * compressed * compressed.sqrt()
    }

    /// Approach in m under a contact force in N.
    pub fn approach(&self, force_n: f64) -> f64 {
        (force_n / self.coefficient).powf(2.0 / 3.0)
    }

    /// Slope of the law in N/m under a contact force in N.
    pub fn stiffness(&self, force_n: f64) -> f64 {
        1.5 * force_n / self.approach(force_n)
    }

    /// Contact force in N between two bodies: the root of `δ + compliance F(δ) = overlap`. `overlap_m`
    /// is the overlap of the bodies without contact force; `compliance` in m/N is their common
    /// displacement per unit contact force.
    ///
    /// The function is convex and increasing, and the iteration starts right of the root, so
    /// that Newton's method cannot fail; `None` if the input is not a number.
    pub fn solve(&self, overlap_m: f64, compliance: f64) -> Option<f64> {
        if overlap_m <= 0.0 {
            return Some(0.0);
        }
        let mut approach = overlap_m;
        for _ in 0..NEWTON_STEPS_MAX {
            let root = approach.sqrt();
            let stiffness = self.coefficient * root;
            let residual = approach + compliance * stiffness * approach - overlap_m;
            let change = residual / (1.0 + 1.5 * compliance * stiffness);
            approach -= change;
            if change.abs() <= NEWTON_TOLERANCE * overlap_m {
                return Some(self.force(approach));
            }
        }
        None
    }
}

/// Wave number times half the length of the patch beyond which waves are averaged out: the filter then takes
/// 17 dB.
const AVERAGED: f64 = 4.0;

/// Points per half length of the patch over which a mean is taken, and their reach in half lengths.
const POINTS_PER_HALF_LENGTH: f64 = 4.0;
const REACH: f64 = 8.0;
/// Number of waves for the weights of the points.
const WAVES: usize = 256;

/// The patch over which wheel and rail touch, which averages the irregularity over its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPatch {
    /// Half its length along the rail in m.
    pub half_length_m: f64,
}

impl ContactPatch {
    /// The patch of the design's wheel under its load: an ellipse whose mean radius is that of a sphere of
    /// the same mean curvature, `(3 F R / 4 E*)^(1/3)`, and whose axes have the ratio
    /// `(R_wheel / R_rail)^0.636`.
    ///
    /// Source: K. L. Johnson, Contact Mechanics (1985), chapter 4; the ratio is the approximation of
    /// B. J. Hamrock and D. Brewe (1983).
    pub fn new(design: &TrackDesign) -> Self {
        let steel = &design.rail;
        let modulus_pa = steel.youngs_modulus_pa / (2.0 * (1.0 - steel.poisson * steel.poisson));
        let [wheel_m, rail_m] = [design.wheel.radius_m, design.railhead_radius_m];
        let radius_m = 2.0 / (1.0 / wheel_m + 1.0 / rail_m);
        let mean_m = (0.75 * design.wheel.load_n * radius_m / modulus_pa).cbrt();
        Self { half_length_m: mean_m * (wheel_m / rail_m).powf(0.5 * ELLIPSE_EXPONENT) }
    }

    /// Whether the patch averages out waves of this wave number in rad/m: its filter is the least accurate
    /// part of the model there, and noise may exceed what is left. Such waves are not compared with
    /// recordings.
    pub fn averages_out(&self, wave_number_rad_m: f64) -> bool {
        wave_number_rad_m * self.half_length_m > AVERAGED
    }

    /// Factor on the spectral density of the irregularity at a wave number in rad/m:
    /// `|H|² = 1 / (1 + pi/4 (kappa a)³)` for a half length `a` (Remington 1976).
    pub fn gain(&self, wave_number_rad_m: f64) -> f64 {
        1.0 / (1.0 + FRAC_PI_4 * (wave_number_rad_m * self.half_length_m).powi(3))
    }

    /// Offsets in m and weights of the mean over the patch, whose power response is [`ContactPatch::gain`]; the
    /// weights sum to one.
    pub fn weights(&self) -> Vec<(f64, f64)> {
        let step_m = self.half_length_m / POINTS_PER_HALF_LENGTH;
        let wave_number_step = PI / step_m / WAVES as f64;
        let waves: Vec<(f64, f64)> = (0..WAVES)
            .map(|wave| (wave as f64 + 0.5) * wave_number_step)
            .map(|wave_number| (wave_number, self.gain(wave_number).sqrt()))
            .collect();
        let reach = (REACH * POINTS_PER_HALF_LENGTH) as i32;
        let weight = |point: i32| {
            let offset_m = f64::from(point) * step_m;
            let sum: f64 = waves.iter().map(|(wave, gain)| gain * (wave * offset_m).cos()).sum();
            (offset_m, sum)
        };
        let all: Vec<(f64, f64)> = (-reach..=reach).map(weight).collect();
        let sum: f64 = all.iter().map(|(_, weight)| weight).sum();
        all.into_iter().map(|(offset_m, weight)| (offset_m, weight / sum)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_wheel_on_a_line_touches_over_a_centimetre() {
        // 5 to 8 mm of half length at 60 kN (Thompson 2009).
        let design = tracktwin_parameters::Preset::Concrete60E1.design();
        let patch = ContactPatch::new(&design);
        assert!((5e-3..8e-3).contains(&patch.half_length_m), "{patch:?}");
    }

    #[test]
    fn the_mean_over_a_patch_has_its_response() {
        let patch = ContactPatch { half_length_m: 6e-3 };
        let weights = patch.weights();
        for wavelength_m in [1.0, 0.1, 0.045, 0.03, 0.02, 0.012] {
            let wave_number = TAU / wavelength_m;
            let wave = |(offset_m, weight): &(f64, f64)| weight * (wave_number * offset_m).cos();
            let mean: f64 = weights.iter().map(wave).sum();
            let expected = patch.gain(wave_number).sqrt();
            assert!((mean / expected - 1.0).abs() < 0.02, "{wavelength_m}: {mean} {expected}");
        }
    }

    fn contact() -> HertzContact {
        HertzContact::new(&TrackDesign::v_track())
    }

    #[test]
    fn force_and_approach_are_inverse() {
        let force = contact().force(contact().approach(4500.0));
        assert!((force / 4500.0 - 1.0).abs() < 1e-13, "{force}");
    }

    #[test]
    fn separated_bodies_exchange_no_force() {
        assert_eq!(contact().force(-1e-6), 0.0);
        assert_eq!(contact().solve(-1e-6, 1e-9), Some(0.0));
    }

    #[test]
    fn the_contact_force_closes_the_overlap() {
        for overlap in [1e-12, 1e-8, 1e-5, 1e-3] {
            let force = contact().solve(overlap, 3e-9).unwrap();
            let closed = contact().approach(force) + 3e-9 * force;
            // powf in `approach` is the least exact step here.
            assert!((closed / overlap - 1.0).abs() < 1e-12, "{overlap}: {closed}");
        }
    }

    #[test]
    fn not_a_number_is_not_a_force() {
        assert_eq!(contact().solve(f64::NAN, 1e-9), None);
    }
}
