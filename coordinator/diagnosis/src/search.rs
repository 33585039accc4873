//! The whole way from a recording to a name: baseline, alarm, candidates, acceptance.

use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::null_model::NullModel;
use crate::observation::Observation;
use crate::port_scan::{Port, PortScan};
use crate::screen::{Template, templates};
use crate::subject::Subject;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Probability of a false alarm on a recording without anything left out.
const FALSE_ALARM: f64 = 0.05;

/// Effects that are looked for one after the other.
const EFFECTS_MAX: usize = 3;

/// Candidates of one kind, and in all, that are fitted together with the baseline.
const REFINED_PER_KIND: usize = 2;
const REFINED_MAX: usize = 8;

/// Least log evidence in screening for a candidate to be fitted.
const SCREENED_MIN: f64 = 2.0;

/// Nats by which the likelihood is tempered: the model is not exact, and its errors hang together.
pub(crate) const TEMPERATURE: f64 = 3.0;

/// Fitted candidates from whose values the model without them is fitted anew.
const RESTARTS: usize = 3;

/// Nats by which such a fit must be better to take its place.
const BETTER: f64 = 3.0;

/// Least log evidence for an effect beside one that was accepted before, over the first one's: what
/// a first effect's model leaves unexplained looks like a small second one.
const FURTHER_SHARE_MIN: f64 = 0.25;

/// Least gain on held-out passes, in nats, for a name.
const HELD_OUT_MIN: f64 = 4.0;

/// What is going on, for a progress bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The baseline is fitted.
    Baseline,
    /// Candidates are screened.
    Screening,
    /// The best are fitted together with the baseline.
    Refinement,
    /// Speeds are held out and predicted.
    HeldOut,
}

/// A candidate that was fitted together with the baseline.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// What and where.
    pub candidate: Candidate,
    /// Baseline and parameters.
    pub calibration: Calibration,
    /// Log evidence for it against the model without it, in nats.
    pub log_evidence: f64,
    /// Length of its trace after re-tuning, `d'`, in the trial screened.
    pub detectability: f64,
    /// Its trace: whitened change of the log powers.
    pub change: DVector<f64>,
}

