//! The exponential kernel.

use crate::exponential::correlate;
use faer::{Mat, MatRef};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Hyper-parameters of a covariance `s² (E(l) + rho I)` with `E = exp(-r / l)`. The signal variance `s²`
/// follows from the data in closed form.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hyperparameters {
    /// Length `l`, in the unit of the distances between inputs.
    pub length: f64,
    /// Ratio `rho` of the noise variance to the signal variance.
    pub noise_ratio: f64,
}

/// Correlation `exp(-r / l)` of two points at a Euclidean `distance` r for a kernel of `length` l (paper,
/// 6.1.2: the exponential kernel; Rasmussen & Williams 2006, eq. 4.18 with nu = 1/2).
pub fn correlation(distance: f64, length: f64) -> f64 {
    (-distance / length).exp()
}

/// Correlations of all `distances`, as a matrix of the same shape.
pub(crate) fn correlations(distances: MatRef<'_, f64>, length: f64) -> Mat<f64> {
    let mut out = distances.to_owned();
    out.as_mut().par_col_iter_mut().for_each(|column| {
        correlate(
            column.try_as_col_major_mut().expect("a matrix of its own").as_slice_mut(),
            length,
        );
    });
    out
}

/// `E + rho I` for the distances of the training inputs; only the lower triangle is filled.
pub(crate) fn covariance(distances: MatRef<'_, f64>, at: Hyperparameters) -> Mat<f64> {
    let n = distances.nrows();
    let mut out = Mat::zeros(n, n);
    out.as_mut().par_col_iter_mut().enumerate().for_each(|(j, column)| {
        let column = column.try_as_col_major_mut().expect("a matrix of its own").as_slice_mut();
        for (entry, &distance) in column[j..].iter_mut().zip(distances.col(j).iter().skip(j)) {
            *entry = distance;
        }
        correlate(&mut column[j..], at.length);
    });
    out.diagonal_mut().column_vector_mut().iter_mut().for_each(|entry| *entry += at.noise_ratio);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_length_away_the_correlation_is_one_over_e() {
        assert_eq!(correlation(3.0, 3.0), (-1.0f64).exp());
        assert_eq!(correlation(0.0, 3.0), 1.0);
    }

    #[test]
    fn the_noise_stands_on_the_diagonal_alone() {
        let distances = Mat::from_fn(3, 3, |i, j| (i as f64 - j as f64).abs());
        let k = covariance(distances.as_ref(), Hyperparameters { length: 2.0, noise_ratio: 0.1 });
        assert_eq!(k[(1, 1)], 1.1);
        // The kernel's own exponential errs by two roundings at most.
        assert!((k[(2, 0)] - (-1.0f64).exp()).abs() < 1e-16);
    }
}
