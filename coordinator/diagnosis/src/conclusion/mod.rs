//! From a search to the diagnosis that is written down.

mod alone;
mod apart;
mod fit;
mod nameless;
mod notes;
mod place;

pub use self::alone::passes_alone;
use self::nameless::UNKNOWN;
use crate::behaviour::Behaviour;
use crate::calibration::CalibrationError;
use crate::chain::Trouble;
use crate::finding::Finding;
use crate::first_look::FirstLook;
use crate::outcome::{Diagnosis, Estimate, FORMAT, Hypothesis, Location, Verdict};
use crate::port_scan::PortPlace;
use crate::search::{Fitted, Probabilities, Round, Search};
use crate::sentence::sentence;
use crate::subject::Subject;
use std::collections::BTreeMap;
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::{Class, Kind};

/// Probability to see such evidence for an unknown stiffness if nothing is left out, up to which it
/// is said to be there.
const PORT_ALARM: f64 = 0.01;

/// Probability of nothing at all below which something is left out even if no name predicts a
/// withheld speed better.
const NOTHING_LEFT: f64 = 0.02;

/// Probability that what is left beside a named effect is something new.
const REMAINDER_PRIOR: f64 = 0.2;

/// Greatest probability where nothing could be tested on a speed that was not fitted: structure and
/// geometry look alike at one speed.
const ONE_SPEED_MAX: f64 = 0.5;

/// Greatest probability where no pass repeats another: how far passes differ had to be assumed.
const ONE_PASS_MAX: f64 = 0.9;

/// What is left of a name's probability when it does not predict withheld speeds better, or a shape
/// that it does not have shows.
const FAILED_SHARE: f64 = 0.1;

/// Names that are given beside something unknown.
const NEAREST_MAX: usize = 3;

/// The parameter that counts waves around the wheel.
const ORDER: &str = "order";

/// Hypotheses of less probability are not worth a line.
const PROBABILITY_MIN: f64 = 0.001;

/// Everything that a conclusion is drawn from.
pub struct Evidence<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// What was compared.
    pub subject: &'a Subject,
    /// What the passes tell alone.
    pub look: &'a FirstLook,
    /// What the model tells.
    pub search: &'a Search,
}

