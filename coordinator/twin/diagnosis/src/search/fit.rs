//! Fits of candidates together with the baseline, and new fits of the baseline from their results.

use super::holes::with_holes;
use super::{Fitted, Stage};
use crate::calibration::{Calibration, CalibrationError, Descent, Problem};
use crate::candidate::Candidate;
use crate::screen::Template;
use crate::section::are_most;
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use tracktwin_track::extension::PlaceKind;

/// Share of the best log evidence from which a candidate of another kind is fitted further; `RIVAL_FITS` is
/// the largest number of such fits.
const RIVAL_SHARE: f64 = 0.7;
const RIVAL_FITS: usize = 3;

/// A fit is continued only if its predicted gain reaches this share of the best gain, minus `DOUBT` times
/// the objective for the uncertainty of the prediction. In the recording dev-12 this ends 13 fits early;
/// all had negative evidence when they were continued to the end.
const RACE_SHARE: f64 = 0.3;
const DOUBT: f64 = 0.1;

/// Number of fitted candidates whose values serve as start of a new fit without the candidate.
const RESTARTS: usize = 3;

/// Improvement in nats from which a new fit replaces the old one.
const BETTER: f64 = 3.0;

/// The best fit of each candidate, from fits in descending order.
fn once_each(fitted: Vec<Fitted>) -> Vec<Fitted> {
    let mut kept: Vec<Fitted> = Vec::new();
    for fitted in fitted {
        if kept.iter().all(|known| known.candidate.extension != fitted.candidate.extension) {
            kept.push(fitted);
        }
    }
    kept
}

/// Fits candidates from the start values; returns the fits, the best first.
///
/// After the first steps the linearisation predicts the result of each fit. A fit that cannot approach the
/// best one is not continued.
pub(super) fn fit(
    problem: &Problem<'_>,
    current: &Calibration,
    all: &[Candidate],
    starts: Vec<(&Template, DVector<f64>)>,
    progress: &(dyn Fn(Stage, f64) + Sync),
) -> Vec<Fitted> {
    let count = 2.0 * starts.len() as f64;
    progress(Stage::Refinement, 0.0);
    let done = AtomicUsize::new(0);
    let counted = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(Stage::Refinement, done as f64 / count);
    };
    let begun: Vec<Begun<'_>> = starts
        .into_par_iter()
        .filter_map(|(template, start)| {
            let begun = Begun::new(problem, &all[template.candidate], template, &start);
            counted();
            begun.ok()
        })
        .collect();
    let gains = begun.iter().map(|begun| current.objective - begun.descent.state.objective);
    let best = gains.fold(0.0, f64::max);
    let mut fitted: Vec<Fitted> = begun
        .into_par_iter()
        .filter_map(|begun| {
            let is_rival = begun.may_come_near(best, current);
            let fitted =
                if is_rival { begun.finish(problem, current) } else { Ok(begun.given_up(current)) };
            counted();
            fitted.ok()
        })
        .collect();
    fitted.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let mut fitted = all_along(problem, current, once_each(fitted));
    let holed = with_holes(problem, current, &fitted);
    fitted.extend(all_along(problem, current, holed));
    fitted.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    to_the_end(problem, current, fitted)
}

/// Fits in descending order with those of an earlier search of the same model, whose evidence relative to the
/// baseline is less by `lost` nats. Of two fits of one candidate the better one stays.
pub(super) fn with_earlier(fitted: Vec<Fitted>, earlier: Vec<Fitted>, lost: f64) -> Vec<Fitted> {
    if fitted.is_empty() {
        return fitted;
    }
    let earlier =
        earlier.into_iter().map(|it| Fitted { log_evidence: it.log_evidence - lost, ..it });
    let mut all: Vec<Fitted> = fitted.into_iter().chain(earlier).collect();
    all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    once_each(all)
}

