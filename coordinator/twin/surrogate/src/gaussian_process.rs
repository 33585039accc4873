//! One factorisation of a covariance, used for any number of targets.
//!
//! The covariance is `s² K` with `K = E(l) + rho I`, around a mean `H b` that is linear in a basis `H`. `K`
//! depends neither on `s²` nor on `b`. Both therefore have a closed form, and all parameters with the same
//! `l` and `rho` share one factor.

use crate::Error;
use crate::cholesky::Cholesky;
use crate::exponential::correlate;
use crate::kernel::{Hyperparameters, correlations, covariance};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, ColRef, Mat, MatRef, get_global_parallelism};
use rayon::prelude::*;

/// Cholesky factor of the covariance of the training inputs.
pub struct Factor {
    at: Hyperparameters,
    cholesky: Cholesky,
    /// `H`, n x q: the mean's basis at the training inputs.
    basis: Mat<f64>,
    /// `K⁻¹ H`, n x q.
    solved_basis: Mat<f64>,
    /// Factor of `H' K⁻¹ H`, q x q.
    information: Cholesky,
    /// `ln|K| + ln|H' K⁻¹ H| - ln|H' H|`.
    log_determinants: f64,
}

/// Solution for p targets with one factor.
#[derive(Clone, Debug)]
pub struct Weights {
    /// `K⁻¹ (y - H b)`, n x p.
    pub weights: Mat<f64>,
    /// Mean coefficients `b` by generalised least squares, q x p.
    pub coefficients: Mat<f64>,
    /// Signal variances `s²` that maximise the likelihood, p values.
    pub signal_variances: Vec<f64>,
    /// Log marginal likelihoods at those variances, in nats, p values.
    pub log_likelihoods: Vec<f64>,
}

impl Factor {
    /// Factorises the covariance of training inputs with these `distances` (n x n) around a mean with this
    /// `basis` (n x q). With q = 0 the mean is zero.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if two inputs coincide and the noise is zero, or if the basis is
    /// singular; [`Error::TooFewEntries`] if n is not larger than q.
    pub fn new(
        distances: MatRef<'_, f64>,
        basis: MatRef<'_, f64>,
        at: Hyperparameters,
    ) -> Result<Self, Error> {
        if basis.nrows() <= basis.ncols() {
            return Err(Error::TooFewEntries { found: basis.nrows(), least: basis.ncols() + 1 });
        }
        let cholesky = Cholesky::new(covariance(distances, at))?;
        let solved_basis = cholesky.solve(basis);
        let information = Cholesky::new(basis.transpose() * &solved_basis)?;
        let plain = Cholesky::new(basis.transpose() * basis)?;
        let log_determinants =
            cholesky.log_determinant() + information.log_determinant() - plain.log_determinant();
        let basis = basis.to_owned();
        Ok(Self { at, cholesky, basis, solved_basis, information, log_determinants })
    }

    /// Hyper-parameters of this factor.
    pub fn hyperparameters(&self) -> Hyperparameters {
        self.at
    }

    /// Number n of training entries.
    pub fn entries(&self) -> usize {
        self.basis.nrows()
    }

    /// Weights, mean coefficients, signal variance and likelihood of each of the `targets` (n x p).
    ///
    /// The likelihood is the restricted one (mean coefficients integrated out, Rasmussen & Williams 2006,
    /// eq. 2.45) with `ln|H' H|` added, which makes it independent of the scale of the basis: `-((n - q)
    /// (ln 2 pi s² + 1) + ln|K| + ln|H' K⁻¹ H| - ln|H' H|) / 2`. Without a basis it is the ordinary log
    /// marginal likelihood.
    pub fn weights(&self, targets: MatRef<'_, f64>) -> Weights {
        let solved = self.cholesky.solve(targets);
        let projected = self.basis.transpose() * &solved;
        let coefficients = self.information.solve(projected.as_ref());
        let weights = solved - &self.solved_basis * &coefficients;
        let freedom = (self.entries() - self.basis.ncols()) as f64;
        let signal_variances: Vec<f64> = (0..targets.ncols())
            .map(|j| targets.col(j).transpose() * weights.col(j) / freedom)
            .collect();
        let log_likelihoods = signal_variances
            .iter()
            .map(|s2| {
                let fit = freedom * ((2.0 * std::f64::consts::PI * s2).ln() + 1.0);
                -0.5 * (fit + self.log_determinants)
            })
            .collect();
        Weights { weights, coefficients, signal_variances, log_likelihoods }
    }

