//! Search for left-out physics: baseline, alarm, candidates, acceptance.

mod chance;
mod choice;
mod detected_shape;
mod everywhere;
mod extent;
mod fit;
mod holes;
mod limits;
mod nested;
mod outlier_starts;
mod patches;
mod probability;
mod remainder;
mod round;
mod runs;
mod speed_disagreement;
#[cfg(test)]
mod testing;
mod threshold;

pub(crate) use extent::Extent;
pub(crate) use limits::HELD_OUT_MIN;
pub(crate) use probability::{EVIDENCE_TEMPERING, Probabilities};

use self::fit::{retuned, with_earlier};
use self::limits::FALSE_ALARM;
use self::round::{Setting, accepted_candidate, unknown_is_predicted};
use self::threshold::EvidenceThreshold;
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::forward::Forward;
use crate::held_out::HeldOutScore;
use crate::null_model::NullModel;
use crate::observation::Observation;
use crate::patch_scan::Patch;
use crate::port_scan::{PortPlace, PortScan, UnknownElement};
use crate::prepared_recording::PreparedRecording;
use crate::section::Section;
use nalgebra::{DMatrix, DVector};

/// Largest number of successive searches.
const EFFECTS_MAX: usize = 6;

/// A kind without a location whose log evidence in nats is lower is not tested in the next search.
const HOPELESS: f64 = -100.0;

/// Stage of a search, for a progress bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Fit of the baseline.
    Baseline,
    /// Screening of the candidates.
    Screening,
    /// Fit of the best candidates together with the baseline.
    Refinement,
    /// Prediction of held-out speeds.
    HeldOut,
}

/// A candidate that was fitted together with the baseline.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The candidate: kind and location.
    pub candidate: Candidate,
    /// Fit of the baseline with the candidate's parameters.
    pub calibration: Calibration,
    /// Log ratio of the evidence to the model without the candidate, in nats.
    pub log_evidence: f64,
    /// Detectability `d'` of the screened trial.
    pub detectability: f64,
    /// Signature: whitened change of the log powers.
    pub change: DVector<f64>,
}

/// One search for an extension.
#[derive(Clone, Debug, Default)]
pub struct Round {
    /// Probability of the greatest evidence if nothing is left out.
    pub p_value: f64,
    /// Ratio, at least one, of the squared residual before the search to that of null simulations: median over the
    /// sleepers.
    pub excess: f64,
    /// Share of the catalogue that would not be detected in this recording.
    pub unseen: f64,
    /// Fitted candidates, the best first.
    pub fitted: Vec<Fitted>,
    /// Best unknown dynamic stiffness of the port scan.
    pub port: Option<UnknownElement>,
    /// Probability of its evidence if nothing is left out.
    pub port_p_value: f64,
    /// Unknown dynamic stiffness in the residual at the location of the last accepted candidate, if no
    /// further one is accepted.
    pub unknown_residual: Option<UnknownElement>,
    /// Gain of an unknown dynamic stiffness at each held-out speed, in nats; its port is selected without
    /// this speed. Computed in the first search if no candidate is accepted.
    pub unknown_gain: Vec<f64>,
    /// Gain of the best candidate at each held-out speed, in nats.
    pub held_out_gain: Vec<f64>,
    /// Whether the best candidate was accepted.
    pub accepted: bool,
    /// Evidence in nats for unknown physics in the residual at the best candidate's location, if it led to
    /// the rejection of the candidate.
    pub remainder: Option<f64>,
}

impl Round {
    /// Whether the evidence by chance is rarer than the false-alarm rate.
    pub fn is_significant(&self) -> bool {
        self.p_value <= FALSE_ALARM
    }

    /// Whether an unknown dynamic stiffness predicts held-out speeds.
    pub fn unknown_is_predictive(&self) -> bool {
        unknown_is_predicted(&self.unknown_gain)
    }
}

/// Result of a search for left-out physics.
#[derive(Clone, Debug)]
pub struct SearchOutcome {
    /// The calibrated baseline.
    pub baseline: Calibration,
    /// The baseline with all accepted extensions.
    pub last: Calibration,
    /// The baseline with all accepted extensions, less fitted to the sleepers at which local ones act.
    pub estimates: Calibration,
    /// The accepted candidates.
    pub accepted: Vec<Candidate>,
    /// Each search, in order.
    pub rounds: Vec<Round>,
    /// The observed log powers with their covariance.
    pub observation: Observation,
    /// Expected standard deviation of each log power of a sleeper, in nats.
    pub deviation: DVector<f64>,
    /// Gain of a model with a separate track and surface for each speed, in nats, over a model of one track
    /// with all accepted physics. It is negative if all speeds passed the same track.
    pub speed_disagreement: f64,
    /// Visible patch in the residual of the final model, with the probability of such a patch if nothing is
    /// left out; `None` if there is none, or if it does not predict held-out speeds.
    pub patch: Option<(Patch, f64)>,
    /// Mean log density of held-out log powers in nats, for baseline and extended model; zero for a single
    /// speed.
    pub held_out: [f64; 2],
}

