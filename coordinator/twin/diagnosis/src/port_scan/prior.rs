//! Priors of an unknown dynamic stiffness.

use super::bumps::BUMPS;
use nalgebra::DMatrix;

/// Prior standard deviations of a height relative to the local stiffness of the track.
const SCALES: [f64; 3] = [0.1, 0.3, 1.0];

/// Prior correlations of neighbouring basis functions: zero for a resonance, high for a spring or a mass.
const CORRELATIONS: [f64; 2] = [0.0, 0.9];

/// Normal prior of the heights of the basis functions.
pub(super) struct Prior {
    pub(super) precision: DMatrix<f64>,
    /// Half the logarithm of the determinant of the precision.
    pub(super) half_ln_determinant: f64,
}

impl Prior {
    /// All pairs of [`SCALES`] and [`CORRELATIONS`].
    pub(super) fn all() -> Vec<Self> {
        let of_scale = |scale| CORRELATIONS.map(|correlation| Self::new(scale, correlation));
        SCALES.into_iter().flat_map(of_scale).collect()
    }

    /// Real and imaginary parts that are each an autoregressive process over the bumps.
    fn new(scale: f64, correlation: f64) -> Self {
        let innovation = 1.0 - correlation * correlation;
        let weight = 1.0 / (scale * scale * innovation);
        let ends = |bump: usize| bump == 0 || bump == BUMPS - 1;
        let precision = DMatrix::from_fn(2 * BUMPS, 2 * BUMPS, |i, j| match i.abs_diff(j) {
            0 if ends(i / 2) => weight,
            0 => weight * (1.0 + correlation * correlation),
            2 => -weight * correlation,
            _ => 0.0,
        });
        let half_ln_determinant =
            -((2 * BUMPS) as f64 * scale.ln() + (BUMPS - 1) as f64 * innovation.ln());
        Self { precision, half_ln_determinant }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Cholesky;

    #[test]
    fn a_prior_is_that_of_heights_that_hang_together() {
        let (scale, correlation) = (0.3, 0.9);
        let Prior { precision, half_ln_determinant } = Prior::new(scale, correlation);
        let covariance = DMatrix::from_fn(2 * BUMPS, 2 * BUMPS, |i, j| {
            let apart = (i / 2).abs_diff(j / 2) as f64;
            if i % 2 == j % 2 { scale * scale * correlation.powf(apart) } else { 0.0 }
        });
        let identity = DMatrix::<f64>::identity(2 * BUMPS, 2 * BUMPS);
        assert!((&precision * &covariance - identity).amax() < 1e-10);
        let half = 0.5 * Cholesky::new(precision).unwrap().ln_determinant();
        assert!((half_ln_determinant - half).abs() < 1e-9, "{half_ln_determinant} {half}");
    }
}
