//! Fit of the baseline, alone or with extensions, to a recording, with its posterior.

mod descent;
mod minima;
mod ranges;

pub(crate) use descent::Descent;
pub use minima::Minimum;

use crate::candidate::Candidate;
use crate::forward::{Forward, Linearised};
use crate::observation::Observation;
use crate::quantity::Own;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use std::sync::Arc;
use tracktwin_track::extension::{Extension, InstanceError};
use tracktwin_track::model::ModelError;

/// Step of the logarithms of extension parameters for numerical derivatives.
const VARIATION: f64 = 1e-3;

/// Error of a local candidate's effect as a share of the effect: of hanging sleepers of two other simulators
/// (docs/decisions/0038-evaluation-by-inversion.md).
const INEXACT: f64 = 0.6;

/// Number of sleepers on either side of a force law from which the wheel load affects the law.
const LOADED: usize = 2;

/// Reason why a calibration failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// No track model exists for the values of the search.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// No extension exists for the values of the search.
    #[error(transparent)]
    Extension(#[from] InstanceError),
    /// A derivative is not finite.
    #[error("the track's response is not a number: is a stiffness or a damping out of range?")]
    NotFinite,
}

/// Fit of a baseline with the candidates that are part of the model.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// The forward model.
    pub forward: &'a Forward,
    /// The observed log powers.
    pub observation: &'a Observation,
    /// Candidates in the model.
    pub candidates: &'a [Candidate],
}

/// A fitted baseline with its extensions.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The unknowns of the baseline, then the logarithms of the candidates' free parameters.
    pub values: DVector<f64>,
    /// Whitened residual of the fitted log powers.
    pub residual: DVector<f64>,
    /// Whitened derivatives of the fitted log powers, rows x values.
    pub jacobian: DMatrix<f64>,
    /// Derivatives of the log posterior with respect to the values; zero at the minimum of the objective.
    pub gradient: DVector<f64>,
    /// Cholesky factor of the posterior precision of the values.
    pub precision: Cholesky<f64, Dyn>,
    /// Half the sum of squares of residual and prior, which is minus the log posterior, in nats.
    pub objective: f64,
    /// Log evidence in nats, up to a constant of the observation.
    pub log_evidence: f64,
    /// Other minima that fits of the same model ended in.
    pub others: Vec<Minimum>,
}

struct Prior {
    mean: DVector<f64>,
    precision: DMatrix<f64>,
    /// Half the logarithm of the precision's determinant.
    half_log_determinant: f64,
}

impl Prior {
    /// Half the sum of squares of a whitened residual and of the distance from the prior, in nats.
    fn objective(&self, residual: &DVector<f64>, values: &DVector<f64>) -> f64 {
        let from_prior = values - &self.mean;
        0.5 * (residual.norm_squared() + from_prior.dot(&(&self.precision * &from_prior)))
    }
}

