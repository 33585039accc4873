//! Observed log powers and their covariance.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Log powers of the compared sleepers, in the order of [`crate::Forward`], with their covariance. Some of
/// them may be held out from fitting.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Log powers minus the offset between mean and expected log power.
    log_power: DVector<f64>,
    /// Order in which the log powers of a sleeper are whitened; the fitted ones come first.
    order: Vec<usize>,
    /// Number of fitted log powers per sleeper.
    fitted: usize,
    /// Number of compared log powers per sleeper; the whitened values of the others are zero.
    compared: usize,
    /// Inverse Cholesky factor of the covariance of a sleeper, in that order.
    whitening: DMatrix<f64>,
    /// Weights of each sleeper's whitened values.
    weights: Vec<f64>,
}

/// Gives a row of a covariance infinite variance and no correlation: it is not compared.
pub(crate) fn leave_out(covariance: &mut DMatrix<f64>, row: usize) {
    covariance.row_mut(row).fill(0.0);
    covariance.column_mut(row).fill(0.0);
    covariance[(row, row)] = f64::INFINITY;
}

impl Observation {
    /// Makes an observation from log powers and the covariance of one sleeper, which is the same for all
    /// sleepers. Rows of a sleeper for which `held_out` is true are not fitted. A row of infinite variance
    /// is not compared: its whitened value is zero. `None` if the covariance is not positive definite.
    pub fn new(
        log_power: DVector<f64>,
        covariance: &DMatrix<f64>,
        held_out: impl Fn(usize) -> bool,
    ) -> Option<Self> {
        let size = covariance.nrows();
        let (last, first): (Vec<usize>, Vec<usize>) = (0..size).partition(|&row| held_out(row));
        let fitted = first.len();
        let order = [first, last].concat();
        let places: Vec<usize> = (0..size)
            .filter(|&place| covariance[(order[place], order[place])] < f64::INFINITY)
            .collect();
        let compared = places.len();
        let of_places = |i: usize, j: usize| covariance[(order[places[i]], order[places[j]])];
        let factor = nalgebra::Cholesky::new(DMatrix::from_fn(compared, compared, of_places))?;
        let inverse = factor.l().solve_lower_triangular(&DMatrix::identity(compared, compared))?;
        let mut whitening = DMatrix::zeros(size, size);
        for (i, &row) in places.iter().enumerate() {
            for (j, &column) in places.iter().enumerate() {
                whitening[(row, column)] = inverse[(i, j)];
            }
        }
        let weights = vec![1.0; log_power.len() / size];
        Some(Self { log_power, order, fitted, compared, whitening, weights })
    }

    /// The same observation, with the covariance of each sleeper multiplied by its factor.
    #[must_use]
    pub fn with_factors(mut self, factors: &[f64]) -> Self {
        self.weights = factors.iter().map(|factor| factor.sqrt().recip()).collect();
        self
    }

    /// An observation of these log powers, with the same covariance.
    #[must_use]
    pub fn with_log_power(self, log_power: DVector<f64>) -> Self {
        Self { log_power, ..self }
    }

    /// Number of compared log powers per sleeper.
    pub const fn compared(&self) -> usize {
        self.compared
    }

    /// Measured minus predicted log powers.
    pub fn difference(&self, predicted: &DVector<f64>) -> DVector<f64> {
        &self.log_power - predicted
    }

    /// Whitened difference. For held-out values it is the part that the fitted values do not predict.
    pub fn residual(&self, predicted: &DVector<f64>) -> DVector<f64> {
        self.whiten(&self.difference(predicted))
    }

    /// Whitens a vector in the order of [`crate::Forward`].
    pub fn whiten(&self, vector: &DVector<f64>) -> DVector<f64> {
        let matrix = DMatrix::from_column_slice(vector.len(), 1, vector.as_slice());
        self.whiten_matrix(&matrix).column(0).into_owned()
    }

    /// Whitens every column of a matrix.
    pub fn whiten_matrix(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let size = self.order.len();
        let mut whitened = DMatrix::zeros(matrix.nrows(), matrix.ncols());
        for (sleeper, weight) in self.weights.iter().enumerate() {
            let first = sleeper * size;
            let rows: Vec<usize> = self.order.iter().map(|row| first + row).collect();
            let part = &self.whitening * matrix.select_rows(&rows) * *weight;
            whitened.rows_mut(first, size).copy_from(&part);
        }
        whitened
    }

    /// The fitted part of a whitened vector.
    pub fn fitted(&self, whitened: &DVector<f64>) -> DVector<f64> {
        whitened.select_rows(&self.rows(true))
    }

    /// The fitted rows of a whitened matrix.
    pub fn fitted_rows(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        whitened.select_rows(&self.rows(true))
    }

    /// The held-out part of a whitened vector.
    pub fn held_out(&self, whitened: &DVector<f64>) -> DVector<f64> {
        whitened.select_rows(&self.rows(false))
    }

    /// The held-out rows of a whitened matrix.
    pub fn held_out_rows(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        whitened.select_rows(&self.rows(false))
    }

    /// Sum of the logarithms of the conditional standard deviations, over all compared log powers.
    pub fn log_deviation(&self) -> f64 {
        self.log_deviation_of(0..self.order.len())
    }

    /// Sum of the logarithms of the conditional standard deviations, over the held-out log powers.
    pub fn held_out_log_deviation(&self) -> f64 {
        self.log_deviation_of(self.fitted..self.order.len())
    }

    /// Sum over these rows of each sleeper, in the order of the whitening.
    fn log_deviation_of(&self, rows: Range<usize>) -> f64 {
        let inverses = rows.map(|row| self.whitening[(row, row)]);
        let compared = inverses.filter(|inverse| *inverse > 0.0);
        self.sleepers() as f64 * compared.map(|inverse| -inverse.ln()).sum::<f64>()
    }

    fn sleepers(&self) -> usize {
        self.log_power.len() / self.order.len()
    }

    fn rows(&self, fitted: bool) -> Vec<usize> {
        let size = self.order.len();
        let part = if fitted { 0..self.fitted } else { self.fitted..size };
        (0..self.sleepers())
            .flat_map(|sleeper| part.clone().map(move |row| sleeper * size + row))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_infinite_variance_says_nothing_and_leaves_the_others_as_they_are() {
        let covariance = DMatrix::from_row_slice(2, 2, &[0.5, 0.2, 0.2, 0.4]);
        let wider =
            DMatrix::from_row_slice(3, 3, &[0.5, 0.0, 0.2, 0.0, f64::INFINITY, 0.0, 0.2, 0.0, 0.4]);
        let narrow =
            Observation::new(DVector::from_vec(vec![1.0, 2.0]), &covariance, |_| false).unwrap();
        let wide =
            Observation::new(DVector::from_vec(vec![1.0, 9.0, 2.0]), &wider, |_| false).unwrap();
        let expected = narrow.residual(&DVector::zeros(2));
        let found = wide.residual(&DVector::zeros(3));
        assert_eq!([found[0], found[1], found[2]], [expected[0], 0.0, expected[1]]);
        assert!((wide.log_deviation() - narrow.log_deviation()).abs() < 1e-12);
        assert_eq!(wide.compared(), 2);
    }
}