/// A rough covariance for the first calibration, before the null simulations of that track.
fn rough_covariance(prepared: &PreparedRecording) -> DMatrix<f64> {
    let (size, bands) = (prepared.forward.per_sleeper(), prepared.forward.bands.count());
    DMatrix::from_fn(size, size, |i, j| {
        let distance = (i as f64 - j as f64) / 1.5;
        let together =
            if i / bands == j / bands { (-0.5 * distance * distance).exp() } else { 0.0 };
        0.06 * together + if i == j { 0.01 } else { 0.0 }
    })
}

/// Calibrates the baseline by a rough covariance; the result serves as parameters of the null simulations.
/// Known physics keeps the values of its first trial, and these follow the baseline in the result.
///
/// # Errors
/// [`CalibrationError`] if the calibration fails.
pub fn first_calibration(
    prepared: &PreparedRecording,
    known: &[Candidate],
) -> Result<DVector<f64>, CalibrationError> {
    let covariance = prepared.of_compared(rough_covariance(prepared));
    let observation = Observation::new(prepared.log_power.clone(), &covariance, |_| false)
        .ok_or(CalibrationError::NotFinite)?;
    let held: Vec<Candidate> = known.iter().map(Candidate::held).collect();
    let problem =
        Problem { forward: &prepared.forward, observation: &observation, candidates: &held };
    let baseline = problem.calibrate_widely(prepared.forward.unknowns.typical())?.values;
    let trials: Vec<&[f64]> = known.iter().map(Candidate::first_trial).collect();
    Ok(Problem { candidates: known, ..problem }.start(&baseline, &trials))
}

/// Searches for left-out physics.
///
/// `all` are the candidates: usually the [`crate::candidates`] of the section and those that an inspection
/// suggests.
///
/// # Errors
/// [`CalibrationError`] if a calibration fails.
pub fn search(
    prepared: &PreparedRecording,
    null: &NullModel,
    start: DVector<f64>,
    all: &[Candidate],
    progress: &(dyn Fn(Stage, f64) + Sync),
) -> Result<SearchOutcome, CalibrationError> {
    progress(Stage::Baseline, 0.0);
    let setting = Setting::new(prepared, null);
    let observation = setting.observe(|_| false)?;
    let plain = Problem { forward: &prepared.forward, observation: &observation, candidates: &[] };
    let baseline = plain.calibrate_widely(start)?;
    let waves = setting.waves(&plain, &baseline)?;
    let mut search = SearchOutcome {
        last: baseline.clone(),
        estimates: baseline.clone(),
        baseline,
        accepted: Vec::new(),
        rounds: Vec::new(),
        observation,
        deviation: setting.covariance.diagonal().map(f64::sqrt),
        speed_disagreement: f64::NEG_INFINITY,
        patch: None,
        held_out: [0.0; 2],
    };
    let all = &[all, waves.as_slice()].concat();
    let before = setting.held_out(&[], &search.baseline.values)?;
    let mut densities = vec![log_densities(&before)];
    while search.accepted.len() < EFFECTS_MAX
        && search.search_round(&setting, all, &mut densities, progress)?
    {}
    search.retract_names(&prepared.forward.section);
    search.compare_speeds(&setting)?;
    search.estimates = search.estimates(&prepared.forward)?;
    let with = Problem {
        forward: &prepared.forward,
        observation: &search.observation,
        candidates: &search.accepted,
    };
    search.patch = setting.last_patch(&with, &search.last)?;
    let mean = |scores: &[f64]| scores.iter().sum::<f64>() / prepared.forward.count() as f64;
    search.held_out = [mean(&densities[0]), mean(&densities[search.accepted.len()])];
    Ok(search)
}

fn log_densities(scores: &[HeldOutScore]) -> Vec<f64> {
    scores.iter().map(|score| score.log_density).collect()
}

impl Round {
    /// Kinds without a location whose evidence is so low that they need not be tested again.
    fn hopeless(&self) -> Vec<&'static str> {
        let is_far =
            |fitted: &&Fitted| fitted.candidate.is_everywhere() && fitted.log_evidence < HOPELESS;
        self.fitted.iter().filter(is_far).map(|fitted| fitted.candidate.kind.physics).collect()
    }
}

