//! One search for an extension: screening, fit, test on held-out speeds, acceptance.

use super::chance::{excess, tail_probability, whitened};
use super::detected_shape::{detected_shape_first, is_detected};
use super::everywhere::everywhere;
use super::fit::fit;
use super::limits::{HELD_OUT_MIN, REFINED_PER_KIND};
use super::outlier_starts::{Far, OutlierStarts};
use super::probability::{Probabilities, unseen};
use super::runs::runs;
use super::threshold::{EvidenceThreshold, is_local_shape};
use super::{Fitted, Round, Stage};
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::held_out::HeldOutScore;
use crate::null_model::NullModel;
use crate::observation::Observation;
use crate::port_scan::{PortPlace, PortScan, UnknownElement};
use crate::prepared_recording::PreparedRecording;
use crate::screen::{Template, templates};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use tracktwin_number::floored;

/// Largest number of candidates that are fitted together with the baseline.
const REFINED_MAX: usize = 8;

/// Smallest log evidence of a fitted candidate in the screening.
const SCREENED_MIN: f64 = 2.0;

/// Share of the greatest gain of a trial with free strength from which a kind is fitted.
const ALONG_SHARE_MIN: f64 = 0.25;

/// Smallest gain in nats of unknown physics on held-out speeds; it is free in location and frequency. On
/// recordings of another simulator the gain was 58 for a true unknown and 5 for a false one.
const UNKNOWN_HELD_OUT_MIN: f64 = 8.0;

/// Probability of something visible being left out above which a candidate is accepted.
const SOMETHING_MIN: f64 = 0.5;

/// Data that all searches share.
pub(super) struct Setting<'a> {
    pub(super) prepared: &'a PreparedRecording,
    pub(super) log_power: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    /// Differences of null simulations, with the covariance of recordings.
    pub(super) nulls: Vec<DVector<f64>>,
}

impl<'a> Setting<'a> {
    pub(super) fn new(prepared: &'a PreparedRecording, null: &NullModel) -> Self {
        let nulls = null.drawn(prepared.forward.bands.count(), &prepared.pass_variance);
        let (log_power, covariance) =
            (prepared.expected_log_power(null), prepared.covariance(null));
        Self { prepared, log_power, covariance, nulls }
    }

    pub(super) fn observe(
        &self,
        held_out: impl Fn(usize) -> bool,
    ) -> Result<Observation, CalibrationError> {
        Observation::new(self.log_power.clone(), &self.covariance, held_out)
            .ok_or(CalibrationError::NotFinite)
    }

    /// Score of each speed, held out in turn; empty for a single speed.
    pub(super) fn held_out(
        &self,
        candidates: &[Candidate],
        start: &DVector<f64>,
    ) -> Result<Vec<HeldOutScore>, CalibrationError> {
        let forward = &self.prepared.forward;
        self.without_each_speed(|observation| {
            Problem { forward, observation, candidates }.held_out(start.clone())
        })
    }

    /// Gain in nats on each speed, held out in turn, of unknown physics at the port that the other speeds
    /// select. `ports` are those of all speeds on the track of `current`. Empty for a single speed.
    ///
    /// The gain in log predictive density is the log evidence with the speed minus that without it.
    pub(super) fn unknown_gains(
        &self,
        ports: &PortScan,
        current: &Calibration,
    ) -> Result<Vec<f64>, CalibrationError> {
        let forward = &self.prepared.forward;
        self.without_each_speed(|observation| {
            let problem = Problem { forward, observation, candidates: &[] };
            let others = problem.at(&current.values)?;
            let best = PortScan::new(&problem, &others)?.best(&others.residual, &others.gradient);
            let gain = best.and_then(|best| {
                let is_best = |place: &PortPlace| *place == best.place;
                let all = ports.best_where(&current.residual, &current.gradient, is_best)?;
                Some(all.log_evidence - best.log_evidence)
            });
            Ok(gain.unwrap_or(f64::NEG_INFINITY))
        })
    }

    /// Results of `of` for each speed, which is held out; empty for a single speed.
    fn without_each_speed<T: Send>(
        &self,
        of: impl Fn(&Observation) -> Result<T, CalibrationError> + Send + Sync,
    ) -> Result<Vec<T>, CalibrationError> {
        let bands = self.prepared.forward.bands.count();
        self.each_speed_held_out(|speed| of(&self.observe(|row| row / bands == speed)?))
    }

    /// Results of `of` for the number of each speed; empty for a single speed.
    pub(super) fn each_speed_held_out<T: Send>(
        &self,
        of: impl Fn(usize) -> Result<T, CalibrationError> + Send + Sync,
    ) -> Result<Vec<T>, CalibrationError> {
        let speeds = self.prepared.forward.speeds_m_s.len();
        let held_out = if speeds < 2 { 0..0 } else { 0..speeds };
        held_out.into_par_iter().map(of).collect()
    }

