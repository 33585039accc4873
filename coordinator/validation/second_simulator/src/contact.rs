//! The contact of wheel and rail: a Hertzian spring that only pushes.

use tracktwin_parameters::TrackDesign;

/// `F = C d^(3/2)` for an approach `d`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    /// `C` in N/m^1.5.
    coefficient: f64,
}

impl Contact {
    /// Of crossed cylinders, wheel and railhead, as a sphere of their geometric mean radius on a plane.
    pub(crate) fn new(design: &TrackDesign, factor: f64) -> Self {
        let steel = &design.rail;
        let radius_m = (design.wheel.radius_m * design.railhead_radius_m).sqrt();
        let plane = steel.youngs_modulus_pa / (1.0 - steel.poisson * steel.poisson);
        Self { coefficient: factor * 2.0 / 3.0 * plane * radius_m.sqrt() }
    }

    /// Approach in m under a force in N.
    pub(crate) fn approach_m(self, force_n: f64) -> f64 {
        (force_n / self.coefficient).powf(2.0 / 3.0)
    }

    /// Force in N where the approach is `free_m` without it and recedes by `compliance` in m/N with it.
    pub(crate) fn force_n(self, free_m: f64, compliance: f64) -> f64 {
        if free_m <= 0.0 {
            return 0.0;
        }
        // Convex, so Newton comes down from above.
        let slope = compliance * self.coefficient;
        let mut approach = free_m;
        loop {
            let root = approach.sqrt();
            let excess = approach + slope * approach * root - free_m;
            let next = approach - excess / (1.0 + 1.5 * slope * root);
            if next >= approach * (1.0 - 1e-13) {
                return self.coefficient * next * next.max(0.0).sqrt();
            }
            approach = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_satisfies_its_law() {
        let contact = Contact::new(&TrackDesign::v_track(), 1.0);
        assert_eq!(contact.force_n(-1e-6, 1e-9), 0.0);
        for free in [1e-7, 2e-5, 3e-4] {
            let force = contact.force_n(free, 5e-9);
            let approach = free - 5e-9 * force;
            assert!((contact.approach_m(force) / approach - 1.0).abs() < 1e-6, "{free}");
        }
    }
}