/// Repeats the fits of the best candidate and of its competitors, as far as they act on all or most sleepers,
/// from softer and from stiffer sleepers: bending stiffness of the sleepers and what holds them can
/// replace each other, and the fits have two minima.
fn all_along(problem: &Problem<'_>, current: &Calibration, fitted: Vec<Fitted>) -> Vec<Fitted> {
    let Some(best) = fitted.first() else { return fitted };
    let least = RIVAL_SHARE * best.log_evidence;
    let again = |fitted: Fitted| {
        let candidate = &fitted.candidate;
        let sleepers = candidate.extension.sleepers.as_ref();
        let all = problem.forward.section.sleepers();
        let is_on_most = sleepers.is_none_or(|it| are_most(it.len(), all));
        let acts_on_most = candidate.extension.x_m.is_none()
            && is_on_most
            && candidate.kind.place == PlaceKind::Sleepers;
        if acts_on_most && fitted.log_evidence >= least {
            on_other_sleepers(problem, current, fitted)
        } else {
            fitted
        }
    };
    let mut fitted: Vec<Fitted> = fitted.into_par_iter().map(again).collect();
    fitted.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    fitted
}

/// Fits a candidate from softer and from stiffer sleepers, each time from the trial that is best there. Of
/// two minima that are about as good, the known one stays.
fn on_other_sleepers(problem: &Problem<'_>, current: &Calibration, mut fitted: Fitted) -> Fitted {
    let candidate = &fitted.candidate;
    let candidates = [problem.candidates, std::slice::from_ref(candidate)].concat();
    let with = Problem { candidates: &candidates, ..*problem };
    let track = fitted.calibration.values.rows(0, current.values.len()).into_owned();
    let starts = problem.with_other_sleepers(&track).map(|track| {
        let trials = candidate.trials.iter().map(|trial| with_trial(&track, candidate, trial));
        trials.min_by(|a, b| with.objective(a).total_cmp(&with.objective(b)))
    });
    let best = with.best_from(fitted.calibration.clone(), starts.into_iter().flatten());
    if best.objective < fitted.calibration.objective - BETTER {
        fitted.log_evidence = log_evidence(&fitted.candidate, &best, current);
        fitted.calibration = best;
    } else {
        fitted.calibration = fitted.calibration.beside(&best);
    }
    fitted
}

/// Log ratio of the evidence of a candidate's fit to the model without it, in nats, less what the choice of its
/// sleepers costs.
pub(super) fn log_evidence(
    candidate: &Candidate,
    fitted: &Calibration,
    current: &Calibration,
) -> f64 {
    fitted.log_evidence - current.log_evidence - candidate.choice_nats
}

/// Values of the model without a candidate, and then those of one of its trials.
fn with_trial(values: &DVector<f64>, candidate: &Candidate, trial: &[f64]) -> DVector<f64> {
    let all: Vec<f64> = values.iter().copied().chain(candidate.logarithms(trial)).collect();
    DVector::from_vec(all)
}

/// Continues the fits of the best candidate and of its competitors, if one of these is of another kind: the
/// last nats decide between look-alikes.
fn to_the_end(problem: &Problem<'_>, current: &Calibration, fitted: Vec<Fitted>) -> Vec<Fitted> {
    let Some(best) = fitted.first() else { return fitted };
    let (kind, least) = (best.candidate.kind, RIVAL_SHARE * best.log_evidence);
    let comes_near = |fitted: &Fitted| fitted.log_evidence >= least;
    let is_other = |fitted: &Fitted| fitted.candidate.kind.physics != kind.physics;
    if !fitted.iter().any(|rival| comes_near(rival) && is_other(rival)) {
        return fitted;
    }
    let again = |fitted: Fitted| {
        if comes_near(&fitted) { further(problem, current, fitted) } else { fitted }
    };
    let mut fitted: Vec<Fitted> = fitted.into_par_iter().map(again).collect();
    fitted.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    fitted
}

/// Continues a fit, with its parameters inside their ranges, until it gains no more.
fn further(problem: &Problem<'_>, current: &Calibration, mut fitted: Fitted) -> Fitted {
    let candidates = [problem.candidates, std::slice::from_ref(&fitted.candidate)].concat();
    let with = Problem { candidates: &candidates, ..*problem };
    for _ in 0..RIVAL_FITS {
        let Ok(again) = with.calibrate_in_range(fitted.calibration.values.clone()) else { break };
        let gain = fitted.calibration.objective - again.objective;
        if gain > 0.0 {
            fitted.log_evidence = log_evidence(&fitted.candidate, &again, current);
            fitted.calibration = again.beside(&fitted.calibration);
        }
        if gain < BETTER {
            break;
        }
    }
    fitted
}

