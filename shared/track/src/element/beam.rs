//! Two-node Timoshenko beam element.

use std::array;

/// Matrix over the element's degrees of freedom `w₁ θ₁ w₂ θ₂`.
pub type ElementMatrix = [[f64; 4]; 4];

/// Points and weights of the four-point Gauss rule on (0, 1): exact up to degree seven, and the
/// mass matrix needs six.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A prismatic Timoshenko beam between two nodes.
///
/// Degrees of freedom: `w₁ θ₁ w₂ θ₂`, deflection in m and rotation in rad at both ends, `θ` having
/// the sign of `dw/dx`. The shape functions are the exact static deflections, so that nodal
/// values under nodal loads are exact on any mesh.
///
/// Source: Friedman & Kosmatka 1993; paper, Appendix C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamElement {
    /// Length `L` in m.
    pub length: f64,
    /// Bending stiffness `E I` in N m2.
    pub bending_stiffness: f64,
    /// Shear stiffness `kappa G A` in N.
    pub shear_stiffness: f64,
    /// Mass per length `rho A` in kg/m.
    pub mass_per_length: f64,
    /// Rotary inertia per length `rho I` in kg m.
    pub rotary_inertia_per_length: f64,
}

impl BeamElement {
    /// Ratio of bending to shear flexibility, `phi = 12 E I / (kappa G A L^2)`.
    ///
    /// The paper's line below eq. C.2 is garbled; this is Friedman & Kosmatka's.
    fn shear_ratio(&self) -> f64 {
        12.0 * self.bending_stiffness / (self.shear_stiffness * self.length * self.length)
    }

    /// Stiffness matrix in N/m, N and N m (paper, eq. C.2).
    pub fn stiffness(&self) -> ElementMatrix {
        let (l, phi) = (self.length, self.shear_ratio());
        let (near, far) = ((4.0 + phi) * l * l, (2.0 - phi) * l * l);
        let factor = self.bending_stiffness / ((1.0 + phi) * l.powi(3));
        [
            [12.0, 6.0 * l, -12.0, 6.0 * l],
            [6.0 * l, near, -6.0 * l, far],
            [-12.0, -6.0 * l, 12.0, -6.0 * l],
            [6.0 * l, far, -6.0 * l, near],
        ]
        .map(|row| row.map(|value| factor * value))
    }

    /// Consistent mass matrix in kg, kg m and kg m2: translation and rotation (paper, eq. C.3).
    ///
    /// Integrated from the shape functions, because the printed eq. C.4 repeats rows.
    pub fn mass(&self) -> ElementMatrix {
        let mut mass = [[0.0; 4]; 4];
        for (xi, weight) in GAUSS {
            let (w, theta) = (self.shape(xi), self.rotation_shape(xi));
            let translation = self.mass_per_length * self.length * weight;
            let rotation = self.rotary_inertia_per_length * self.length * weight;
            for i in 0..4 {
                for j in 0..4 {
                    mass[i][j] += translation * (w[i] * w[j]) + rotation * (theta[i] * theta[j]);
                }
            }
        }
        mass
    }

    /// Deflection at `xi = x / L` for a unit value of each degree of freedom (paper, eq. C.6).
    pub fn shape(&self, xi: f64) -> [f64; 4] {
        let (l, phi) = (self.length, self.shear_ratio());
        let cubic = 2.0 * xi.powi(3) - 3.0 * xi * xi - phi * xi;
        [
            cubic + 1.0 + phi,
            l * (xi.powi(3) - (2.0 + 0.5 * phi) * xi * xi + (1.0 + 0.5 * phi) * xi),
            -cubic,
            l * (xi.powi(3) - (1.0 - 0.5 * phi) * xi * xi - 0.5 * phi * xi),
        ]
        .map(|value| value / (1.0 + phi))
    }

    /// Rotation at `xi = x / L` for a unit value of each degree of freedom (paper, eq. C.7).
    pub fn rotation_shape(&self, xi: f64) -> [f64; 4] {
        let (l, phi) = (self.length, self.shear_ratio());
        let quadratic = 6.0 * (xi * xi - xi) / l;
        [
            quadratic,
            3.0 * xi * xi - (4.0 + phi) * xi + 1.0 + phi,
            -quadratic,
            3.0 * xi * xi - (2.0 - phi) * xi,
        ]
        .map(|value| value / (1.0 + phi))
    }

