//! Ritz's method for a half sleeper: polynomials, Gauss's rule, matrices of its energies.

use crate::vtrack::{
    DENSITY_KG_M3, SLEEPER_AREA_M2, SLEEPER_HALF_LENGTH_M, SLEEPER_SECOND_MOMENT_M4,
    SLEEPER_SHEAR_COEFFICIENT, YOUNG_PA, shear_modulus_pa,
};
use nalgebra::{DMatrix, DVector};

/// Polynomials of deflection, and of rotation.
pub(super) const TERMS: usize = 12;
/// Points of Gauss's rule along the half sleeper; exact for products of the polynomials.
const POINTS: usize = 14;
/// Length in m that a crack softens.
const CRACK_LENGTH_M: f64 = 0.02;

/// `E I` of the nominal section in N m2.
pub(super) const fn nominal_bending() -> f64 {
    YOUNG_PA * SLEEPER_SECOND_MOMENT_M4
}

/// Mass and stiffness of the nominal section in the polynomials' coefficients, the mass times a
/// factor.
pub(super) fn energies(bending_factor: f64, mass_factor: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let length = SLEEPER_HALF_LENGTH_M;
    let shear = SLEEPER_SHEAR_COEFFICIENT * shear_modulus_pa() * SLEEPER_AREA_M2;
    let cracked = bending_factor < 1.0;
    let size = 2 * TERMS + usize::from(cracked);
    let mut mass = DMatrix::zeros(size, size);
    let mut stiffness = DMatrix::zeros(size, size);
    let (points, weights) = gauss_points();
    for (&xi, weight) in points.iter().zip(&weights) {
        let [values, slopes] = [legendre(xi), legendre_slopes(xi)];
        let mut deflection = DVector::zeros(size);
        let mut rotation = DVector::zeros(size);
        let mut strain = DVector::zeros(size);
        let mut curvature = DVector::zeros(size);
        for term in 0..TERMS {
            deflection[term] = values[term];
            strain[term] = slopes[term] / length;
            rotation[TERMS + term] = xi * values[term];
            curvature[TERMS + term] = (values[term] + xi * slopes[term]) / length;
        }
        if cracked {
            rotation[2 * TERMS] = 1.0;
        }
        strain -= &rotation;
        let share = weight * length;
        mass += share * DENSITY_KG_M3 * SLEEPER_AREA_M2 * &deflection * deflection.transpose();
        mass += share * DENSITY_KG_M3 * SLEEPER_SECOND_MOMENT_M4 * &rotation * rotation.transpose();
        stiffness += share * nominal_bending() * &curvature * curvature.transpose();
        stiffness += share * shear * &strain * strain.transpose();
    }
    if cracked {
        // Half of the crack's length lies on this side of the symmetry plane.
        let softened = (1.0 / bending_factor - 1.0) * 0.5 * CRACK_LENGTH_M;
        stiffness[(2 * TERMS, 2 * TERMS)] += nominal_bending() / softened;
    }
    (mass_factor * mass, stiffness)
}

/// Legendre polynomials of `2 xi - 1` for `xi` in 0..1.
pub(super) fn legendre(xi: f64) -> [f64; TERMS] {
    let x = 2.0 * xi - 1.0;
    let mut values = [1.0; TERMS];
    values[1] = x;
    for n in 1..TERMS - 1 {
        let order = n as f64;
        values[n + 1] =
            ((2.0 * order + 1.0) * x * values[n] - order * values[n - 1]) / (order + 1.0);
    }
    values
}

/// Their derivatives by `xi`: `P'_{n+1} = P'_{n-1} + (2 n + 1) P_n`, twice for the scale of `x`.
fn legendre_slopes(xi: f64) -> [f64; TERMS] {
    let values = legendre(xi);
    let mut slopes = [0.0; TERMS];
    slopes[1] = 2.0;
    for n in 1..TERMS - 1 {
        slopes[n + 1] = slopes[n - 1] + 2.0 * (2.0 * n as f64 + 1.0) * values[n];
    }
    slopes
}

/// Points of Gauss's rule in 0..1 and their weights, whose sum is one.
pub(super) fn gauss_points() -> (Vec<f64>, Vec<f64>) {
    let count = POINTS as f64;
    (0..POINTS)
        .map(|index| {
            let mut x = (std::f64::consts::PI * (index as f64 + 0.75) / (count + 0.5)).cos();
            let mut slope = 1.0;
            // Newton's method doubles the digits at each step; five are enough for all of them.
            for _ in 0..6 {
                let (mut before, mut value) = (1.0, x);
                for n in 1..POINTS {
                    let order = n as f64;
                    let next = ((2.0 * order + 1.0) * x * value - order * before) / (order + 1.0);
                    (before, value) = (value, next);
                }
                slope = count * (x * value - before) / (x * x - 1.0);
                x -= value / slope;
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_integrates_polynomials_to_degree_27() {
        let (points, weights) = gauss_points();
        let integral: f64 = points.iter().zip(&weights).map(|(x, w)| w * x.powi(27)).sum();
        assert!((28.0 * integral - 1.0).abs() < 1e-13, "{integral}");
    }
}