/// First steps of a candidate's fit, together with the baseline and the accepted extensions.
struct Begun<'t> {
    template: &'t Template,
    /// All candidates in the model; the new one is the last.
    candidates: Vec<Candidate>,
    start: DVector<f64>,
    descent: Descent,
}

impl<'t> Begun<'t> {
    fn new(
        problem: &Problem<'_>,
        candidate: &Candidate,
        template: &'t Template,
        start: &DVector<f64>,
    ) -> Result<Self, CalibrationError> {
        let candidates: Vec<Candidate> =
            problem.candidates.iter().chain([candidate]).cloned().collect();
        let start = with_trial(start, candidate, &candidate.trials[template.trial]);
        let descent = Problem { candidates: &candidates, ..*problem }.begin(&start)?;
        Ok(Self { template, candidates, start, descent })
    }

    /// Whether the predicted result of the fit may approach the best one; `best` is the greatest gain of
    /// all fits so far.
    fn may_come_near(&self, best: f64, current: &Calibration) -> bool {
        let predicted = current.objective - self.descent.state.predicted_objective();
        predicted >= RACE_SHARE * best - DOUBT * current.objective
    }

    /// The fit with its predicted result, without further steps.
    fn given_up(self, current: &Calibration) -> Fitted {
        let calibration = self.descent.state;
        let gain = calibration.objective - calibration.predicted_objective();
        Self::fitted(self.template, self.candidates, calibration, current, gain)
    }

    /// Continues the fit to its end; restricts its parameters to their ranges if the result is implausible.
    fn finish(
        self,
        problem: &Problem<'_>,
        current: &Calibration,
    ) -> Result<Fitted, CalibrationError> {
        let with = Problem { candidates: &self.candidates, ..*problem };
        let mut calibration = with.go_on(self.descent)?;
        let is_plausible = self.candidates.last().is_none_or(|candidate| {
            let count = calibration.values.len();
            candidate.is_plausible(&calibration.values.as_slice()[count - candidate.free.len()..])
        });
        // What explains nothing even beyond its ranges explains no more inside.
        if calibration.log_evidence > current.log_evidence && !is_plausible {
            calibration = with.calibrate_in_range(self.start)?;
        }
        Ok(Self::fitted(self.template, self.candidates, calibration, current, 0.0))
    }

    /// The fit, whose further steps are predicted to gain `predicted` nats.
    fn fitted(
        template: &Template,
        mut candidates: Vec<Candidate>,
        calibration: Calibration,
        current: &Calibration,
        predicted: f64,
    ) -> Fitted {
        let candidate = candidates.pop().expect("the candidate is the last in the model");
        let log_evidence = log_evidence(&candidate, &calibration, current) + predicted;
        let detectability = template.detectability.max(0.0).sqrt();
        Fitted {
            candidate,
            calibration,
            log_evidence,
            detectability,
            change: template.change.clone(),
        }
    }
}

/// Fits the model without the candidates again, from the values of their fits; `None` if no fit is better.
pub(super) fn retuned(
    problem: &Problem<'_>,
    current: &Calibration,
    fitted: &[Fitted],
) -> Result<Option<Calibration>, CalibrationError> {
    let mut best: Option<Calibration> = None;
    for fitted in fitted.iter().take(RESTARTS) {
        let values = fitted.calibration.values.rows(0, current.values.len()).into_owned();
        let begun = problem.begin(&values)?;
        let known = best.as_ref().unwrap_or(current).objective;
        if begun.state.predicted_objective() > (1.0 + DOUBT) * known {
            continue;
        }
        let again = problem.go_on(begun)?;
        if again.objective < known - BETTER {
            best = Some(again);
        }
    }
    Ok(best)
}