impl Evidence<'_> {
    /// The diagnosis.
    ///
    /// # Errors
    /// [`CalibrationError`] when a calibrated track makes no model.
    pub fn conclude(&self) -> Result<Diagnosis, CalibrationError> {
        let mut hypotheses = self.hypotheses();
        let most = self.probability_max();
        for hypothesis in &mut hypotheses {
            hypothesis.probability = hypothesis.probability.min(most);
        }
        hypotheses.sort_by(|a, b| {
            b.probability.total_cmp(&a.probability).then(b.accepted.cmp(&a.accepted))
        });
        let verdict = verdict(&hypotheses);
        if verdict == Verdict::Consistent {
            hypotheses.clear();
        }
        let levels = self.levels()?;
        let fit = self.fit();
        let bias_removed = self.bias_removed(&hypotheses);
        let sleepers = self.subject.forward.section.sleepers;
        let nothing_left_out = self.nothing(&hypotheses).min(most);
        let sentence =
            sentence(verdict, &hypotheses, nothing_left_out, sleepers, &fit, &bias_removed);
        Ok(Diagnosis {
            format: FORMAT.to_owned(),
            recording: self.recording.name.clone(),
            verdict,
            sentence,
            nothing_left_out: Some(nothing_left_out),
            mismatches: self.mismatches(verdict, &levels),
            hypotheses,
            fit,
            bias_removed,
            track: self.track(),
            levels,
            notes: self.notes(),
        })
    }

    /// As sure as the recording lets anybody be.
    fn probability_max(&self) -> f64 {
        if self.speeds() == 1 {
            ONE_SPEED_MAX
        } else if self.repeats() {
            1.0
        } else {
            ONE_PASS_MAX
        }
    }

    /// Probability that nothing is left out, beside these hypotheses.
    fn nothing(&self, hypotheses: &[Hypothesis]) -> f64 {
        let first = self.search.rounds.first().map_or(1.0, |round| round.probabilities().nothing);
        let accepted = hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
        first * accepted.map(|hypothesis| 1.0 - hypothesis.probability).product::<f64>()
    }

    fn speeds(&self) -> usize {
        self.subject.forward.speeds_m_s.len()
    }

    /// Whether some pass repeats another at its speed.
    fn repeats(&self) -> bool {
        self.subject.pass_numbers.iter().any(|passes| passes.len() > 1)
    }

    fn hypotheses(&self) -> Vec<Hypothesis> {
        let mut all: Vec<Hypothesis> = Vec::new();
        let rounds = self.search.rounds.iter().filter(|round| round.p_value <= 0.05);
        for round in rounds {
            for hypothesis in self.of_round(round) {
                let known = all.iter_mut().find(|known| self.is_same(known, &hypothesis));
                match known {
                    Some(known) if known.accepted => {
                        known.probability = known.probability.max(hypothesis.probability);
                    }
                    Some(known) if known.probability >= hypothesis.probability => {}
                    Some(known) => *known = hypothesis,
                    None => all.push(hypothesis),
                }
            }
        }
        self.add_apart(&mut all);
        for finding in &self.look.findings {
            self.add_finding(finding, &mut all);
        }
        for finding in &self.look.nameless {
            self.add_nameless(finding, &mut all);
        }
        // What a faulty chain makes of the recording is not unknown physics, and what is left of a
        // saturated one no physics at all.
        let is_chain = |known: &Hypothesis| {
            Kind::from_name(&known.physics).is_some_and(|kind| kind.measuring_chain)
        };
        if all.iter().any(|known| known.accepted && is_chain(known)) {
            let saturated = |trouble: &Trouble| matches!(trouble, Trouble::Saturated { .. });
            let is_saturated = self.look.troubles.iter().any(saturated);
            let made_by_chain = |known: &&mut Hypothesis| {
                !is_chain(known) && (known.physics == UNKNOWN || is_saturated)
            };
            for known in all.iter_mut().filter(made_by_chain) {
                known.accepted = false;
                known.probability *= FAILED_SHARE;
            }
        }
        all.retain(|hypothesis| hypothesis.accepted || hypothesis.probability >= PROBABILITY_MIN);
        all
    }

    /// What one search fitted, as hypotheses.
    fn of_round(&self, round: &Round) -> Vec<Hypothesis> {
        let Probabilities { named, unknown, nothing } = round.probabilities();
        // What is left beside a named effect may be its model's error as well as something new.
        let first = self.search.rounds.first().is_some_and(|first| std::ptr::eq(first, round));
        let alone = first && !round.accepted;
        let is_new = if first || round.accepted { 1.0 } else { REMAINDER_PRIOR };
        let others = named.iter().copied().fold(nothing, f64::max);
        let is_there = alone && !round.port_strays;
        let is_port = is_there && round.port_p_value <= PORT_ALARM && unknown > others;
        // Something is there, but the names that come near failed on withheld speeds.
        let failed: f64 = named.iter().map(|probability| (1.0 - FAILED_SHARE) * probability).sum();
        let unnamed = is_there && !is_port && nothing < NOTHING_LEFT;
        let (kept, unknown) =
            if unnamed { (FAILED_SHARE, unknown + failed) } else { (is_new, unknown) };
        let mut hypotheses: Vec<Hypothesis> = round
            .fitted
            .iter()
            .zip(named)
            .enumerate()
            .map(|(rank, (fitted, probability))| {
                self.hypothesis(fitted, kept * probability, round.accepted && rank == 0)
            })
            .collect();
        if let Some(port) = &round.port {
            hypotheses.push(Hypothesis {
                physics: UNKNOWN.to_owned(),
                probability: unknown * if alone { 1.0 } else { REMAINDER_PRIOR },
                accepted: is_port || unnamed,
                location: self.location_of_port(&port.place),
                port: Some(port.place.name().to_owned()),
                behaviour: port.behaviour.as_ref().map(|behaviour| behaviour.element),
                parameters: port.behaviour.as_ref().map_or_else(BTreeMap::new, Behaviour::named),
                look_alikes: if unnamed { nearest(round) } else { Vec::new() },
                would_separate: match port.place {
                    PortPlace::Seats(_) => {
                        "a hammer test at the place: its receptance names the element"
                    }
                    PortPlace::Between(_) => {
                        "a hammer test from one sleeper to the other: its receptance names the element"
                    }
                    PortPlace::Wheel => "a tap test on the wheel: its receptance names the element",
                }
                .to_owned(),
                detectability: 0.0,
                log_evidence: port.log_evidence,
            });
        }
        if round.accepted {
            self.gather(&mut hypotheses);
        }
        hypotheses
    }

    /// Gives the accepted one, which is the first, what the same name has at its place: another
    /// fit of the same thing.
    fn gather(&self, hypotheses: &mut Vec<Hypothesis>) {
        let mut accepted = hypotheses.remove(0);
        let others = std::mem::take(hypotheses).into_iter();
        let (same, different): (Vec<_>, Vec<_>) =
            others.partition(|other| self.is_same(&accepted, other));
        accepted.probability += same.iter().map(|other| other.probability).sum::<f64>();
        hypotheses.push(accepted);
        hypotheses.extend(different);
    }

    /// Whether two hypotheses are one: the same name at the same place, or beside an accepted one.
    fn is_same(&self, known: &Hypothesis, other: &Hypothesis) -> bool {
        let is_fit = known.accepted && !other.accepted;
        let are_beside = match (&known.location, &other.location) {
            (Some(one), Some(another)) => {
                self.subject.forward.section.are_beside(one.x_m, another.x_m)
            }
            // Everywhere is beside all.
            _ => true,
        };
        known.physics == other.physics && (known.location == other.location || is_fit && are_beside)
    }

    fn hypothesis(&self, fitted: &Fitted, probability: f64, accepted: bool) -> Hypothesis {
        let Fitted { candidate, calibration, log_evidence, detectability, .. } = fitted;
        let first = calibration.values.len() - candidate.free.len();
        let covariance = calibration.precision.inverse();
        let parameters = candidate.free.iter().enumerate().map(|(index, parameter)| {
            let mean = calibration.values[first + index].exp();
            let deviation = covariance[(first + index, first + index)].sqrt();
            (parameter.name.to_owned(), Estimate { mean, sd: mean * deviation })
        });
        // Of whole numbers each is a candidate of its own.
        let order = candidate.extension.parameters.get(ORDER);
        let order = order.map(|&mean| (ORDER.to_owned(), Estimate { mean, sd: 0.0 }));
        Hypothesis {
            physics: candidate.kind.physics.to_owned(),
            probability,
            accepted,
            location: self.location_of(candidate),
            port: None,
            behaviour: None,
            parameters: parameters.chain(order).collect(),
            look_alikes: names(candidate.kind),
            would_separate: candidate.kind.would_separate.to_owned(),
            detectability: *detectability,
            log_evidence: *log_evidence,
        }
    }

    /// What the passes alone show stands by itself where the model has not found it as well.
    fn add_finding(&self, finding: &Finding, all: &mut Vec<Hypothesis>) {
        let Some(kind) = Kind::from_name(finding.physics) else { return };
        let probability = probability(finding);
        let same = all.iter_mut().filter(|known| known.physics == finding.physics);
        if let Some(known) = same.max_by_key(|known| known.accepted) {
            known.probability = known.probability.max(probability);
            if known.accepted {
                return;
            }
        }
        let at_wheel = |kind: &Kind| kind.classes.contains(&Class::WheelAngle);
        // What comes back with every turn is the wheel's, whatever else there is.
        let explains = |known: &Hypothesis| {
            let known_at_wheel = Kind::from_name(&known.physics).is_some_and(at_wheel);
            known.accepted && known.physics != UNKNOWN && (known_at_wheel || !at_wheel(kind))
        };
        let explained = !kind.measuring_chain && all.iter().any(explains);
        all.retain(|known| known.accepted || known.physics != finding.physics);
        if !explained {
            // The name that came near it is right after all.
            let is_it = |known: &&mut Hypothesis| {
                known.physics == UNKNOWN && known.look_alikes.iter().any(|it| it == finding.physics)
            };
            for unknown in all.iter_mut().filter(is_it) {
                unknown.accepted = false;
                unknown.probability *= FAILED_SHARE;
            }
        }
        all.push(Hypothesis {
            probability: if explained { probability.min(0.5) } else { probability },
            accepted: !explained,
            ..seen(finding, kind, self.location_of_finding(finding))
        });
    }
}

