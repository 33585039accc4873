//! The Hertzian spring between wheel and rail.

use tracktwin_parameters::TrackDesign;

/// Change of the approach, relative to it, at which Newton's iteration has converged: a few
/// roundings of a double.
const NEWTON_TOLERANCE: f64 = 1e-14;
/// Newton's steps on a convex scalar function; it takes three to six, more means not-a-number.
const NEWTON_STEPS_MAX: usize = 50;

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

    /// Approach in m that goes with a contact force in N.
    pub fn approach(&self, force_n: f64) -> f64 {
        (force_n / self.coefficient).powf(2.0 / 3.0)
    }

    /// Contact force in N between bodies that would overlap by `overlap_m` without it and that
    /// together give way by `compliance` in m/N: the root of `δ + compliance F(δ) = overlap`.
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

#[cfg(test)]
mod tests {
    use super::*;

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
