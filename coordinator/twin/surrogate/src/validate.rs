//! Quality of predictions: cross-validation, scaled errors, coverage.

use crate::cholesky::Cholesky;
use crate::kernel::correlations;
use crate::{
    Error, Factor, Hyperparameters, InputMap, InputScaling, MeanFunction, distances,
    distances_within,
};
use faer::{Mat, MatRef};

/// Cross-validation results: every entry is predicted from the entries outside its own fold.
#[derive(Clone, Debug)]
pub struct Folds {
    /// Target minus prediction, n x p.
    pub errors: Mat<f64>,
    /// Variances of the predictions in units of the signal variance, n values.
    pub variances: Vec<f64>,
}

/// Results of `count` folds (entry `i` belongs to fold `i % count`), each with its own input map and
/// factor.
///
/// A whitened map contains information on the entries that it was fitted to. [`folds`] with the map of all
/// entries would therefore underestimate the errors: by a tenth for 80 bins and 800 entries.
///
/// # Errors
/// The errors of [`InputMap::fit`] and [`Factor::new`].
pub(crate) fn folds_with_own_maps(
    features: MatRef<'_, f64>,
    targets: MatRef<'_, f64>,
    scaling: InputScaling,
    hyperparameters: &[Hyperparameters],
    count: usize,
) -> Result<Vec<Folds>, Error> {
    let (n, p) = (targets.nrows(), targets.ncols());
    let empty = Folds { errors: Mat::zeros(n, p), variances: vec![0.0; n] };
    let mut out = vec![empty; hyperparameters.len()];
    let mean = MeanFunction::around(scaling);
    for fold in 0..count {
        let (held, kept): (Vec<usize>, Vec<usize>) = (0..n).partition(|i| i % count == fold);
        let kept_targets = rows(targets, &kept);
        let kept_features = rows(features, &kept);
        let map = InputMap::fit(scaling, kept_features.as_ref(), kept_targets.as_ref())?;
        let inputs = map.apply(kept_features.as_ref());
        let held_inputs = map.apply(rows(features, &held).as_ref());
        let within = distances_within(inputs.as_ref());
        let away = distances(inputs.as_ref(), held_inputs.as_ref());
        let basis = mean.basis(inputs.as_ref());
        let held_basis = mean.basis(held_inputs.as_ref());
        for (at, folds) in hyperparameters.iter().zip(&mut out) {
            let factor = Factor::new(within.as_ref(), basis.as_ref(), *at)?;
            let fitted = factor.weights(kept_targets.as_ref());
            let predicted = &held_basis * &fitted.coefficients
                + correlations(away.as_ref(), at.length).transpose() * &fitted.weights;
            let variances = factor.variances(away.as_ref(), held_basis.as_ref());
            for (i, &row) in held.iter().enumerate() {
                folds.errors.row_mut(row).copy_from(targets.row(row) - predicted.row(i));
                folds.variances[row] = variances[i];
            }
        }
    }
    Ok(out)
}

fn rows(of: MatRef<'_, f64>, rows: &[usize]) -> Mat<f64> {
    Mat::from_fn(rows.len(), of.ncols(), |i, j| of[(rows[i], j)])
}

/// Results of `count` folds (entry `i` belongs to fold `i % count`) without refitting.
///
/// With `Q` the inverse of the covariance projected against the mean, the errors of fold `F` are `Q_FF⁻¹ (Q
/// y)_F` and their covariance is `Q_FF⁻¹` (Dubrule 1983, eq. 11; Rasmussen & Williams 2006, 5.4.2).
/// `weights` (n x p) are `Q y`. The mean is refitted in every fold; the hyper-parameters are not.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] if the entries outside a fold are too few to determine the mean.
pub fn folds(factor: &Factor, weights: MatRef<'_, f64>, count: usize) -> Result<Folds, Error> {
    let q = factor.projected_inverse();
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

/// Mean absolute error divided by `range` (paper, eq. 11); 0.05 is 5 %.
pub fn mase(truth: &[f64], predicted: &[f64], range: f64) -> f64 {
    let sum: f64 = truth.iter().zip(predicted).map(|(t, p)| (t - p).abs()).sum();
    sum / range / truth.len() as f64
}

/// Share of the true values within `widths` standard deviations of their prediction.
///
/// A 90 % interval has `widths` = 1.645.
pub fn coverage(truth: &[f64], predicted: &[f64], sd: &[f64], widths: f64) -> f64 {
    let inside = truth
        .iter()
        .zip(predicted)
        .zip(sd)
        .filter(|((t, p), sd)| (*t - *p).abs() <= widths * **sd)
        .count();
    inside as f64 / truth.len() as f64
}