    /// Predictive variances of t new observations in units of `s²`, including their noise. `distances` (n x
    /// t) are the distances from the training inputs; `basis` (t x q) is the basis of the mean at the new
    /// inputs.
    ///
    /// The variance is `1 + rho - k' K⁻¹ k + r' (H' K⁻¹ H)⁻¹ r` with `r = h - H' K⁻¹ k` (Rasmussen &
    /// Williams 2006, eq. 2.41). The function uses triangular solves and forms no inverse.
    pub fn variances(&self, distances: MatRef<'_, f64>, basis: MatRef<'_, f64>) -> Vec<f64> {
        let k = correlations(distances, self.at.length);
        let r = basis.transpose() - self.solved_basis.transpose() * &k;
        let (k, r) = (self.cholesky.half_solve(k), self.information.half_solve(r));
        (0..k.ncols())
            .map(|t| {
                let known = k.col(t).squared_norm_l2();
                let drift = r.col(t).squared_norm_l2();
                // Rounding may take the function's own variance below zero next to an entry.
                (1.0 - known + drift).max(0.0) + self.at.noise_ratio
            })
            .collect()
    }

    /// `Q = K⁻¹ - K⁻¹ H (H' K⁻¹ H)⁻¹ H' K⁻¹` (n x n, lower triangle): the inverse of `K`, projected against
    /// the mean.
    pub(crate) fn projected_inverse(&self) -> Mat<f64> {
        let mut out = self.cholesky.inverse();
        let half = self.information.half_solve(self.solved_basis.transpose().to_owned());
        triangular::matmul(
            out.as_mut(),
            BlockStructure::TriangularLower,
            Accum::Add,
            half.transpose(),
            BlockStructure::Rectangular,
            half.as_ref(),
            BlockStructure::Rectangular,
            -1.0,
            get_global_parallelism(),
        );
        out
    }

    /// Derivatives `[by ln l, by ln rho]` of the log-likelihood of every target. `distances` (n x n) must
    /// be those from which the factor was made.
    ///
    /// The derivative is `(a' K' a / s² - tr(Q K')) / 2` with the weights `a`, the derivative `K'` of `K`
    /// and the inverse `Q` projected against the mean (Rasmussen & Williams 2006, eq. 5.9, with `s²`
    /// profiled out). The function computes an inverse and costs three times as much as the likelihood.
    pub fn gradients(&self, distances: MatRef<'_, f64>, weights: &Weights) -> Vec<[f64; 2]> {
        let projected_inverse = self.projected_inverse();
        let projected_inverse = projected_inverse.as_ref();
        let n = self.entries();
        let columns: Vec<Vec<f64>> = (0..n)
            .into_par_iter()
            .map(|j| self.length_terms(distances, projected_inverse, weights, j))
            .collect();
        let noise_trace =
            self.at.noise_ratio * (0..n).map(|i| projected_inverse[(i, i)]).sum::<f64>();
        let trace: f64 = columns.iter().map(|terms| terms[0]).sum();
        let targets = weights.signal_variances.iter().enumerate();
        targets
            .map(|(target, s2)| {
                let length: f64 = columns.iter().map(|terms| terms[1 + target]).sum();
                let noise = self.at.noise_ratio * weights.weights.col(target).squared_norm_l2();
                [0.5 * (length / s2 - trace), 0.5 * (noise / s2 - noise_trace)]
            })
            .collect()
    }

    /// Contribution of column `j` to `tr(Q K')` and to `a' K' a` of every target, where `K'` is the
    /// derivative by `ln l`. The sum covers both triangles at once; the diagonal of `K'` is zero.
    fn length_terms<'a>(
        &self,
        distances: MatRef<'a, f64>,
        projected_inverse: MatRef<'a, f64>,
        weights: &'a Weights,
        j: usize,
    ) -> Vec<f64> {
        let below = j + 1..self.entries();
        let from_here = |of: ColRef<'a, f64>| of.subrows(below.start, below.len());
        let distances = from_here(distances.col(j));
        let mut changes: Vec<f64> = distances.iter().copied().collect();
        correlate(&mut changes, self.at.length);
        for (change, r) in changes.iter_mut().zip(distances.iter()) {
            *change *= 2.0 * r / self.at.length;
        }
        let changes = ColRef::from_slice(&changes).transpose();
        let trace = changes * from_here(projected_inverse.col(j));
        let of_target = |target| {
            let column = weights.weights.col(target);
            weights.weights[(j, target)] * (changes * from_here(column))
        };
        [trace].into_iter().chain((0..weights.signal_variances.len()).map(of_target)).collect()
    }
}