    /// Results of `of` for each speed, with all other speeds held out.
    pub(super) fn at_each_speed<T: Send>(
        &self,
        of: impl Fn(&Observation) -> Result<T, CalibrationError> + Sync,
    ) -> Result<Vec<T>, CalibrationError> {
        let forward = &self.prepared.forward;
        (0..forward.speeds_m_s.len())
            .into_par_iter()
            .map(|speed| of(&self.observe(|row| row / forward.bands.count() != speed)?))
            .collect()
    }

    /// One search: screens all candidates and, if the evidence is significant, fits the best ones. Kinds in
    /// `hopeless` are not tested without a location.
    pub(super) fn round(
        &self,
        problem: &Problem<'_>,
        current: &Calibration,
        all: &[Candidate],
        threshold: EvidenceThreshold<'_>,
        hopeless: &[&str],
        progress: &(dyn Fn(Stage, f64) + Sync),
    ) -> Result<(Round, PortScan), CalibrationError> {
        let trials: usize = all.iter().map(|candidate| candidate.trials.len()).sum();
        let done = AtomicUsize::new(0);
        let mut screened_with = templates(problem, current, all, &|| {
            let done = done.fetch_add(1, Ordering::Relaxed);
            progress(Stage::Screening, done as f64 / trials as f64);
        })?;
        let runs = runs(&screened_with, all, current);
        for mut template in templates(problem, current, &runs, &|| ())? {
            template.candidate += all.len();
            screened_with.push(template);
        }
        let far = Far::new(&problem.forward.unknowns, &current.values);
        let (all, templates) = (&[all, &runs, &far.on_runs(all)].concat()[..], screened_with);
        let screened: Vec<(f64, &Template)> = templates
            .iter()
            .map(|template| (template.log_evidence(&current.residual, &current.gradient), template))
            .collect();
        let ports = PortScan::new(problem, current)?;
        let mut round = self.alarm(problem, current, &screened, &ports);
        round.unseen = unseen(templates.iter().map(|template| {
            let kind = all[template.candidate].kind.physics;
            (kind, template.at_strengths(&current.residual, &current.gradient))
        }));
        let threshold = threshold.with_excess(round.excess);
        if round.is_significant() {
            let outlier_starts = OutlierStarts::new(problem, far, all)?;
            let mut starts =
                starts(problem, current, all, &templates, screened, threshold, hopeless)?;
            starts.extend(outlier_starts.starts());
            round.fitted = fit(problem, current, all, starts, progress);
            round.fitted.retain(|it| !threshold.is_random_surface(&it.candidate, it.log_evidence));
            let shapes_m = &self.prepared.detected_shapes_m;
            detected_shape_first(&mut round.fitted, &problem.forward.section, shapes_m);
        }
        Ok((round, ports))
    }

    /// Computes the probability of the greatest evidence among candidates and ports if nothing is left out.
    fn alarm(
        &self,
        problem: &Problem<'_>,
        current: &Calibration,
        screened: &[(f64, &Template)],
        ports: &PortScan,
    ) -> Round {
        let highest = screened.iter().map(|(evidence, _)| *evidence).fold(f64::MIN, f64::max);
        let nulls = whitened(&self.nulls, problem.observation, current);
        let excess = excess(current, &nulls, self.prepared.forward.section.sleepers());
        let p_value = tail_probability(&nulls, highest / excess, |residual, projected_gradient| {
            let evidence =
                screened.iter().map(|(_, t)| t.log_evidence(residual, projected_gradient));
            Some(evidence.fold(f64::MIN, f64::max))
        });
        let port = ports.best(&current.residual, &current.gradient);
        let port_p_value = port.as_ref().map_or(1.0, |port| {
            tail_probability(&nulls, port.log_evidence / excess, |residual, projected_gradient| {
                ports.best(residual, projected_gradient).map(|port| port.log_evidence)
            })
        });
        // The better of two tests.
        let p_value = floored(2.0 * p_value.min(port_p_value));
        Round { p_value, excess, port, port_p_value, ..Round::default() }
    }
}

/// Whether gains on held-out speeds, in nats, are large enough for a known kind; true for a single speed.
pub(super) fn is_predicted(gains: &[f64]) -> bool {
    gain_at_least(HELD_OUT_MIN, gains)
}

/// Whether gains on held-out speeds, in nats, are large enough for unknown physics; true for a single
/// speed.
pub(super) fn unknown_is_predicted(gains: &[f64]) -> bool {
    gain_at_least(UNKNOWN_HELD_OUT_MIN, gains)
}

fn gain_at_least(least: f64, gains: &[f64]) -> bool {
    let lost = gains.iter().filter(|gain| **gain <= 0.0).count();
    gains.is_empty() || (gains.iter().sum::<f64>() >= least && lost <= 1)
}

