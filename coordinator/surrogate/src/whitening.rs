//! The directions in which features tell parameters apart, measured in units of their noise.
//!
//! One case sees one random surface, so that its ln-powers scatter around what its parameters make
//! expected, and the scatter of neighbouring bins is alike. Both are estimated from the training
//! set: a polynomial in the parameters for the expectation, its residuals for the scatter. In
//! units of the scatter, few directions carry all that the parameters do (Fisher's discriminant
//! analysis with a continuous class).

use crate::Error;
use crate::cholesky::Cholesky;
use faer::{Mat, MatRef, Side};

/// Highest total degree of the polynomial that stands for the expected features.
const DEGREE_MAX: usize = 3;
/// Entries per polynomial coefficient below which the degree is lowered.
const ENTRIES_PER_COEFFICIENT: usize = 8;
/// A parameter whose range spans more than this ratio enters by its logarithm: what stiffness and
/// level do to a spectrum saturates or multiplies.
const LOGARITHMIC_FROM: f64 = 4.0;

/// Directions (d x m, m at most `components`), the most telling first, along which the scatter of
/// the centred `features` (n x d) at fixed `parameters` (n x p) has variance one.
///
/// To every bin's scatter `shrinkage` times the mean over the bins is added. Without it the
/// directions make use of every accident of the entries they are learned from; with much of it
/// they become the principal components of the expected features.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] when a parameter is constant or entries are fewer than bins
/// allow; [`Error::NoEigenvalues`].
pub(crate) fn directions(
    features: MatRef<'_, f64>,
    parameters: MatRef<'_, f64>,
    components: usize,
    shrinkage: f64,
) -> Result<Mat<f64>, Error> {
    let (n, d) = (features.nrows(), features.ncols());
    let basis = polynomial(parameters);
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

/// All monomials up to the degree that the number of entries allows, in parameters mapped to
/// [-1, 1] (n x coefficients).
fn polynomial(parameters: MatRef<'_, f64>) -> Mat<f64> {
    let n = parameters.nrows();
    let axes: Vec<Vec<f64>> = parameters
        .col_iter()
        .map(|column| unit_axis(&column.iter().copied().collect::<Vec<_>>()))
        .collect();
    let exponents = (1..=DEGREE_MAX)
        .rev()
        .map(|degree| monomials(axes.len(), degree))
        .find(|m| m.len() * ENTRIES_PER_COEFFICIENT <= n)
        .unwrap_or_else(|| monomials(axes.len(), 1));
    Mat::from_fn(n, exponents.len(), |i, j| {
        exponents[j].iter().map(|&axis| axes[axis][i]).product()
    })
}

fn unit_axis(values: &[f64]) -> Vec<f64> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let logarithmic = low > 0.0 && high / low > LOGARITHMIC_FROM;
    let scale = |v: f64| if logarithmic { v.ln() } else { v };
    let (low, high) = (scale(low), scale(high));
    values.iter().map(|&v| 2.0 * (scale(v) - low) / (high - low) - 1.0).collect()
}

/// Monomials of total degree 0 to `degree`, each as the sorted list of its factors.
fn monomials(axes: usize, degree: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    let mut last = all.clone();
    for _ in 0..degree {
        last = last
            .iter()
            .flat_map(|m: &Vec<usize>| {
                let from = m.last().copied().unwrap_or(0);
                (from..axes).map(move |axis| [m.as_slice(), &[axis]].concat())
            })
            .collect();
        all.extend_from_slice(&last);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_parameters_have_84_monomials_up_to_cubes() {
        assert_eq!(monomials(6, 3).len(), 84);
        assert_eq!(monomials(2, 2), [vec![], vec![0], vec![1], vec![0, 0], vec![0, 1], vec![1, 1]]);
    }

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
