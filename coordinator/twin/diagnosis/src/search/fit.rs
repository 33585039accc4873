//! Candidates fitted together with the baseline, and the baseline anew from where they came out.

use super::{Fitted, Stage};
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::screen::Template;
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Share of the best name's log evidence from which another kind may still be better, and how often
/// both are taken up again.
const RIVAL_SHARE: f64 = 0.7;
const RIVAL_FITS: usize = 3;

/// Fitted candidates from whose values the model without them is fitted anew.
const RESTARTS: usize = 3;

/// Nats by which such a fit must be better to take its place.
const BETTER: f64 = 3.0;

/// The better fit of each candidate, from fits in order.
fn once_each(fitted: Vec<Fitted>) -> Vec<Fitted> {
    let mut kept: Vec<Fitted> = Vec::new();
    for fitted in fitted {
        if kept.iter().all(|known| known.candidate.extension != fitted.candidate.extension) {
            kept.push(fitted);
        }
    }
    kept
}

/// Fits candidates one by one from these values; the fits, best first.
pub(super) fn fit(
    problem: &Problem<'_>,
    current: &Calibration,
    all: &[Candidate],
    starts: Vec<(&Template, DVector<f64>)>,
    progress: &(dyn Fn(Stage, f64) + Sync),
) -> Vec<Fitted> {
    let count = starts.len() as f64;
    progress(Stage::Refinement, 0.0);
    let done = AtomicUsize::new(0);
    let mut fitted: Vec<Fitted> = starts
        .into_par_iter()
        .filter_map(|(template, start)| {
            let fitted = refine(problem, current, &all[template.candidate], template, &start);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(Stage::Refinement, done as f64 / count);
            fitted.ok()
        })
        .collect();
    fitted.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    to_the_end(problem, current, once_each(fitted))
}

/// Fits the best candidate and what comes near it once more, from where they came out, if that is of
/// another kind: between look-alikes the last nats decide.
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

/// Takes a fit up again until it gains no more, in its parameters' ranges.
fn further(problem: &Problem<'_>, current: &Calibration, mut fitted: Fitted) -> Fitted {
    let candidates = [problem.candidates, std::slice::from_ref(&fitted.candidate)].concat();
    let with = Problem { candidates: &candidates, ..*problem };
    for _ in 0..RIVAL_FITS {
        let Ok(again) = with.calibrate_in_range(fitted.calibration.values.clone()) else { break };
        let gain = fitted.calibration.objective - again.objective;
        if gain > 0.0 {
            fitted.log_evidence = again.log_evidence - current.log_evidence;
            fitted.calibration = again;
        }
        if gain < BETTER {
            break;
        }
    }
    fitted
}

/// Fits a candidate together with the baseline, from these values, and what was accepted before; in
/// its parameters' ranges if it would end far beyond.
fn refine(
    problem: &Problem<'_>,
    current: &Calibration,
    candidate: &Candidate,
    template: &Template,
    start: &DVector<f64>,
) -> Result<Fitted, CalibrationError> {
    let candidates: Vec<Candidate> =
        problem.candidates.iter().chain([candidate]).cloned().collect();
    let with = Problem { candidates: &candidates, ..*problem };
    let mut start: Vec<f64> = start.iter().copied().collect();
    start.extend(candidate.logarithms(&candidate.trials[template.trial]));
    let start = DVector::from_vec(start);
    let mut calibration = with.calibrate(start.clone())?;
    let count = calibration.values.len();
    // What explains nothing even beyond its ranges explains no more inside.
    if calibration.log_evidence > current.log_evidence
        && !candidate.is_plausible(&calibration.values.as_slice()[count - candidate.free.len()..])
    {
        calibration = with.calibrate_in_range(start)?;
    }
    let log_evidence = calibration.log_evidence - current.log_evidence;
    let detectability = template.detectability.max(0.0).sqrt();
    let (candidate, change) = (candidate.clone(), template.change.clone());
    Ok(Fitted { candidate, calibration, log_evidence, detectability, change })
}

/// The model without the candidates, fitted anew from where they came out, if that is better.
pub(super) fn retuned(
    problem: &Problem<'_>,
    current: &Calibration,
    fitted: &[Fitted],
) -> Result<Option<Calibration>, CalibrationError> {
    let mut best: Option<Calibration> = None;
    for fitted in fitted.iter().take(RESTARTS) {
        let values = fitted.calibration.values.rows(0, current.values.len()).into_owned();
        let again = problem.calibrate(values)?;
        let known = best.as_ref().unwrap_or(current).objective;
        if again.objective < known - BETTER {
            best = Some(again);
        }
    }
    Ok(best)
}
