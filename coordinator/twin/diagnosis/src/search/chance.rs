//! Probability of evidence by chance, from null simulations.

use crate::calibration::Calibration;
use crate::observation::Observation;
use nalgebra::DVector;
use rayon::prelude::*;
use tracktwin_inspection::median;

/// A null simulation relative to a calibration.
pub(super) struct Null {
    /// Whitened difference from the prediction.
    pub(super) residual: DVector<f64>,
    /// Product of the residual with the derivatives.
    pub(super) projected_gradient: DVector<f64>,
}

/// Whitens the differences of null simulations for a calibration.
pub(super) fn whitened(
    nulls: &[DVector<f64>],
    observation: &Observation,
    current: &Calibration,
) -> Vec<Null> {
    let of = |null: &DVector<f64>| {
        let residual = observation.fitted(&observation.whiten(null));
        let projected_gradient = current.jacobian.tr_mul(&residual);
        Null { residual, projected_gradient }
    };
    nulls.par_iter().map(of).collect()
}

/// Ratio, at least one, of the squared residual of the recording to that of null simulations: median over
/// the sleepers, which a local effect does not change.
pub(super) fn excess(current: &Calibration, nulls: &[Null], sleepers: usize) -> f64 {
    let square = |residual: &DVector<f64>| median(squares(residual, sleepers));
    let fitted = |null: &Null| {
        square(
            &(&null.residual
                - &current.jacobian * current.precision.solve(&null.projected_gradient)),
        )
    };
    let usual = median(nulls.par_iter().map(fitted).collect());
    (square(&current.residual) / usual).max(1.0)
}

/// Probability of evidence of at least `found` if nothing is left out. A Gumbel distribution is fitted to
/// the greatest evidence in each null simulation.
pub(super) fn tail_probability(
    nulls: &[Null],
    found: f64,
    greatest: impl Fn(&DVector<f64>, &DVector<f64>) -> Option<f64> + Sync,
) -> f64 {
    let maxima: Vec<f64> = nulls
        .par_iter()
        .filter_map(|null| greatest(&null.residual, &null.projected_gradient))
        .collect();
    gumbel_tail(&maxima, found)
}

/// Probability that a maximum reaches `value`, from a sample of maxima.
fn gumbel_tail(maxima: &[f64], value: f64) -> f64 {
    let count = maxima.len() as f64;
    let mean = maxima.iter().sum::<f64>() / count;
    let variance = maxima.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0);
    // Moments of the distribution exp(-exp(-(x - a) / b)): a + 0.5772 b, pi^2 b^2 / 6.
    let scale = (6.0 * variance).sqrt() / std::f64::consts::PI;
    let location = mean - 0.577_215_664_901_532_9 * scale;
    -(-(-(value - location) / scale).exp()).exp_m1()
}

/// Sum of squares of a whitened residual at each sleeper.
pub(super) fn squares(residual: &DVector<f64>, sleepers: usize) -> Vec<f64> {
    let size = residual.len() / sleepers;
    (0..sleepers).map(|sleeper| residual.rows(sleeper * size, size).norm_squared()).collect()
}