/// One search for an effect.
#[derive(Clone, Debug, Default)]
pub struct Round {
    /// Probability to see such evidence for anything if nothing is left out.
    pub p_value: f64,
    /// What was fitted, best first.
    pub fitted: Vec<Fitted>,
    /// What an unknown dynamic stiffness under a rail seat would explain.
    pub port: Option<Port>,
    /// Probability to see as much evidence for one if nothing is left out.
    pub port_p_value: f64,
    /// Gain of the best on each speed held out, in nats.
    pub held_out_gain: Vec<f64>,
    /// Whether the best was accepted.
    pub accepted: bool,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Search {
    /// The re-tuned baseline.
    pub baseline: Calibration,
    /// The baseline with all accepted extensions.
    pub last: Calibration,
    /// The accepted candidates.
    pub accepted: Vec<Candidate>,
    /// Each search, in order.
    pub rounds: Vec<Round>,
    /// What was observed, with its covariance.
    pub observation: Observation,
    /// Scatter to expect of each log power of a sleeper in the middle of the section.
    pub deviation: DVector<f64>,
    /// Log density of each speed when it is held out, in nats a log power: baseline, extended.
    pub held_out: [f64; 2],
}

/// A rough covariance for the first calibration, before null simulations of that track.
fn rough_covariance(subject: &Subject) -> DMatrix<f64> {
    let (size, bands) = (subject.forward.per_sleeper(), subject.forward.bands.count());
    DMatrix::from_fn(size, size, |i, j| {
        let distance = (i as f64 - j as f64) / 1.5;
        let together =
            if i / bands == j / bands { (-0.5 * distance * distance).exp() } else { 0.0 };
        0.06 * together + if i == j { 0.01 } else { 0.0 }
    })
}

/// The track's parameters to simulate null cases with.
///
/// # Errors
/// [`CalibrationError`] when no baseline is found.
pub fn first_calibration(subject: &Subject) -> Result<DVector<f64>, CalibrationError> {
    let covariances = vec![rough_covariance(subject); subject.forward.section.sleepers];
    let observation = Observation::new(subject.log_power.clone(), &covariances, |_| false)
        .ok_or(CalibrationError::NotFinite)?;
    let problem = Problem { forward: &subject.forward, observation: &observation, candidates: &[] };
    Ok(problem.calibrate(subject.forward.unknowns.typical())?.values)
}

/// Looks for physics that was left out.
///
/// `all` is what may be left out: usually the [`crate::candidates`] of the section and what other
/// tests of the recording suggest.
///
/// # Errors
/// [`CalibrationError`] when the model breaks down on the way.
pub fn search(
    subject: &Subject,
    null: &NullModel,
    start: DVector<f64>,
    all: &[Candidate],
    progress: &(impl Fn(Stage, f64) + Sync),
) -> Result<Search, CalibrationError> {
    progress(Stage::Baseline, 0.0);
    let setting = Setting::new(subject, null, &start)?;
    let observation = setting.observe(|_| false)?;
    let plain = Problem { forward: &subject.forward, observation: &observation, candidates: &[] };
    let baseline = plain.calibrate(start)?;
    let mut search = Search {
        last: baseline.clone(),
        baseline,
        accepted: Vec::new(),
        rounds: Vec::new(),
        observation: observation.clone(),
        deviation: setting.covariances[setting.covariances.len() / 2].diagonal().map(f64::sqrt),
        held_out: [0.0; 2],
    };
    let mut before = setting.held_out(&[], &search.baseline.values)?;
    let mut reached = before.clone();
    while search.accepted.len() < EFFECTS_MAX {
        let accepted = search.accepted.clone();
        let problem =
            Problem { forward: &subject.forward, observation: &observation, candidates: &accepted };
        let strongest = search.rounds.iter().filter_map(|round| round.fitted.first());
        let strongest = strongest.map(|fitted| fitted.log_evidence).fold(0.0, f64::max);
        let so_far = Reached { log_densities: &reached, strongest };
        let (mut round, mut scores) =
            setting.round(&problem, &search.last, all, so_far, progress)?;
        if let Some(better) = retuned(&problem, &search.last, &round.fitted)? {
            // The candidates found a better baseline on their way: the opponent gets it too.
            let gain = better.log_evidence - search.last.log_evidence;
            round.fitted.iter_mut().for_each(|fitted| fitted.log_evidence -= gain);
            if search.accepted.is_empty() {
                search.baseline = better.clone();
            }
            search.last = better;
            reached = setting.held_out(&accepted, &search.last.values)?;
            if search.accepted.is_empty() {
                before.clone_from(&reached);
            }
            let so_far = Reached { log_densities: &reached, strongest };
            (round, scores) = setting.round(&problem, &search.last, all, so_far, progress)?;
        }
        let goes_on = round.accepted;
        if let (true, Some(best)) = (goes_on, round.fitted.first()) {
            search.last = best.calibration.clone();
            search.accepted.push(best.candidate.clone());
            reached = scores;
        }
        search.rounds.push(round);
        if !goes_on {
            break;
        }
    }
    let mean = |scores: &[f64]| scores.iter().sum::<f64>() / subject.forward.count() as f64;
    search.held_out = [mean(&before), mean(&reached)];
    Ok(search)
}

/// How far earlier searches came.
#[derive(Clone, Copy)]
struct Reached<'a> {
    /// Log density of each speed when it is held out.
    log_densities: &'a [f64],
    /// Greatest log evidence of an accepted effect in nats.
    strongest: f64,
}

/// What stays the same through all searches.
struct Setting<'a> {
    subject: &'a Subject,
    log_power: DVector<f64>,
    covariances: Vec<DMatrix<f64>>,
    /// Differences of null simulations, less their offset.
    nulls: Vec<DVector<f64>>,
}

impl<'a> Setting<'a> {
    fn new(
        subject: &'a Subject,
        null: &NullModel,
        values: &DVector<f64>,
    ) -> Result<Self, CalibrationError> {
        let offset = null.offset();
        let repeated: Vec<f64> =
            (0..subject.forward.section.sleepers).flat_map(|_| offset.iter().copied()).collect();
        let offset = DVector::from_vec(repeated);
        let nulls = null
            .differences
            .iter()
            .map(|difference| DVector::from_column_slice(difference) - &offset)
            .collect();
        let covariances = subject.covariances(null, values)?;
        Ok(Self { subject, log_power: &subject.log_power - offset, covariances, nulls })
    }