    /// Deflection in m/N under a unit force at `xi = x / L` with both ends clamped.
    ///
    /// The shape functions omit this part of the deflection below a load inside the element. The value
    /// follows from a split of the element at the load and is statically exact.
    pub fn clamped_flexibility(&self, xi: f64) -> f64 {
        let (left, right) = (xi * self.length, (1.0 - xi) * self.length);
        // Shorter than a millionth of the element the part is as stiff as the clamp.
        if left.min(right) < 1e-6 * self.length {
            return 0.0;
        }
        let before = Self { length: left, ..*self }.stiffness();
        let after = Self { length: right, ..*self }.stiffness();
        let sum: [[f64; 2]; 2] =
            array::from_fn(|i| array::from_fn(|j| before[i + 2][j + 2] + after[i][j]));
        sum[1][1] / (sum[0][0] * sum[1][1] - sum[0][1] * sum[1][0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stocky beam, so that bending and shear both matter.
    fn beam() -> BeamElement {
        BeamElement {
            length: 0.125,
            bending_stiffness: 1.08e5,
            shear_stiffness: 2.4e7,
            mass_per_length: 6.7,
            rotary_inertia_per_length: 4.0e-3,
        }
    }

    #[test]
    fn one_element_gives_the_exact_deflection_of_a_cantilever() {
        let beam = beam();
        let k = beam.stiffness();
        let tip = k[3][3] / (k[2][2] * k[3][3] - k[2][3] * k[3][2]);
        let l = beam.length;
        let exact = l.powi(3) / (3.0 * beam.bending_stiffness) + l / beam.shear_stiffness;
        // Rounding of a 2x2 inverse only.
        assert!((tip / exact - 1.0).abs() < 1e-12, "{tip} against {exact}");
    }

    #[test]
    fn a_rigid_translation_moves_the_whole_mass() {
        let mass = beam().mass();
        let total = mass[0][0] + mass[0][2] + mass[2][0] + mass[2][2];
        let exact = beam().mass_per_length * beam().length;
        assert!((total / exact - 1.0).abs() < 1e-12, "{total} against {exact}");
    }

    #[test]
    fn a_rigid_rotation_has_the_moment_of_inertia_of_a_rod() {
        let (beam, mass) = (beam(), beam().mass());
        let about_left = [0.0, 1.0, beam.length, 1.0];
        let inertia: f64 = (0..4)
            .flat_map(|i| (0..4).map(move |j| (i, j)))
            .map(|(i, j)| about_left[i] * mass[i][j] * about_left[j])
            .sum();
        let exact = beam.mass_per_length * beam.length.powi(3) / 3.0
            + beam.rotary_inertia_per_length * beam.length;
        assert!((inertia / exact - 1.0).abs() < 1e-12, "{inertia} against {exact}");
    }

    #[test]
    fn the_mass_matrix_is_friedman_and_kosmatkas() {
        // Entries of eq. C.4 and C.5 that survived the printing.
        let (beam, mass) = (beam(), beam().mass());
        let (l, phi) = (beam.length, beam.shear_ratio());
        let translation = beam.mass_per_length * l / (210.0 * (1.0 + phi).powi(2));
        let rotation = beam.rotary_inertia_per_length / (30.0 * (1.0 + phi).powi(2) * l);
        let first = translation * (70.0 * phi * phi + 147.0 * phi + 78.0) + rotation * 36.0;
        let coupling = -translation * (35.0 * phi * phi + 63.0 * phi + 26.0) * l / 4.0
            - rotation * (15.0 * phi - 3.0) * l;
        assert!((mass[0][0] / first - 1.0).abs() < 1e-12);
        assert!((mass[0][3] / coupling - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_clamped_flexibility_at_midspan_is_the_textbooks() {
        let beam = beam();
        let l = beam.length;
        let exact = l.powi(3) / (192.0 * beam.bending_stiffness) + l / (4.0 * beam.shear_stiffness);
        assert!((beam.clamped_flexibility(0.5) / exact - 1.0).abs() < 1e-12);
        assert_eq!(beam.clamped_flexibility(0.0), 0.0);
        assert_eq!(beam.clamped_flexibility(1.0), 0.0);
    }

    #[test]
    fn shape_functions_reproduce_a_rigid_motion() {
        let beam = beam();
        for xi in [0.0, 0.2, 0.7, 1.0] {
            let (w, theta) = (beam.shape(xi), beam.rotation_shape(xi));
            assert!((w[0] + w[2] - 1.0).abs() < 1e-14);
            let rotated = w[1] + beam.length * w[2] + w[3];
            assert!((rotated - xi * beam.length).abs() < 1e-14);
            assert!((theta[1] + beam.length * theta[2] + theta[3] - 1.0).abs() < 1e-12);
        }
    }
}
