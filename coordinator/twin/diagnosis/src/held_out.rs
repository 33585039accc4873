//! How well passes are predicted that nothing was fitted to.

use crate::calibration::{CalibrationError, Problem};
use nalgebra::{Cholesky, DVector};
use std::f64::consts::TAU;

/// The score of predictions on what was held out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOutScore {
    /// Logarithm of the probability density of all that was held out, given all that was fitted.
    pub log_density: f64,
    /// Logarithm of the evidence of what was fitted, up to a constant of the observation alone.
    pub log_evidence: f64,
    /// How many log powers were held out.
    pub count: usize,
}

impl Problem<'_> {
    /// Fits from `start` to what is not held out and scores the rest.
    ///
    /// The prediction is Gaussian: it knows the surface from the fitted speeds as far as they share
    /// it, and the scatter of what was fitted.
    ///
    /// # Errors
    /// [`CalibrationError`] when the model breaks down on the way.
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
