//! One factorisation of a covariance, and what follows from it for any number of targets.
//!
//! The covariance is `s² K`, `K = E(l) + rho I`, around a mean `H b` that is linear in a basis.
//! Neither `s²` nor `b` shapes `K`, so that they come in closed form, and one factor serves all
//! parameters that share `l` and `rho`.

use crate::Error;
use crate::kernel::{Hyperparameters, correlations, covariance};
use faer::linalg::matmul::dot::inner_prod;
use faer::linalg::solvers::{DenseSolveCore, Llt, Solve};
use faer::{Conj, Mat, MatRef, Side};

/// Factor of the training inputs' covariance.
pub struct Factor {
    at: Hyperparameters,
    cholesky: Llt<f64>,
    /// `H`, n x q: the mean's basis at the training inputs.
    basis: Mat<f64>,
    /// `K⁻¹ H`, n x q.
    solved_basis: Mat<f64>,
    /// Factor of `H' K⁻¹ H`, q x q.
    information: Llt<f64>,
    /// `ln|K| + ln|H' K⁻¹ H| - ln|H' H|`.
    log_determinants: f64,
}

/// What the factor says of several targets at once (p of them).
#[derive(Clone, Debug)]
pub struct Weights {
    /// `K⁻¹ (y - H b)`, n x p.
    pub weights: Mat<f64>,
    /// Mean coefficients `b` by generalised least squares, q x p.
    pub coefficients: Mat<f64>,
    /// Signal variances `s²` that maximise the likelihood.
    pub signal_variances: Vec<f64>,
    /// Log marginal likelihoods at those variances, in nats.
    pub log_likelihoods: Vec<f64>,
}

impl Factor {
    /// Factorises the covariance of inputs at these `distances` (n x n) around a mean with this
    /// `basis` (n x q; q may be 0: a mean of zero).
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] when inputs coincide without noise, or the basis is singular.
    pub fn new(
        distances: MatRef<'_, f64>,
        basis: MatRef<'_, f64>,
        at: Hyperparameters,
    ) -> Result<Self, Error> {
        let entries = distances.nrows();
        let refuse = |_| Error::NotPositiveDefinite { entries };
        let cholesky = covariance(distances, at).llt(Side::Lower).map_err(refuse)?;
        let solved_basis = cholesky.solve(basis);
        let information = (basis.transpose() * &solved_basis).llt(Side::Lower).map_err(refuse)?;
        let plain = (basis.transpose() * basis).llt(Side::Lower).map_err(refuse)?;
        let log_determinants =
            log_determinant(&cholesky) + log_determinant(&information) - log_determinant(&plain);
        let basis = basis.to_owned();
        Ok(Self { at, cholesky, basis, solved_basis, information, log_determinants })
    }

    /// Where on the kernel's map this factor is.
    pub fn hyperparameters(&self) -> Hyperparameters {
        self.at
    }

    /// How many entries it was trained on.
    pub fn entries(&self) -> usize {
        self.basis.nrows()
    }

    /// Weights, mean, signal variance and likelihood of each of the `targets` (n x p).
    ///
    /// The likelihood is the restricted one (mean coefficients integrated out, Rasmussen &
    /// Williams 2006, eq. 2.45) with `ln|H' H|` added, so that it does not depend on the basis'
    /// scale: `-((n - q) (ln 2 pi s² + 1) + ln|K| + ln|H' K⁻¹ H| - ln|H' H|) / 2`. Without a basis
    /// it is the plain log marginal likelihood.
    pub fn weights(&self, targets: MatRef<'_, f64>) -> Weights {
        let solved = self.cholesky.solve(targets);
        let coefficients = self.information.solve(self.basis.transpose() * &solved);
        let weights = solved - &self.solved_basis * &coefficients;
        let freedom = (self.entries() - self.basis.ncols()) as f64;
        let signal_variances: Vec<f64> = (0..targets.ncols())
            .map(|j| {
                inner_prod(targets.col(j).transpose(), Conj::No, weights.col(j), Conj::No) / freedom
            })
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

    /// Variances of new observations in units of `s²`, the noise of their own included, at
    /// `distances` (n x t) from the training inputs, with the mean's basis there (t x q).
    ///
    /// `1 + rho - k' K⁻¹ k + r' (H' K⁻¹ H)⁻¹ r` with `r = h - H' K⁻¹ k` (Rasmussen & Williams
    /// 2006, eq. 2.41), by triangular solves; no inverse is formed.
    pub fn variances(&self, distances: MatRef<'_, f64>, basis: MatRef<'_, f64>) -> Vec<f64> {
        let mut k = correlations(distances, self.at.length);
        let mut r = basis.transpose() - self.solved_basis.transpose() * &k;
        self.cholesky.L().solve_lower_triangular_in_place(&mut k);
        self.information.L().solve_lower_triangular_in_place(&mut r);
        (0..k.ncols())
            .map(|t| {
                let known = k.col(t).squared_norm_l2();
                let drift = r.col(t).squared_norm_l2();
                // Rounding may take the function's own variance below zero next to an entry.
                (1.0 - known + drift).max(0.0) + self.at.noise_ratio
            })
            .collect()
    }

    /// `Q = K⁻¹ - K⁻¹ H (H' K⁻¹ H)⁻¹ H' K⁻¹`, n x n: what is left of the inverse when the mean is
    /// fitted too.
    pub(crate) fn projected_inverse(&self) -> Mat<f64> {
        let mut out = self.cholesky.inverse();
        let half = self.information.solve(self.solved_basis.transpose());
        faer::linalg::matmul::matmul(
            out.as_mut(),
            faer::Accum::Add,
            self.solved_basis.as_ref(),
            half.as_ref(),
            -1.0,
            faer::get_global_parallelism(),
        );
        out
    }
}

fn log_determinant(cholesky: &Llt<f64>) -> f64 {
    2.0 * cholesky.L().diagonal().column_vector().iter().map(|pivot| pivot.ln()).sum::<f64>()
}