    fn observe(&self, held_out: impl Fn(usize) -> bool) -> Result<Observation, CalibrationError> {
        Observation::new(self.log_power.clone(), &self.covariances, held_out)
            .ok_or(CalibrationError::NotFinite)
    }

    /// Log density of each speed, held out in turn; empty with a single speed.
    fn held_out(
        &self,
        candidates: &[Candidate],
        start: &DVector<f64>,
    ) -> Result<Vec<f64>, CalibrationError> {
        let forward = &self.subject.forward;
        let speeds = forward.speeds_m_s.len();
        if speeds < 2 {
            return Ok(Vec::new());
        }
        (0..speeds)
            .into_par_iter()
            .map(|speed| {
                let observation = self.observe(|row| row / forward.bands.count() == speed)?;
                let problem = Problem { forward, observation: &observation, candidates };
                Ok(problem.held_out(start.clone())?.log_density)
            })
            .collect()
    }

    /// One search, and the held-out log densities with its best candidate.
    fn round(
        &self,
        problem: &Problem<'_>,
        current: &Calibration,
        all: &[Candidate],
        Reached { log_densities: reached, strongest }: Reached<'_>,
        progress: &(impl Fn(Stage, f64) + Sync),
    ) -> Result<(Round, Vec<f64>), CalibrationError> {
        let trials: usize = all.iter().map(|candidate| candidate.trials.len()).sum();
        let done = std::sync::atomic::AtomicUsize::new(0);
        let templates = templates(problem, current, all, || {
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            progress(Stage::Screening, done as f64 / trials as f64);
        })?;
        let none = DVector::zeros(current.values.len());
        let screened: Vec<(f64, &Template)> = templates
            .iter()
            .map(|template| (template.log_evidence(&current.residual, &none), template))
            .collect();
        let highest = screened.iter().map(|(evidence, _)| *evidence).fold(f64::MIN, f64::max);
        let nulls = self.null_residuals(problem.observation, current);
        let excess = self.excess(current, &nulls);
        let p_value = tail_probability(&nulls, highest / excess, |residual, felt| {
            let evidence = templates.iter().map(|t| t.log_evidence(residual, felt));
            Some(evidence.fold(f64::MIN, f64::max))
        });
        let mut round = Round { p_value, ..Round::default() };
        if p_value > FALSE_ALARM {
            return Ok((round, Vec::new()));
        }
        let ports = PortScan::new(problem, current)?;
        round.port = ports.best(current, &current.residual, &none);
        if let Some(port) = &round.port {
            round.port_p_value =
                tail_probability(&nulls, port.log_evidence / excess, |residual, felt| {
                    ports.best(current, residual, felt).map(|port| port.log_evidence)
                });
        }
        let chosen = choose(screened, all);
        let count = chosen.len() as f64;
        progress(Stage::Refinement, 0.0);
        let done = std::sync::atomic::AtomicUsize::new(0);
        let mut fitted: Vec<Fitted> = chosen
            .into_par_iter()
            .filter_map(|template| {
                let fitted = refine(problem, current, &all[template.candidate], template);
                let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                progress(Stage::Refinement, done as f64 / count);
                fitted.ok()
            })
            .collect();
        fitted.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        round.fitted = fitted;
        progress(Stage::HeldOut, 0.0);
        let sure = (TEMPERATURE * 20_f64.ln()).max(FURTHER_SHARE_MIN * strongest);
        let best = round.fitted.first().filter(|best| best.log_evidence >= sure);
        let Some(best) = best else { return Ok((round, Vec::new())) };
        let with: Vec<Candidate> =
            problem.candidates.iter().chain([&best.candidate]).cloned().collect();
        let scores = self.held_out(&with, &best.calibration.values)?;
        round.held_out_gain =
            scores.iter().zip(reached).map(|(with, without)| with - without).collect();
        let gain: f64 = round.held_out_gain.iter().sum();
        let lost = round.held_out_gain.iter().filter(|gain| **gain <= 0.0).count();
        let predicted = round.held_out_gain.is_empty() || (gain >= HELD_OUT_MIN && lost <= 1);
        round.accepted = predicted;
        Ok((round, scores))
    }

