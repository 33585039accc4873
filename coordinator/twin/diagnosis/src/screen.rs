//! Matched filters for the screening of candidates: the evidence for every candidate.

use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::search::Extent;
use crate::transfer::Transfer;
use nalgebra::DVector;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use tracktwin_track::extension::{Extension, InstanceError};

/// Prior standard deviation of an extension's strength relative to each trial value.
const STRENGTH_DEVIATION: f64 = 0.3;

/// Strengths relative to a trial for the test whether an extension would be detected: the range of an
/// extension is about a decade, and trials lie in its upper half.
pub(crate) const STRENGTHS: [f64; 5] = [0.125, 0.25, 0.5, 1.0, 2.0];

/// Signature of a candidate with trial values, and the part of it that the baseline cannot reproduce.
#[derive(Clone, Debug)]
pub struct Template {
    /// Index of the candidate.
    pub candidate: usize,
    /// Index of the trial.
    pub trial: usize,
    /// Whitened change of the log powers.
    pub change: DVector<f64>,
    /// Product of the change with the baseline's derivatives.
    pub projected_gradient: DVector<f64>,
    /// Factor that projects a residual onto the part of the change that the baseline reproduces.
    pub imitation: DVector<f64>,
    /// Squared norm of the change after the baseline was fitted again: `d'^2`.
    pub detectability: f64,
    /// Evidence in nats that the choice of the candidate's sleepers costs.
    choice_nats: f64,
}

/// Computes the signatures of all candidates and trials on a calibrated track. A trial for which no model
/// exists is left out.
///
/// # Errors
/// [`CalibrationError`] if no model exists for the calibrated values.
pub fn templates(
    problem: &Problem<'_>,
    calibration: &Calibration,
    candidates: &[Candidate],
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Template>, CalibrationError> {
    let accepted = problem.extensions(&calibration.values)?;
    let beside = Beside::new(problem, calibration, &accepted)?;
    let trials: Vec<(usize, usize)> = candidates
        .iter()
        .enumerate()
        .flat_map(|(number, candidate)| (0..candidate.trials.len()).map(move |t| (number, t)))
        .collect();
    let templates = trials
        .into_par_iter()
        .filter_map(|(number, trial)| {
            let candidate = &candidates[number];
            let section = &problem.forward.section;
            let built = beside.built(candidate, &candidate.trials[trial]);
            progress();
            let extensions = [&accepted[..], &[built.ok()?]].concat();
            let sleepers = if candidate.is_everywhere() {
                0..section.sleepers()
            } else {
                problem.forward.felt_at(Extent::of(candidate, section).spacings())
            };
            beside.template(candidate, [number, trial], &extensions, sleepers)
        })
        .collect();
    Ok(templates)
}

/// Computes the signatures of replacing the last candidate of a problem by each of these, which are the same at
/// other sleepers and have its calibrated values.
///
/// # Errors
/// [`CalibrationError`] if no model exists for the calibrated values.
pub(crate) fn templates_instead(
    problem: &Problem<'_>,
    calibration: &Calibration,
    candidates: &[Candidate],
) -> Result<Vec<Template>, CalibrationError> {
    let mut accepted = problem.extensions(&calibration.values)?;
    let beside = Beside::new(problem, calibration, &accepted)?;
    accepted.pop();
    let values = calibration.values.as_slice();
    let templates = candidates
        .par_iter()
        .enumerate()
        .filter_map(|(number, candidate)| {
            let logarithms = &values[values.len() - candidate.free.len()..];
            let fitted: Vec<f64> = logarithms.iter().map(|logarithm| logarithm.exp()).collect();
            let built = beside.built(candidate, &fitted).ok()?;
            let extensions = [&accepted[..], &[built]].concat();
            beside.template(
                candidate,
                [number, 0],
                &extensions,
                0..problem.forward.section.sleepers(),
            )
        })
        .collect();
    Ok(templates)
}

/// A calibrated track, from which tracks that differ a little are computed.
struct Beside<'a> {
    problem: &'a Problem<'a>,
    calibration: &'a Calibration,
    known: Transfer,
    /// Log powers of the known track.
    plain: DVector<f64>,
}