impl Problem<'_> {
    /// Start values: the unknowns of a baseline, then one trial of each candidate.
    pub fn start(&self, baseline: &DVector<f64>, trials: &[&[f64]]) -> DVector<f64> {
        let count = self.forward.unknowns.count();
        let mut values: Vec<f64> = baseline.rows(0, count).iter().copied().collect();
        for (candidate, trial) in self.candidates.iter().zip(trials) {
            values.extend(candidate.logarithms(trial));
        }
        DVector::from_vec(values)
    }

    /// Builds the extensions of the candidates with the parameters in `values`.
    pub fn extensions(
        &self,
        values: &DVector<f64>,
    ) -> Result<Vec<Arc<dyn Extension>>, InstanceError> {
        let section = &self.forward.section;
        let mut place = self.forward.unknowns.count();
        let build = |candidate: &Candidate| {
            let parameters: Vec<f64> =
                values.rows(place, candidate.free.len()).iter().map(|value| value.exp()).collect();
            place += candidate.free.len();
            let placed = section.in_model(&candidate.with(&parameters));
            placed.build(&section.track.design, section.spans())
        };
        self.candidates.iter().map(build).collect()
    }

    /// Linearises at given values, without a search.
    ///
    /// # Errors
    /// [`CalibrationError`] if no track or extension exists for the values.
    pub(crate) fn at(&self, values: &DVector<f64>) -> Result<Calibration, CalibrationError> {
        self.linearise(&self.prior(), values)
    }

    /// Factor on the covariance of every sleeper for the error of the local candidates' models, which grows
    /// with their effect: the values common to all sleepers are then not fitted to it.
    ///
    /// # Errors
    /// [`CalibrationError`] if no track or extension exists for the values.
    pub fn inexactness(&self, values: &DVector<f64>) -> Result<Vec<f64>, CalibrationError> {
        let sleepers = self.forward.section.sleepers();
        let is_local = |candidate: &Candidate| {
            let acting = candidate.extension.sleepers.as_ref().map(Vec::len);
            !candidate.is_everywhere() && acting.is_none_or(|acting| 2 * acting <= sleepers)
        };
        if !self.candidates.iter().any(is_local) {
            return Ok(vec![1.0; sleepers]);
        }
        let all = self.extensions(values)?;
        let even: Vec<_> = all
            .iter()
            .zip(self.candidates)
            .filter(|(_, candidate)| !is_local(candidate))
            .map(|(extension, _)| Arc::clone(extension))
            .collect();
        let change =
            self.forward.log_power(values, &all)? - self.forward.log_power(values, &even)?;
        let change = self.observation.fitted(&self.observation.whiten(&change));
        let each = change.len() / sleepers;
        let factor = |sleeper: usize| {
            let square = change.rows(sleeper * each, each).norm_squared();
            1.0 + INEXACT.powi(2) * square / self.observation.compared() as f64
        };
        Ok((0..sleepers).map(factor).collect())
    }

    /// Log powers that the model expects with these values.
    ///
    /// # Errors
    /// [`CalibrationError`] if no track or extension exists for the values.
    pub(crate) fn predict(&self, values: &DVector<f64>) -> Result<DVector<f64>, CalibrationError> {
        Ok(self.forward.log_power(values, &self.extensions(values)?)?)
    }

    fn prior(&self) -> Prior {
        let unknowns = &self.forward.unknowns;
        let priors = |candidate: &Candidate| -> Vec<(f64, f64)> {
            candidate.free.iter().map(|parameter| candidate.prior(parameter)).collect()
        };
        let free: Vec<(f64, f64)> = self.candidates.iter().flat_map(priors).collect();
        let (count, all) = (unknowns.count(), unknowns.count() + free.len());
        let mut mean = DVector::zeros(all);
        mean.rows_mut(0, count).copy_from(&unknowns.typical());
        let mut precision = DMatrix::zeros(all, all);
        precision.view_mut((0, 0), (count, count)).copy_from(&unknowns.precision());
        for (index, (middle, deviation)) in free.into_iter().enumerate() {
            mean[count + index] = middle;
            precision[(count + index, count + index)] = deviation.powi(-2);
        }
        let factor = Cholesky::new(precision.clone()).expect("a prior is positive definite");
        Prior { mean, precision, half_log_determinant: 0.5 * factor.ln_determinant() }
    }

    /// Whitened residual and derivatives at given values, including held-out rows.
    pub(crate) fn whitened(
        &self,
        values: &DVector<f64>,
    ) -> Result<(DVector<f64>, DMatrix<f64>), CalibrationError> {
        let extensions = self.extensions(values)?;
        let Linearised { log_power, jacobian, transfer } =
            self.forward.linearised(values, &extensions)?;
        let mut jacobian = jacobian.resize_horizontally(values.len(), 0.0);
        let baseline = self.forward.unknowns.count();
        let mut varied = self.under_load();
        varied.extend(baseline..values.len());
        let has_laws = self.candidates.iter().any(Candidate::is_under_load);
        let column = |index: usize| -> Result<DVector<f64>, CalibrationError> {
            let mut varied = values.clone();
            varied[index] += VARIATION;
            let extensions = self.extensions(&varied)?;
            let change = |levels: DVector<f64>| (levels - &log_power) / VARIATION;
            if !has_laws {
                let beside = self.forward.transfer_beside(&transfer, &varied, &extensions)?;
                return Ok(change(self.forward.levels(&beside, &varied)));
            }
            let is_own = index >= baseline;
            let elsewhere =
                self.forward.with_laws_of(&transfer, [values, &varied], &extensions, is_own)?;
            Ok(match elsewhere {
                Some(levels) if is_own => change(levels),
                // The receptances contain all but where the laws take hold.
                Some(levels) => jacobian.column(index) + change(levels),
                None => change(self.forward.log_power(&varied, &extensions)?),
            })
        };
        let columns: Vec<_> = varied
            .into_par_iter()
            .map(|index| Ok((index, column(index)?)))
            .collect::<Result<_, CalibrationError>>()?;
        for (index, column) in columns {
            jacobian.set_column(index, &column);
        }
        let residual = self.observation.residual(&log_power);
        Ok((residual, self.observation.whiten_matrix(&jacobian)))
    }

    /// Indices of the ballast and railpad stiffnesses that affect at which wheel positions a candidate's
    /// force laws are active. Receptances do not contain this effect.
    fn under_load(&self) -> Vec<usize> {
        let unknowns = &self.forward.unknowns;
        // A gap that no load closes has nothing free.
        let by_load =
            |candidate: &&Candidate| candidate.is_under_load() && !candidate.free.is_empty();
        let candidates = self.candidates.iter().filter(by_load);
        let sleepers = candidates.filter_map(|candidate| candidate.extension.sleepers.as_ref());
        let mut near: Vec<usize> = sleepers
            .flatten()
            .flat_map(|sleeper| sleeper.saturating_sub(LOADED)..=sleeper + LOADED)
            .filter(|sleeper| *sleeper < self.forward.section.sleepers())
            .collect();
        near.sort_unstable();
        near.dedup();
        let both = |sleeper| {
            [Own::BallastStiffness, Own::RailpadStiffness].map(|it| unknowns.at(it, sleeper))
        };
        near.into_iter().flat_map(both).collect()
    }

    fn linearise(
        &self,
        prior: &Prior,
        values: &DVector<f64>,
    ) -> Result<Calibration, CalibrationError> {
        let (residual, jacobian) = self.whitened(values)?;
        let (residual, jacobian) =
            (self.observation.fitted(&residual), self.observation.fitted_rows(&jacobian));
        let from_prior = values - &prior.mean;
        let pull = &prior.precision * &from_prior;
        let objective = 0.5 * (residual.norm_squared() + from_prior.dot(&pull));
        let gradient = jacobian.tr_mul(&residual) - pull;
        // Several times as quick as `tr_mul`, which takes one scalar product an entry.
        let precision = jacobian.transpose() * &jacobian + &prior.precision;
        let precision = Cholesky::new(precision).ok_or(CalibrationError::NotFinite)?;
        if !objective.is_finite() {
            return Err(CalibrationError::NotFinite);
        }
        // Laplace: the constants of the prior's and the posterior's Gaussian cancel.
        let log_evidence =
            -objective + prior.half_log_determinant - 0.5 * precision.ln_determinant();
        Ok(Calibration {
            values: values.clone(),
            residual,
            jacobian,
            gradient,
            precision,
            objective,
            log_evidence,
            others: Vec::new(),
        })
    }
}