/// The best candidate, if it is more probable than the competing unknown physics, has enough evidence in
/// addition to earlier extensions, and something left out is more probable than nothing. Of a shape that the
/// passes alone show, something is known to be left out.
pub(super) fn accepted_candidate<'r>(
    round: &'r Round,
    competitor: Option<&UnknownElement>,
    prepared: &PreparedRecording,
    threshold: EvidenceThreshold<'_>,
) -> Option<&'r Fitted> {
    let probabilities = round.against(competitor);
    let Probabilities { group, unknown, .. } = probabilities;
    let best = round.fitted.first()?;
    let threshold = threshold.with_excess(round.excess);
    let is_shape = || {
        competitor
            .is_some_and(|competitor| is_shape_at(&competitor.place, &best.candidate, prepared))
    };
    let leads = group > unknown || is_shape();
    let (section, shapes_m) = (&prepared.forward.section, &prepared.detected_shapes_m);
    let is_likely = probabilities.something() > SOMETHING_MIN
        || is_detected(&best.candidate, section, shapes_m);
    (leads && is_likely && best.log_evidence >= threshold.of(&best.candidate)).then_some(best)
}

/// Whether a candidate is a shape of the rail that the inspection also detected, at the port of the unknown
/// physics. The force of a shape has a phase relative to the surface, which mean powers omit; unknown
/// physics may therefore fit better.
fn is_shape_at(port: &PortPlace, candidate: &Candidate, prepared: &PreparedRecording) -> bool {
    let section = &prepared.forward.section;
    let seats = match port {
        PortPlace::Seats(seats) => &seats[..],
        PortPlace::Between(pair) => pair,
        PortPlace::Wheel => return false,
    };
    let Some([from_m, to_m]) = candidate.extension.x_m else { return false };
    let spacing_m = section.track.design.sleeper.spacing_m;
    let [first, last] = [seats[0], seats[seats.len() - 1]];
    let seats_m = [section.x_m(first) - spacing_m, section.x_m(last) + spacing_m];
    seats.len() <= 2
        && seats_m[0] <= from_m
        && to_m <= seats_m[1]
        && is_detected(candidate, section, &prepared.detected_shapes_m)
}

/// The best trials: one of each candidate and a few of each kind; then, for each kind without a trial, the
/// one with the greatest gain at free strength, because the trials of a large effect may miss its size.
fn choose<'t>(
    mut screened: Vec<(f64, &'t Template)>,
    all: &[Candidate],
    residual: &DVector<f64>,
) -> Vec<&'t Template> {
    let kind = |template: &Template| all[template.candidate].kind.physics;
    let mut chosen: Vec<&Template> = Vec::new();
    screened.sort_by(|a, b| b.0.total_cmp(&a.0));
    for &(_, template) in screened.iter().take_while(|(evidence, _)| *evidence >= SCREENED_MIN) {
        let same_kind = chosen.iter().filter(|known| kind(known) == kind(template)).count();
        let known = chosen.iter().any(|known| known.candidate == template.candidate);
        if !known && same_kind < REFINED_PER_KIND && chosen.len() < REFINED_MAX {
            chosen.push(template);
        }
    }
    let mut along: Vec<(f64, &Template)> =
        screened.iter().map(|(_, template)| (template.along(residual), *template)).collect();
    along.sort_by(|a, b| b.0.total_cmp(&a.0));
    let threshold = along.first().map_or(f64::INFINITY, |(most, _)| ALONG_SHARE_MIN * most);
    for (_, template) in
        along.into_iter().take_while(|(gain, _)| *gain > threshold.max(SCREENED_MIN))
    {
        if chosen.iter().all(|known| kind(known) != kind(template)) && chosen.len() < REFINED_MAX {
            chosen.push(template);
        }
    }
    chosen
}

/// Trials to be fitted, each with its start values.
fn starts<'t>(
    problem: &Problem<'_>,
    current: &Calibration,
    all: &[Candidate],
    templates: &'t [Template],
    screened: Vec<(f64, &'t Template)>,
    threshold: EvidenceThreshold<'_>,
    hopeless: &[&str],
) -> Result<Vec<(&'t Template, DVector<f64>)>, CalibrationError> {
    let mut chosen = choose(screened, all, &current.residual);
    chosen.retain(|template| {
        threshold.may_be_reached(&all[template.candidate], template.along(&current.residual))
    });
    let mut starts: Vec<(&Template, DVector<f64>)> =
        chosen.into_iter().map(|template| (template, current.values.clone())).collect();
    if !problem.candidates.iter().all(is_local_shape) {
        return Ok(starts);
    }
    let typical = problem.forward.unknowns.with_typical(&current.values);
    let may_be = |candidate: &Candidate| !hopeless.contains(&candidate.kind.physics);
    let everywhere = everywhere(problem, &typical, all, templates, may_be)?;
    starts.extend(everywhere.into_iter().map(|template| (template, typical.clone())));
    Ok(starts)
}
