//! The baseline that fits a recording best, with what is known of it afterwards.

use crate::forward::{Forward, Linearised};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::sync::Arc;
use tracktwin_track::extension::Extension;
use tracktwin_track::model::ModelError;

/// Gauss-Newton steps; five suffice where the track is not far from the catalogue's.
const STEPS_MAX: usize = 12;

/// Largest change of a logarithm in one step: further the linearisation does not carry.
const STEP_MAX: f64 = 0.7;

/// The search ends when the objective falls by less, in nats.
const TOLERANCE: f64 = 0.02;

/// Why no baseline is found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// Values that the search came to make no track.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Derivatives are not finite.
    #[error("the track's response is not a number: is a stiffness or a damping out of range?")]
    NotFinite,
}

/// What was measured and how well it is known, in the order of [`Forward`].
#[derive(Clone, Debug)]
pub struct Observation {
    /// Log powers, less the offset between mean and expected log power.
    pub log_power: DVector<f64>,
    /// Inverse Cholesky factor of each sleeper's covariance: whitens its log powers.
    pub whitening: Vec<DMatrix<f64>>,
}

/// A fitted baseline.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The unknowns.
    pub values: DVector<f64>,
    /// Whitened residual.
    pub residual: DVector<f64>,
    /// Whitened derivatives.
    pub jacobian: DMatrix<f64>,
    /// Posterior precision of the unknowns, factored.
    pub precision: Cholesky<f64, Dyn>,
    /// Sum of squares of residual and prior, halved: the objective in nats.
    pub objective: f64,
}

impl Observation {
    /// Whitens a vector of log powers.
    pub fn whiten(&self, log_power: &DVector<f64>) -> DVector<f64> {
        let size = log_power.len() / self.whitening.len();
        let mut whitened = DVector::zeros(log_power.len());
        for (sleeper, whitening) in self.whitening.iter().enumerate() {
            let part = whitening * log_power.rows(sleeper * size, size);
            whitened.rows_mut(sleeper * size, size).copy_from(&part);
        }
        whitened
    }

    fn whiten_matrix(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let size = matrix.nrows() / self.whitening.len();
        let mut whitened = DMatrix::zeros(matrix.nrows(), matrix.ncols());
        for (sleeper, whitening) in self.whitening.iter().enumerate() {
            let part = whitening * matrix.rows(sleeper * size, size);
            whitened.rows_mut(sleeper * size, size).copy_from(&part);
        }
        whitened
    }
}

/// Finds the baseline of greatest posterior probability, with extensions that stay as they are.
///
/// Gauss-Newton on the whitened log powers with the prior of [`crate::Unknowns`], from `start`;
/// steps that lead uphill are halved.
///
/// # Errors
/// [`CalibrationError`] when the model breaks down on the way.
pub fn calibrate(
    forward: &Forward,
    observation: &Observation,
    extensions: &[Arc<dyn Extension>],
    start: DVector<f64>,
) -> Result<Calibration, CalibrationError> {
    let prior = Prior { mean: forward.unknowns.typical(), precision: forward.unknowns.precision() };
    let mut values = start;
    let mut state = linearise(forward, observation, extensions, &prior, &values)?;
    for _ in 0..STEPS_MAX {
        let gradient =
            state.jacobian.tr_mul(&state.residual) - &prior.precision * (&values - &prior.mean);
        let mut step = state.precision.solve(&gradient);
        let longest = step.amax();
        if longest > STEP_MAX {
            step *= STEP_MAX / longest;
        }
        let before = state.objective;
        let mut next = linearise(forward, observation, extensions, &prior, &(&values + &step))?;
        while next.objective > before && step.amax() > 1e-3 {
            step *= 0.5;
            next = linearise(forward, observation, extensions, &prior, &(&values + &step))?;
        }
        if next.objective > before {
            break;
        }
        values += step;
        state = next;
        if before - state.objective < TOLERANCE {
            break;
        }
    }
    Ok(state)
}

struct Prior {
    mean: DVector<f64>,
    precision: DMatrix<f64>,
}

fn linearise(
    forward: &Forward,
    observation: &Observation,
    extensions: &[Arc<dyn Extension>],
    prior: &Prior,
    values: &DVector<f64>,
) -> Result<Calibration, CalibrationError> {
    let Linearised { log_power, jacobian } = forward.linearised(values, extensions)?;
    let residual = observation.whiten(&(&observation.log_power - log_power));
    let jacobian = observation.whiten_matrix(&jacobian);
    let from_prior = values - &prior.mean;
    let objective =
        0.5 * (residual.norm_squared() + from_prior.dot(&(&prior.precision * &from_prior)));
    let precision = jacobian.tr_mul(&jacobian) + &prior.precision;
    let precision = Cholesky::new(precision).ok_or(CalibrationError::NotFinite)?;
    if !objective.is_finite() {
        return Err(CalibrationError::NotFinite);
    }
    Ok(Calibration { values: values.clone(), residual, jacobian, precision, objective })
}
