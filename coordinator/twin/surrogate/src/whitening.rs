//! Directions in which features separate parameters, scaled by the standard deviation of their random
//! variation.
//!
//! Every case has one random surface. Its ln-powers therefore deviate from the values expected for its
//! parameters, and the deviations of neighbouring bins are correlated. The training set gives both: a
//! polynomial in the parameters for the expectation, and its residuals for the covariance of the
//! deviations. After whitening by this covariance, few directions carry the whole effect of the parameters
//! (Fisher's discriminant analysis with a continuous class).

use crate::Error;
use crate::cholesky::Cholesky;
use crate::polynomial::Polynomial;
use faer::{Mat, MatRef, Side};

/// Highest total degree of the polynomial in the parameters.
const DEGREE_MAX: usize = 3;

/// Directions (d x m, m at most `components`), sorted by the effect of the parameters, largest first. Along
/// each direction the deviations of the centred `features` (n x d) at fixed `parameters` (n x p) have
/// variance one.
///
/// The function adds `shrinkage` times the mean variance over the bins to the variance of every bin.
/// Without shrinkage the directions overfit the training entries; with large shrinkage they become the
/// principal components of the expected features.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] if a parameter is constant or there are too few entries for the number of
/// bins; [`Error::NoEigenvalues`] if the eigenvalue iteration does not converge.
pub(crate) fn directions(
    features: MatRef<'_, f64>,
    parameters: MatRef<'_, f64>,
    components: usize,
    shrinkage: f64,
) -> Result<Mat<f64>, Error> {
    let (n, d) = (features.nrows(), features.ncols());
    let polynomial = Polynomial::of(parameters, DEGREE_MAX);
    let basis = polynomial.basis(polynomial.unit(parameters).as_ref());
    let normal = Cholesky::new(basis.transpose() * &basis)?;
    let expected = &basis * normal.solve((basis.transpose() * features).as_ref());
    let residual = features - &expected;
    let freedom = (n - basis.ncols()) as f64;
    let mut scatter = residual.transpose() * &residual * faer::Scale(1.0 / freedom);
    let mean_variance = (0..d).map(|i| scatter[(i, i)]).sum::<f64>() / d as f64;
    (0..d).for_each(|i| scatter[(i, i)] += shrinkage * mean_variance);
    let factor = Cholesky::new(scatter)?;
    let telling = factor.half_solve(expected.transpose() * &expected);
    let telling = factor.half_solve(telling.transpose().to_owned());
    let eigen =
        telling.self_adjoint_eigen(Side::Lower).map_err(|_| Error::NoEigenvalues { size: d })?;
    let leading = Mat::from_fn(d, components.min(d), |i, j| eigen.U()[(i, d - 1 - j)]);
    Ok(factor.other_half_solve(leading))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_direction_finds_the_parameter_under_correlated_noise() {
        // Three bins share a noise of size 1; only the second also carries the parameter.
        let noise = |i: usize| (i as f64 * 12.9898).sin() * 2.0;
        let own = |i: usize, j: usize| 0.05 * ((i * 3 + j) as f64 * 78.233).sin();
        let parameter = Mat::from_fn(400, 1, |i, _| 1.0 + (i as f64 * 0.618_034).fract());
        let features = Mat::from_fn(400, 3, |i, j| {
            noise(i) + own(i, j) + if j == 1 { parameter[(i, 0)] - 1.5 } else { 0.0 }
        });
        let v = directions(features.as_ref(), parameter.as_ref(), 1, 1e-3).unwrap();
        let z = &features * &v;
        // Noise common to all bins must cancel: the direction is (-1, 2, -1) but for its length.
        assert!((v[(0, 0)] / v[(1, 0)] + 0.5).abs() < 0.1, "{v:?}");
        assert!((v[(2, 0)] / v[(1, 0)] + 0.5).abs() < 0.1, "{v:?}");
        assert_eq!(z.ncols(), 1);
    }
}
