//! Scores of predictions for held-out speeds.

use crate::calibration::{CalibrationError, Problem};
use nalgebra::{Cholesky, DVector};
use std::f64::consts::TAU;

/// Score of the prediction of held-out log powers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOutScore {
    /// Log probability density of the held-out log powers given the fitted ones, in nats.
    pub log_density: f64,
    /// Log evidence of the fitted log powers in nats, up to a constant of the observation.
    pub log_evidence: f64,
    /// Number of held-out log powers.
    pub count: usize,
}

impl Problem<'_> {
    /// Fits to the data that are not held out, from `start`, and scores the held-out data.
    ///
    /// The prediction is Gaussian. It includes the posterior of the fit, and the information on the common
    /// surface from the fitted speeds.
    ///
    /// # Errors
    /// [`CalibrationError`] if the fit fails.
    pub fn held_out(&self, start: DVector<f64>) -> Result<HeldOutScore, CalibrationError> {
        let fit = self.calibrate(start)?;
        let (residual, jacobian) = self.whitened(&fit.values)?;
        let (residual, jacobian) =
            (self.observation.held_out(&residual), self.observation.held_out_rows(&jacobian));
        let projected_gradient = jacobian.tr_mul(&residual);
        let precision =
            fit.precision.l() * fit.precision.l().transpose() + jacobian.transpose() * &jacobian;
        let precision = Cholesky::new(precision).ok_or(CalibrationError::NotFinite)?;
        let square =
            residual.norm_squared() - projected_gradient.dot(&precision.solve(&projected_gradient));
        let spread = precision.ln_determinant() - fit.precision.ln_determinant();
        let count = residual.len();
        let log_density = -0.5 * (square + spread + count as f64 * TAU.ln())
            - self.observation.held_out_log_deviation();
        Ok(HeldOutScore { log_density, log_evidence: fit.log_evidence, count })
    }
}