impl<'a> Beside<'a> {
    fn new(
        problem: &'a Problem<'a>,
        calibration: &'a Calibration,
        accepted: &[Arc<dyn Extension>],
    ) -> Result<Self, CalibrationError> {
        let known = problem.forward.transfer_to_vary(&calibration.values, accepted)?;
        let plain = problem.forward.levels(&known, &calibration.values);
        Ok(Self { problem, calibration, known, plain })
    }

    fn built(
        &self,
        candidate: &Candidate,
        values: &[f64],
    ) -> Result<Arc<dyn Extension>, InstanceError> {
        let section = &self.problem.forward.section;
        section.in_model(&candidate.with(values)).build(&section.track.design, section.spans())
    }

    /// Signature of a candidate, with its number and that of a trial: of the track with these extensions, which
    /// differs from the known one at these sleepers. `None` if no model exists.
    fn template(
        &self,
        &Candidate { choice_nats, .. }: &Candidate,
        [candidate, trial]: [usize; 2],
        extensions: &[Arc<dyn Extension>],
        sleepers: Range<usize>,
    ) -> Option<Template> {
        let Problem { forward, observation, .. } = *self.problem;
        let Calibration { values, jacobian, precision, .. } = self.calibration;
        let transfer = forward.transfer_beside(&self.known, values, extensions).ok()?;
        let first = sleepers.start * forward.per_sleeper();
        let near = forward.levels_at(&transfer, values, sleepers);
        let mut changed = DVector::zeros(self.plain.len());
        let mut rows = changed.rows_mut(first, near.len());
        rows.copy_from(&(near - self.plain.rows(first, rows.len())));
        let change = observation.fitted(&observation.whiten(&changed));
        let projected_gradient = jacobian.tr_mul(&change);
        let imitation = precision.solve(&projected_gradient);
        let detectability = change.norm_squared() - projected_gradient.dot(&imitation);
        Some(Template {
            candidate,
            trial,
            change,
            projected_gradient,
            imitation,
            detectability,
            choice_nats,
        })
    }
}

impl Template {
    /// Gain in nats of a trial with free strength in a calibration's residual; zero if the strength would
    /// have to be negative.
    pub fn along(&self, residual: &DVector<f64>) -> f64 {
        let along = self.change.dot(residual).max(0.0);
        0.5 * along.powi(2) / self.detectability.max(f64::MIN_POSITIVE)
    }

    /// Log evidence for the trial at each of [`STRENGTHS`], in nats.
    pub(crate) fn at_strengths(
        &self,
        residual: &DVector<f64>,
        projected_gradient: &DVector<f64>,
    ) -> [f64; STRENGTHS.len()] {
        let along = self.change.dot(residual) - self.imitation.dot(projected_gradient);
        STRENGTHS.map(|part| part * along - 0.5 * part * part * self.detectability)
    }

    /// Log ratio of the evidence for the extension to the baseline alone, in nats, for a whitened residual.
    /// The strength is `N(1, 0.3^2)` times that of the trial (docs/diagnosis.md, eq. 12).
    ///
    /// `projected_gradient` is the product of the residual with the baseline's derivatives. For the
    /// residual of a calibration it is the gradient, which is zero at the minimum.
    pub fn log_evidence(&self, residual: &DVector<f64>, projected_gradient: &DVector<f64>) -> f64 {
        let along = self.change.dot(residual) - self.imitation.dot(projected_gradient);
        let square = self.detectability;
        let variance = STRENGTH_DEVIATION.powi(2);
        let spread = 1.0 + variance * square;
        along - 0.5 * square + 0.5 * variance * (along - square).powi(2) / spread
            - 0.5 * spread.ln()
            - self.choice_nats
    }
}
