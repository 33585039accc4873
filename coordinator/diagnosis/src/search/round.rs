//! One search for an effect: screened, refined, held out, accepted or not.

use super::chance::{excess, tail_probability, whitened};
use super::probability::{Probabilities, TEMPERATURE, unseen};
use super::{Fitted, Round, Stage};
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::null_model::NullModel;
use crate::observation::Observation;
use crate::port_scan::{PortPlace, PortScan};
use crate::screen::{Template, templates};
use crate::section::Section;
use crate::subject::Subject;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use tracktwin_track::extension::Class;

/// Probability of a false alarm on a recording without anything left out.
const FALSE_ALARM: f64 = 0.05;

/// Candidates of one kind, and in all, that are fitted together with the baseline.
const REFINED_PER_KIND: usize = 2;
const REFINED_MAX: usize = 8;

/// Least log evidence in screening for a candidate to be fitted.
const SCREENED_MIN: f64 = 2.0;

/// Share of the greatest gain by a trial of free size from which a kind is fitted.
const ALONG_SHARE_MIN: f64 = 0.25;

/// Fitted candidates from whose values the model without them is fitted anew.
const RESTARTS: usize = 3;

/// Share of the best name's log evidence from which another kind may still be better, and how often
/// such fits are taken up again.
const RIVAL_SHARE: f64 = 0.7;
const RIVAL_FITS: usize = 3;

/// Nats by which such a fit must be better to take its place.
const BETTER: f64 = 3.0;

/// Least log evidence for an effect beside one that was accepted before, over the part of that one's
/// that falls to its place: what a model leaves unexplained looks like a small second effect there, if
/// not like one that is everywhere beside a shape at a place.
const FURTHER_SHARE_MIN: f64 = 0.25;

/// Spans on either side in which an effect at a place is felt.
const FELT_SPANS: f64 = 2.0;

/// By how much a candidate may gain more when it is fitted, with all of the baseline, than its best
/// trial of free size: beside an effect that is accepted what can't get far enough is not fitted.
const FITTED_GAIN: f64 = 3.0;

/// Least gain on held-out passes, in nats, for a name.
const HELD_OUT_MIN: f64 = 4.0;

/// What stays the same through all searches.
pub(super) struct Setting<'a> {
    pub(super) subject: &'a Subject,
    pub(super) log_power: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    /// Differences of null simulations, less their offset.
    pub(super) nulls: Vec<DVector<f64>>,
}

impl<'a> Setting<'a> {
    pub(super) fn new(subject: &'a Subject, null: &NullModel) -> Self {
        let offset = null.offset();
        let repeated: Vec<f64> =
            (0..subject.forward.section.sleepers).flat_map(|_| offset.iter().copied()).collect();
        let offset = DVector::from_vec(repeated);
        let nulls = null
            .differences
            .iter()
            .map(|difference| DVector::from_column_slice(difference) - &offset)
            .collect();
        let covariance = subject.covariance(null);
        Self { subject, log_power: &subject.log_power - offset, covariance, nulls }
    }

    pub(super) fn observe(
        &self,
        held_out: impl Fn(usize) -> bool,
    ) -> Result<Observation, CalibrationError> {
        Observation::new(self.log_power.clone(), &self.covariance, held_out)
            .ok_or(CalibrationError::NotFinite)
    }

