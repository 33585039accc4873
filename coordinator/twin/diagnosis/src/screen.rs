//! A filter for every candidate: how much better the recording is understood with it.

use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::search::Extent;
use nalgebra::DVector;
use rayon::prelude::*;

/// Prior deviation of an effect's strength about each trial value.
const STRENGTH_DEVIATION: f64 = 0.3;

/// Strengths in parts of a trial's at which it is asked whether it would show: an effect's range is
/// about a decade, and trials are in its upper half.
pub(crate) const STRENGTHS: [f64; 5] = [0.125, 0.25, 0.5, 1.0, 2.0];

/// The trace of a candidate with certain values, as far as the baseline cannot imitate it.
#[derive(Clone, Debug)]
pub struct Template {
    /// Number of the candidate.
    pub candidate: usize,
    /// Number of the trial.
    pub trial: usize,
    /// Whitened change of the log powers.
    pub change: DVector<f64>,
    /// Its product with the baseline's derivatives.
    pub projected_gradient: DVector<f64>,
    /// The baseline's part in it: what it is multiplied with for a residual's projection.
    pub imitation: DVector<f64>,
    /// Square of its length, after the baseline has taken what it can: `d'^2`.
    pub detectability: f64,
}

/// Works out the traces of all candidates and trials on a calibrated track.
///
/// # Errors
/// [`CalibrationError`] when the calibrated track makes no model. A trial that makes none is left
/// out.
pub fn templates(
    problem: &Problem<'_>,
    calibration: &Calibration,
    candidates: &[Candidate],
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Template>, CalibrationError> {
    let Problem { forward, observation, .. } = *problem;
    let accepted = problem.extensions(&calibration.values)?;
    let known = forward.transfer_to_vary(&calibration.values, &accepted)?;
    let plain = forward.levels(&known, &calibration.values);
    let trials: Vec<(usize, usize)> = candidates
        .iter()
        .enumerate()
        .flat_map(|(number, candidate)| (0..candidate.trials.len()).map(move |t| (number, t)))
        .collect();
    let templates = trials
        .into_par_iter()
        .filter_map(|(number, trial)| {
            let candidate = &candidates[number];
            let extension = candidate.with(&candidate.trials[trial]);
            let section = &forward.section;
            let built = section.in_model(&extension).build(&section.track.design, section.spans());
            progress();
            let extensions = [&accepted[..], &[built.ok()?]].concat();
            let transfer = forward.transfer_beside(&known, &calibration.values, &extensions);
            let sleepers = if candidate.is_everywhere() {
                0..section.sleepers
            } else {
                forward.felt_at(Extent::of(candidate, section).spacings())
            };
            let first = sleepers.start * forward.per_sleeper();
            let near = forward.levels_at(&transfer.ok()?, &calibration.values, sleepers);
            let mut changed = DVector::zeros(plain.len());
            let mut rows = changed.rows_mut(first, near.len());
            rows.copy_from(&(near - plain.rows(first, rows.len())));
            let change = observation.fitted(&observation.whiten(&changed));
            let projected_gradient = calibration.jacobian.tr_mul(&change);
            let imitation = calibration.precision.solve(&projected_gradient);
            let detectability = change.norm_squared() - projected_gradient.dot(&imitation);
            Some(Template {
                candidate: number,
                trial,
                change,
                projected_gradient,
                imitation,
                detectability,
            })
        })
        .collect();
    Ok(templates)
}

impl Template {
    /// Nats that a trial of free size gains in a calibration's residual; none for one that would
    /// have to be negative.
    pub fn along(&self, residual: &DVector<f64>) -> f64 {
        let along = self.change.dot(residual).max(0.0);
        0.5 * along.powi(2) / self.detectability.max(f64::MIN_POSITIVE)
    }

    /// Logarithms of the evidence for the trial at each of [`STRENGTHS`].
    pub(crate) fn at_strengths(
        &self,
        residual: &DVector<f64>,
        projected_gradient: &DVector<f64>,
    ) -> [f64; STRENGTHS.len()] {
        let along = self.change.dot(residual) - self.imitation.dot(projected_gradient);
        STRENGTHS.map(|part| part * along - 0.5 * part * part * self.detectability)
    }

    /// Logarithm of the evidence for the effect in a whitened residual, against the baseline alone:
    /// with strength `N(1, 0.3^2)` times the trial's (docs/diagnosis.md, eq. 12).
    ///
    /// `projected_gradient` is the residual's product with the baseline's derivatives; for the residual of a
    /// calibration its gradient, which is zero where it came to its end.
    pub fn log_evidence(&self, residual: &DVector<f64>, projected_gradient: &DVector<f64>) -> f64 {
        let along = self.change.dot(residual) - self.imitation.dot(projected_gradient);
        let square = self.detectability;
        let variance = STRENGTH_DEVIATION.powi(2);
        let spread = 1.0 + variance * square;
        along - 0.5 * square + 0.5 * variance * (along - square).powi(2) / spread
            - 0.5 * spread.ln()
    }
}