impl SearchOutcome {
    /// The last fit again, from the baseline: the covariance of each sleeper contains the error of local
    /// extensions, to which the values that all sleepers share would otherwise be fitted.
    fn estimates(&self, forward: &Forward) -> Result<Calibration, CalibrationError> {
        let (observation, candidates) = (&self.observation, &self.accepted[..]);
        let plain = Problem { forward, observation, candidates };
        let factors = plain.inexactness(&self.last.values)?;
        if factors.iter().all(|factor| *factor == 1.0) {
            return Ok(self.last.clone());
        }
        let observation = &observation.clone().with_factors(&factors);
        let mut start = self.last.values.clone();
        let unknowns = forward.unknowns.count();
        start.rows_mut(0, unknowns).copy_from(&self.baseline.values.rows(0, unknowns));
        Problem { observation, ..plain }.calibrate_in_range(start)
    }

    /// Searches for one more extension; returns whether one was accepted. `densities` are the log densities
    /// of each held-out speed, for the baseline and for each number of accepted extensions.
    fn search_round(
        &mut self,
        setting: &Setting<'_>,
        all: &[Candidate],
        densities: &mut Vec<Vec<f64>>,
        progress: &(dyn Fn(Stage, f64) + Sync),
    ) -> Result<bool, CalibrationError> {
        let (accepted, observation) = (self.accepted.clone(), self.observation.clone());
        let forward = &setting.prepared.forward;
        let problem = Problem { forward, observation: &observation, candidates: &accepted };
        // The rounds so far are those whose best was accepted.
        let best = self.rounds.iter().filter_map(|round| round.fitted.first());
        let known: Vec<(Candidate, f64)> =
            best.map(|fitted| (fitted.candidate.clone(), fitted.log_evidence)).collect();
        let detected_shapes_m = &setting.prepared.detected_shapes_m;
        let threshold = EvidenceThreshold::new(&known, &forward.section, detected_shapes_m);
        let hopeless = self.rounds.last().map_or(Vec::new(), Round::hopeless);
        let (mut round, mut ports) =
            setting.round(&problem, &self.last, all, threshold, &hopeless, progress)?;
        if let Some(better) = retuned(&problem, &self.last, &round.fitted)? {
            // The fits of the candidates found a better baseline, which is used from here on.
            let before = std::mem::replace(&mut self.last, better);
            let hopeless = round.hopeless();
            let earlier = round.fitted;
            let held_out = setting.held_out(&accepted, &self.last.values)?;
            densities[accepted.len()] = log_densities(&held_out);
            // What a name that is taken back leaves.
            match self.rounds.last_mut().and_then(|round| round.fitted.first_mut()) {
                Some(fitted) => fitted.calibration = self.last.clone(),
                None => self.baseline = self.last.clone(),
            }
            (round, ports) =
                setting.round(&problem, &self.last, all, threshold, &hopeless, progress)?;
            let lost = self.last.log_evidence - before.log_evidence;
            round.fitted = with_earlier(round.fitted, earlier, lost);
        }
        let competitor = self.competing_unknown(&round, &ports, &forward.section);
        if let Some(best) =
            accepted_candidate(&round, competitor.as_ref(), setting.prepared, threshold)
        {
            progress(Stage::HeldOut, 0.0);
            round.held_out_gain =
                self.accept_if_predictive(best, &round.fitted, setting, densities)?;
            round.accepted = self.accepted.len() > accepted.len();
            if round.accepted {
                round.port = competitor;
            }
        }
        let found_another = round.accepted;
        if !found_another {
            round.unknown_residual = self.unknown_residual(&ports, &forward.section);
        }
        if !found_another && accepted.is_empty() && round.is_significant() {
            round.unknown_gain = setting.unknown_gains(&ports, &self.last)?;
        }
        self.rounds.push(round);
        Ok(found_another)
    }

    /// Unknown physics that competes with the best candidate of a search. If extensions were accepted
    /// before, only ports within the reach of the candidate compete; elsewhere an unknown would be another
    /// effect.
    fn competing_unknown(
        &self,
        round: &Round,
        ports: &PortScan,
        section: &Section,
    ) -> Option<UnknownElement> {
        let Some(best) = round.fitted.first().filter(|_| !self.accepted.is_empty()) else {
            return round.port.clone();
        };
        let reach = Extent::of(&best.candidate, section).with_reach();
        let is_within_reach = |place: &PortPlace| reach.meets(Extent::of_port(place, section));
        ports.best_where(&self.last.residual, &self.last.gradient, is_within_reach)
    }
}