    /// Whitened null differences.
    fn null_residuals(&self, observation: &Observation, current: &Calibration) -> Vec<Null> {
        let of = |null: &DVector<f64>| {
            let residual = observation.fitted(&observation.whiten(null));
            let felt = current.jacobian.tr_mul(&residual);
            Null { residual, felt }
        };
        self.nulls.par_iter().map(of).collect()
    }

    /// By how much the recording scatters about the model more than null simulations about theirs,
    /// at least one: the median over the sleepers, which one place does not change.
    fn excess(&self, current: &Calibration, nulls: &[Null]) -> f64 {
        let sleepers = self.covariances.len();
        let square = |residual: &DVector<f64>| {
            let size = residual.len() / sleepers;
            let of = |sleeper: usize| residual.rows(sleeper * size, size).norm_squared();
            median((0..sleepers).map(of).collect())
        };
        let fitted = |null: &Null| {
            square(&(&null.residual - &current.jacobian * current.precision.solve(&null.felt)))
        };
        let usual = median(nulls.par_iter().map(fitted).collect());
        (square(&current.residual) / usual).max(1.0)
    }
}

/// A null simulation as the calibration sees it.
struct Null {
    /// Whitened difference from the prediction.
    residual: DVector<f64>,
    /// Its product with the derivatives.
    felt: DVector<f64>,
}

/// Probability of evidence as great as `found` if nothing is left out: from the greatest evidence
/// in each null simulation, by a Gumbel distribution.
fn tail_probability(
    nulls: &[Null],
    found: f64,
    greatest: impl Fn(&DVector<f64>, &DVector<f64>) -> Option<f64> + Sync,
) -> f64 {
    let maxima: Vec<f64> =
        nulls.par_iter().filter_map(|null| greatest(&null.residual, &null.felt)).collect();
    gumbel_tail(&maxima, found)
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Probability that a maximum is as high as `value`, from a sample of maxima.
fn gumbel_tail(maxima: &[f64], value: f64) -> f64 {
    let count = maxima.len() as f64;
    let mean = maxima.iter().sum::<f64>() / count;
    let variance = maxima.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0);
    // Moments of the distribution exp(-exp(-(x - a) / b)): a + 0.5772 b, pi^2 b^2 / 6.
    let scale = (6.0 * variance).sqrt() / std::f64::consts::PI;
    let location = mean - 0.577_215_664_901_532_9 * scale;
    -(-(-(value - location) / scale).exp()).exp_m1()
}

/// The best trials: of each candidate one, of each kind a few.
fn choose<'t>(mut screened: Vec<(f64, &'t Template)>, all: &[Candidate]) -> Vec<&'t Template> {
    screened.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<&Template> = Vec::new();
    for (evidence, template) in screened {
        let kind = all[template.candidate].kind.physics;
        let same_kind = chosen.iter().filter(|t| all[t.candidate].kind.physics == kind).count();
        let known = chosen.iter().any(|t| t.candidate == template.candidate);
        if evidence < SCREENED_MIN || chosen.len() == REFINED_MAX {
            break;
        }
        if !known && same_kind < REFINED_PER_KIND {
            chosen.push(template);
        }
    }
    chosen
}

/// Fits a candidate together with the baseline and what was accepted before.
fn refine(
    problem: &Problem<'_>,
    current: &Calibration,
    candidate: &Candidate,
    template: &Template,
) -> Result<Fitted, CalibrationError> {
    let candidates: Vec<Candidate> =
        problem.candidates.iter().chain([candidate]).cloned().collect();
    let with = Problem { candidates: &candidates, ..*problem };
    let mut start: Vec<f64> = current.values.iter().copied().collect();
    start.extend(candidate.logarithms(&candidate.trials[template.trial]));
    let calibration = with.calibrate(DVector::from_vec(start))?;
    let log_evidence = calibration.log_evidence - current.log_evidence;
    let detectability = template.detectability.max(0.0).sqrt();
    let (candidate, change) = (candidate.clone(), template.change.clone());
    Ok(Fitted { candidate, calibration, log_evidence, detectability, change })
}

/// The model without the candidates, fitted anew from where they came out, if that is better.
fn retuned(
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
