//! How good predictions are: folds, scaled errors, coverage.

use crate::cholesky::Cholesky;
use crate::{Error, Factor};
use faer::{Mat, MatRef};

/// What every entry's prediction would have been without the entries of its own fold.
#[derive(Clone, Debug)]
pub struct Folds {
    /// Target minus prediction, n x p.
    pub errors: Mat<f64>,
    /// Variances of the predictions in units of the signal variance, n values.
    pub variances: Vec<f64>,
}

/// Results of `count` folds (entry `i` belongs to fold `i % count`) without refitting.
///
/// With `Q` the inverse of the covariance less the part that the mean takes, the errors of fold
/// `F` are `Q_FF⁻¹ (Q y)_F` and their covariance is `Q_FF⁻¹` (Dubrule 1983, eq. 11; Rasmussen &
/// Williams 2006, 5.4.2). `Q y` are the `weights` (n x p). The mean is refitted in every fold,
/// hyper-parameters stay.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] when a fold holds so many entries that the rest cannot carry the
/// mean.
pub fn folds(factor: &Factor, weights: MatRef<'_, f64>, count: usize) -> Result<Folds, Error> {
    folds_from(factor.projected_inverse().as_ref(), weights, count)
}

/// The same from the lower triangle of `Q`.
pub(crate) fn folds_from(
    q: MatRef<'_, f64>,
    weights: MatRef<'_, f64>,
    count: usize,
) -> Result<Folds, Error> {
    let (n, p) = (weights.nrows(), weights.ncols());
    let mut out = Folds { errors: Mat::zeros(n, p), variances: vec![0.0; n] };
    for fold in 0..count {
        // Ascending, so that the block's lower triangle lies in the lower triangle of the whole.
        let rows: Vec<usize> = (fold..n).step_by(count).collect();
        let size = rows.len();
        let block =
            Mat::from_fn(size, size, |i, j| if i >= j { q[(rows[i], rows[j])] } else { 0.0 });
        let block = Cholesky::new(block)?;
        let errors = block.solve(Mat::from_fn(size, p, |i, j| weights[(rows[i], j)]).as_ref());
        let covariance = block.inverse();
        for (i, &row) in rows.iter().enumerate() {
            out.errors.row_mut(row).copy_from(errors.row(i));
            out.variances[row] = covariance[(i, i)];
        }
    }
    Ok(out)
}

/// Mean absolute error as a share of the range (paper, eq. 11; 0.05 is 5 %).
pub fn mase(truth: &[f64], predicted: &[f64], range: f64) -> f64 {
    let sum: f64 = truth.iter().zip(predicted).map(|(t, p)| (t - p).abs()).sum();
    sum / range / truth.len() as f64
}

/// Share of truths within `widths` standard deviations of their prediction.
///
/// 90 % intervals are 1.645 wide on either side.
pub fn coverage(truth: &[f64], predicted: &[f64], sd: &[f64], widths: f64) -> f64 {
    let inside = truth
        .iter()
        .zip(predicted)
        .zip(sd)
        .filter(|((t, p), sd)| (*t - *p).abs() <= widths * **sd)
        .count();
    inside as f64 / truth.len() as f64
}