/// What a finding says as a hypothesis: accepted, as probable as it says.
fn seen(finding: &Finding, kind: &Kind, location: Option<Location>) -> Hypothesis {
    let estimate =
        |(&name, &(mean, sd)): (&&str, &(f64, f64))| (name.to_owned(), Estimate { mean, sd });
    Hypothesis {
        physics: finding.physics.to_owned(),
        probability: probability(finding),
        accepted: true,
        location,
        port: None,
        behaviour: None,
        parameters: finding.parameters.iter().map(estimate).collect(),
        look_alikes: names(kind),
        would_separate: kind.would_separate.to_owned(),
        detectability: 0.0,
        log_evidence: -finding.p_value.max(1e-300).ln(),
    }
}

fn probability(finding: &Finding) -> f64 {
    1.0 - finding.p_value.clamp(1e-6, 1.0)
}

fn verdict(hypotheses: &[Hypothesis]) -> Verdict {
    let Some(first) = hypotheses.iter().find(|hypothesis| hypothesis.accepted) else {
        return Verdict::Consistent;
    };
    match Kind::from_name(&first.physics) {
        None => Verdict::UnknownPhysics,
        Some(kind) if kind.measuring_chain => Verdict::MeasurementChain,
        Some(_) => Verdict::LeftOutPhysics,
    }
}

/// Names that what a search found may have, though none predicts withheld speeds better.
fn nearest(round: &Round) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for fitted in &round.fitted {
        let name = fitted.candidate.kind.physics;
        if names.len() < NEAREST_MAX && names.iter().all(|known| known != name) {
            names.push(name.to_owned());
        }
    }
    names
}

fn names(kind: &Kind) -> Vec<String> {
    kind.look_alikes.iter().map(|&name| name.to_owned()).collect()
}