    /// Log density of each speed, held out in turn; empty with a single speed.
    pub(super) fn held_out(
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

    /// One search: all candidates screened and, if there is anything, the best fitted.
    pub(super) fn round(
        &self,
        problem: &Problem<'_>,
        current: &Calibration,
        all: &[Candidate],
        least: Least<'_>,
        progress: &(impl Fn(Stage, f64) + Sync),
    ) -> Result<Round, CalibrationError> {
        let trials: usize = all.iter().map(|candidate| candidate.trials.len()).sum();
        let done = AtomicUsize::new(0);
        let templates = templates(problem, current, all, || {
            let done = done.fetch_add(1, Ordering::Relaxed);
            progress(Stage::Screening, done as f64 / trials as f64);
        })?;
        let screened: Vec<(f64, &Template)> = templates
            .iter()
            .map(|template| (template.log_evidence(&current.residual, &current.gradient), template))
            .collect();
        let mut round = self.alarm(problem, current, &screened)?;
        round.unseen = unseen(templates.iter().map(|template| {
            let kind = all[template.candidate].kind.physics;
            (kind, template.at_strengths(&current.residual, &current.gradient))
        }));
        if round.p_value <= FALSE_ALARM {
            let starts = starts(problem, current, all, &templates, screened, least);
            round.fitted = fit(problem, current, all, starts, progress);
        }
        Ok(round)
    }

    /// How probable the greatest evidence among candidates and ports is if nothing is left out.
    fn alarm(
        &self,
        problem: &Problem<'_>,
        current: &Calibration,
        screened: &[(f64, &Template)],
    ) -> Result<Round, CalibrationError> {
        let highest = screened.iter().map(|(evidence, _)| *evidence).fold(f64::MIN, f64::max);
        let nulls = whitened(&self.nulls, problem.observation, current);
        let excess = excess(current, &nulls, self.subject.forward.section.sleepers);
        let p_value = tail_probability(&nulls, highest / excess, |residual, felt| {
            let evidence = screened.iter().map(|(_, t)| t.log_evidence(residual, felt));
            Some(evidence.fold(f64::MIN, f64::max))
        });
        let ports = PortScan::new(problem, current)?;
        let port = ports.best(&current.residual, &current.gradient);
        let port_p_value = port.as_ref().map_or(1.0, |port| {
            tail_probability(&nulls, port.log_evidence / excess, |residual, felt| {
                ports.best(residual, felt).map(|port| port.log_evidence)
            })
        });
        // The better of two tests.
        let p_value = (2.0 * p_value.min(port_p_value)).min(1.0);
        Ok(Round { p_value, port, port_p_value, ..Round::default() })
    }
}

/// Whether gains on held-out speeds in nats are those of a name; without a second speed nothing
/// speaks against one.
pub(super) fn is_predicted(gains: &[f64]) -> bool {
    let lost = gains.iter().filter(|gain| **gain <= 0.0).count();
    gains.is_empty() || (gains.iter().sum::<f64>() >= HELD_OUT_MIN && lost <= 1)
}

/// The least log evidence for a name, beside what is accepted already with its own log evidence.
#[derive(Clone, Copy)]
pub(super) struct Least<'a> {
    pub(super) accepted: &'a [(Candidate, f64)],
    pub(super) section: &'a Section,
}

impl Least<'_> {
    fn of(self, candidate: &Candidate) -> f64 {
        let known = self.accepted.iter();
        let beside = known.map(|(known, evidence)| self.share(known, candidate) * evidence);
        beside.fold(TEMPERATURE * 20_f64.ln(), f64::max)
    }

    /// Share of an effect's log evidence that a candidate needs beside it.
    fn share(self, known: &Candidate, candidate: &Candidate) -> f64 {
        if candidate.is_everywhere() && is_local_shape(known) {
            return 0.0;
        }
        let [one, other] = [known, candidate].map(|candidate| self.felt(candidate));
        if other[1] < one[0] || one[1] < other[0] {
            return 0.0;
        }
        FURTHER_SHARE_MIN * ((other[1] - other[0]) / (one[1] - one[0])).min(1.0)
    }

    /// From which sleeper to which a candidate is felt, in spacings.
    fn felt(self, candidate: &Candidate) -> [f64; 2] {
        let last = (self.section.sleepers - 1) as f64;
        let place = match (&candidate.extension.sleepers, candidate.extension.x_m) {
            (Some(sleepers), _) => sleepers
                .iter()
                .map(|&sleeper| sleeper as f64)
                .fold([last, 0.0], |[from, to], s| [from.min(s), to.max(s)]),
            (None, Some(x_m)) => {
                let spacing_m = self.section.design.sleeper.spacing_m;
                x_m.map(|x_m| (x_m - self.section.first_x_m) / spacing_m)
            }
            (None, None) => [0.0, last],
        };
        [place[0] - FELT_SPANS, place[1] + FELT_SPANS]
    }

    /// Whether fitting a candidate may give it that much, from the gain in nats of a trial of free
    /// size.
    fn may_be_reached(self, candidate: &Candidate, gain: f64) -> bool {
        self.accepted.is_empty() || FITTED_GAIN * gain >= self.of(candidate)
    }
}

/// The best candidate, if something unknown does not speak against it and it is sure enough beside
/// earlier effects.
pub(super) fn sure<'r>(
    round: &'r Round,
    section: &Section,
    least: Least<'_>,
) -> Option<&'r Fitted> {
    let Probabilities { named, unknown, .. } = round.probabilities();
    let best = round.fitted.first()?;
    let leads = named[0] > unknown || is_shape_at_port(&best.candidate, round, section);
    (leads && best.log_evidence >= least.of(&best.candidate)).then_some(best)
}

/// Whether it is a shape of the rail at a place: it adds power there, and what its model lacks does
/// not look like another track.
fn is_local_shape(candidate: &Candidate) -> bool {
    candidate.kind.classes.contains(&Class::Wavelength) && !candidate.is_everywhere()
}

/// Whether a candidate is a shape of the rail where the unknown is: the force of a shape adds to the
/// surface's with a phase that mean powers leave out, so that an unknown fits better beside it.
fn is_shape_at_port(candidate: &Candidate, round: &Round, section: &Section) -> bool {
    let is_shape = is_local_shape(candidate);
    let seats = match round.port.as_ref().map(|port| &port.place) {
        Some(PortPlace::Seats(seats)) => &seats[..],
        Some(PortPlace::Between(pair)) => pair,
        Some(PortPlace::Wheel) | None => return false,
    };
    let Some([from_m, to_m]) = candidate.extension.x_m else { return false };
    let spacing_m = section.design.sleeper.spacing_m;
    let [first, last] = [seats[0], seats[seats.len() - 1]];
    let seats_m = [section.x_m(first) - spacing_m, section.x_m(last) + spacing_m];
    is_shape && seats.len() <= 2 && seats_m[0] <= from_m && to_m <= seats_m[1]
}

/// The best trials: of each candidate one, of each kind a few; then of each kind without any the
/// one that points best along the residual, for a large effect's trials may miss its size.
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
    let least = along.first().map_or(f64::INFINITY, |(most, _)| ALONG_SHARE_MIN * most);
    for (_, template) in along.into_iter().take_while(|(gain, _)| *gain > least.max(SCREENED_MIN)) {
        if chosen.iter().all(|known| kind(known) != kind(template)) && chosen.len() < REFINED_MAX {
            chosen.push(template);
        }
    }
    chosen
}

/// Trials to be fitted, each with the values that it is fitted from.
fn starts<'t>(
    problem: &Problem<'_>,
    current: &Calibration,
    all: &[Candidate],
    templates: &'t [Template],
    screened: Vec<(f64, &'t Template)>,
    least: Least<'_>,
) -> Vec<(&'t Template, DVector<f64>)> {
    let mut chosen = choose(screened, all, &current.residual);
    chosen.retain(|template| {
        least.may_be_reached(&all[template.candidate], template.along(&current.residual))
    });
    let mut starts: Vec<(&Template, DVector<f64>)> =
        chosen.into_iter().map(|template| (template, current.values.clone())).collect();
    if !problem.candidates.iter().all(is_local_shape) {
        return starts;
    }
    // The baseline imitates what is everywhere by values far from the track's.
    let unknowns = &problem.forward.unknowns;
    let mut typical = current.values.clone();
    typical.rows_mut(0, unknowns.count()).copy_from(&unknowns.typical());
    let everywhere = everywhere(templates, all, &current.residual);
    starts.extend(everywhere.into_iter().map(|template| (template, typical.clone())));
    starts
}

/// Of each candidate that is everywhere the trial that points best along the residual.
fn everywhere<'t>(
    templates: &'t [Template],
    all: &[Candidate],
    residual: &DVector<f64>,
) -> Vec<&'t Template> {
    let best = |number: usize| {
        let trials = templates.iter().filter(|template| template.candidate == number);
        trials.max_by(|a, b| a.along(residual).total_cmp(&b.along(residual)))
    };
    (0..all.len()).filter(|number| all[*number].is_everywhere()).filter_map(best).collect()
}

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
fn fit(
    problem: &Problem<'_>,
    current: &Calibration,
    all: &[Candidate],
    starts: Vec<(&Template, DVector<f64>)>,
    progress: &(impl Fn(Stage, f64) + Sync),
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
    if !candidate.is_plausible(&calibration.values.as_slice()[count - candidate.free.len()..]) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidate::candidates;
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn beside_an_effect_a_candidate_needs_a_quarter_of_what_falls_to_its_place() {
        let section = Section::new(TrackDesign::v_track(), 24, 1.0);
        let all = candidates(&section);
        let of = |physics: &str, sleepers: Option<&[usize]>| {
            let found = all.iter().find(|candidate| {
                candidate.kind.physics == physics
                    && candidate.extension.x_m.is_none()
                    && candidate.extension.sleepers.as_deref() == sleepers
            });
            found.unwrap()
        };
        let joint_at = |span: f64| {
            let x_m = section.first_x_m + span * section.design.sleeper.spacing_m;
            let is_there = |at: [f64; 2]| (at[0] - x_m).abs() < 1e-9;
            let is_it = |candidate: &&Candidate| {
                candidate.kind.physics == "rail_joint"
                    && candidate.extension.x_m.is_some_and(is_there)
            };
            all.iter().find(is_it).unwrap()
        };
        let least = Least { accepted: &[], section: &section };
        let (bolts, axle_box) = (of("sleeper_bolt", None), of("flexible_axle_box", None));
        let (gap, far) = (of("hanging_sleeper", Some(&[3])), of("sleeper_bolt", Some(&[20])));
        let near = of("missing_railpad", Some(&[4]));
        assert_eq!(least.share(gap, near), 0.25);
        assert_eq!(least.share(gap, far), 0.0);
        // Two spans on either side of one sleeper, and of twenty-four.
        assert_eq!(least.share(axle_box, gap), 0.25 * 4.0 / 27.0);
        assert_eq!(least.share(axle_box, bolts), 0.25);
        assert_eq!(least.share(gap, bolts), 0.25);
        assert_eq!(least.share(joint_at(10.0), bolts), 0.0);
        assert_eq!(least.share(joint_at(10.0), joint_at(10.5)), 0.25);
    }
}
