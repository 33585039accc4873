//! Hypotheses from the fits of a search.

use super::finding::probability_of;
use super::{Evidence, FAILED_SHARE, UNPREDICTED_MAX, names};
use crate::behaviour::Behaviour;
use crate::estimate::Estimate;
use crate::outcome::{Hypothesis, UNKNOWN, meet};
use crate::port_scan::UnknownElement;
use crate::search::{EVIDENCE_TEMPERING, Fitted, Probabilities, Round};
use crate::section::Section;
use std::collections::BTreeMap;
use tracktwin_track::extension::{EffectFamily, Kind, LookAlikeGroup};

/// Largest probability by chance of the evidence for an unknown stiffness that is reported.
const PORT_ALARM: f64 = 0.01;

/// If the probability of nothing is below this, physics is left out even if neither a kind nor something
/// unknown predicts a speed that was held out.
const NOTHING_LEFT: f64 = 0.05;

/// If chance explains a residual less probably than this, and speeds that were held out have it, too, physics is left
/// out, even if no kind and no unknown element has enough evidence.
const LIKELY: f64 = 0.5;

/// Probability that a residual in addition to an accepted extension is new physics.
const REMAINDER_PRIOR: f64 = 0.2;

/// Share of the log evidence for an unknown stiffness from which a kind at its location explains most of it.
const LIKE_SHARE: f64 = 0.5;

/// Largest number of similar kinds that are listed for unknown physics.
const NEAREST_MAX: usize = 3;

/// Name of the parameter for the number of waves around the wheel.
pub(super) const ORDER: &str = "order";

impl Evidence<'_> {
    /// Hypotheses from the fits of one search.
    pub(super) fn of_round(&self, round: &Round) -> Vec<Hypothesis> {
        // What is left beside a named effect may be its model's error as well as something new.
        let first = self.search.rounds.first().is_some_and(|first| std::ptr::eq(first, round));
        let alone = first && !round.accepted;
        let is_new = if first || round.accepted { 1.0 } else { REMAINDER_PRIOR };
        let taken_back = round.fitted.first().filter(|_| round.remainder.is_some());
        let named = round.probabilities().named;
        let Nameless { accepted, like_names, names_failed, probability } = nameless(round, alone);
        let kept = if names_failed { FAILED_SHARE } else { is_new };
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
            let mut nameless = self.without_name(port, probability);
            nameless.accepted = accepted;
            if like_names {
                nameless.look_alikes = nearest(round);
            }
            if let Some(family) = self.family_like(round, port).filter(|_| nameless.accepted) {
                nameless.family = Some(family.name().to_owned());
            }
            if let Some(best) = taken_back.filter(|_| alone) {
                // What explains most of it is of its family, at its place.
                nameless.family = Some(best.candidate.kind.family.name().to_owned());
                let found = self.location_of_port(&port.place);
                nameless.location = self.location_of(&best.candidate);
                // The behaviour of an element elsewhere does not describe this place.
                if found.is_none() || !meet(found.as_ref(), nameless.location.as_ref()) {
                    nameless.behaviour = None;
                    nameless.parameters.clear();
                }
            }
            hypotheses.push(nameless);
        }
        if round.accepted {
            self.gather(&mut hypotheses);
        }
        hypotheses
    }

    /// Family of all kinds that explain most of what an unknown stiffness explains, at its location; `None` if
    /// there is no such kind, or if they are of several families.
    fn family_like(&self, round: &Round, port: &UnknownElement) -> Option<EffectFamily> {
        let location = self.location_of_port(&port.place)?;
        let comes_near = |fitted: &&Fitted| {
            let place = self.location_of(&fitted.candidate);
            let is_there = place.is_some_and(|place| meet(Some(&place), Some(&location)));
            is_there && fitted.log_evidence >= LIKE_SHARE * port.log_evidence
        };
        let mut families =
            round.fitted.iter().filter(comes_near).map(|it| it.candidate.kind.family);
        let first = families.next()?;
        families.all(|family| family == first).then_some(first)
    }

    /// Hypothesis of unknown physics.
    fn without_name(&self, port: &UnknownElement, probability: f64) -> Hypothesis {
        let behaviour = port.behaviour.as_ref();
        Hypothesis {
            physics: UNKNOWN.to_owned(),
            family: Some(port.place.family().name().to_owned()),
            family_probability: probability,
            probability,
            accepted: false,
            location: self.location_of_port(&port.place),
            port: Some(port.place.name().to_owned()),
            behaviour: behaviour.map(|behaviour| behaviour.element),
            parameters: behaviour.map_or_else(BTreeMap::new, Behaviour::named),
            assumed: BTreeMap::new(),
            look_alikes: Vec::new(),
            would_separate: port.place.would_separate().to_owned(),
            detectability: 0.0,
            log_evidence: port.log_evidence,
        }
    }

    /// Adds to the accepted hypothesis, which is the first, the probabilities of other fits of the same
    /// kind at its location.
    fn gather(&self, hypotheses: &mut Vec<Hypothesis>) {
        let mut accepted = hypotheses.remove(0);
        let others = std::mem::take(hypotheses).into_iter();
        let (same, different): (Vec<_>, Vec<_>) =
            others.partition(|other| self.is_same(&accepted, other));
        accepted.probability += same.iter().map(|other| other.probability).sum::<f64>();
        hypotheses.push(accepted);
        hypotheses.extend(different);
    }

    /// Whether two hypotheses are the same: the same kind at the same location, or next to an accepted one.
    pub(super) fn is_same(&self, known: &Hypothesis, other: &Hypothesis) -> bool {
        are_same(known, other, &self.prepared.forward.section)
    }

    fn hypothesis(&self, fitted: &Fitted, probability: f64, accepted: bool) -> Hypothesis {
        let Fitted { candidate, calibration, log_evidence, detectability, .. } = fitted;
        let first = calibration.values.len() - candidate.free.len();
        let [logarithms, deviations] = calibration.moments();
        let parameters = candidate.free.iter().enumerate().map(|(index, parameter)| {
            let mean = logarithms[first + index].exp();
            let deviation = deviations[first + index].hypot(parameter.form_deviation);
            (parameter.name.to_owned(), Estimate { mean, sd: mean * deviation })
        });
        // Of whole numbers each is a candidate of its own.
        let mut assumed = candidate.extension.parameters.clone();
        let order = assumed.remove(ORDER);
        let order = order.map(|mean| (ORDER.to_owned(), Estimate { mean, sd: 0.0 }));
        Hypothesis {
            physics: candidate.kind.physics.to_owned(),
            family: Some(candidate.kind.family.name().to_owned()),
            family_probability: probability,
            probability,
            accepted,
            location: self.location_of(candidate),
            port: None,
            behaviour: None,
            parameters: parameters.chain(order).collect(),
            assumed,
            look_alikes: names(candidate.kind),
            would_separate: candidate.kind.would_separate.to_owned(),
            detectability: *detectability,
            log_evidence: *log_evidence,
        }
    }
}

/// Whether two hypotheses are the same: the same kind at the same location, or a fit of it next to an
/// accepted one. A second accepted shape of the rail next to the first is the first one's model error;
/// neighbouring sleepers each have an effect of their own.
fn are_same(known: &Hypothesis, other: &Hypothesis, section: &Section) -> bool {
    let are_beside = match (&known.location, &other.location) {
        (Some(one), Some(another)) => section.are_beside(one.x_m, another.x_m),
        // Everywhere is beside all.
        _ => true,
    };
    let is_shape = Kind::from_name(&known.physics)
        .is_some_and(|kind| kind.group == LookAlikeGroup::RailDefect && known.location.is_some());
    let is_one = known.accepted && (!other.accepted || is_shape) && are_beside;
    known.physics == other.physics && (known.location == other.location || is_one)
}

/// What a search says about physics without a name.
struct Nameless {
    /// Whether it is accepted.
    accepted: bool,
    /// Whether it is accepted although names come near.
    like_names: bool,
    /// Whether these names failed: on speeds that were held out, or because they leave too much at their place.
    names_failed: bool,
    /// Its probability.
    probability: f64,
}

/// Physics without a name after a search; `alone` tells whether nothing was accepted so far.
fn nameless(round: &Round, alone: bool) -> Nameless {
    let Probabilities { named, group, unknown, nothing } = round.probabilities();
    if !alone {
        let probability = REMAINDER_PRIOR * unknown;
        return Nameless { accepted: false, like_names: false, names_failed: false, probability };
    }
    let is_there = round.unknown_is_predictive();
    let others = group.max(nothing);
    let is_port = is_there && round.port_p_value <= PORT_ALARM && unknown > others;
    let names_failed =
        !is_port && (nothing < NOTHING_LEFT || is_there && round.remainder.is_some());
    let chance = chance_max(round);
    let like_names = names_failed || !is_port && chance < LIKELY;
    let failed: f64 = named.iter().map(|probability| (1.0 - FAILED_SHARE) * probability).sum();
    let probability = match (names_failed, like_names) {
        (true, _) => unknown + failed,
        (false, true) => unknown + (nothing - chance).max(0.0),
        (false, false) => unknown,
    };
    let probability = if is_there { probability } else { probability.min(UNPREDICTED_MAX) };
    Nameless { accepted: is_port || like_names, like_names, names_failed, probability }
}

/// Largest probability that chance explains the residual of the first search: from its p-value, to the power of one
/// over the tempering of evidence. It is one if the residual does not predict speeds that were held out, if none was, or
/// if a candidate explains it.
pub(super) fn chance_max(round: &Round) -> f64 {
    let is_predicted = !round.unknown_gain.is_empty() && round.unknown_is_predictive();
    if round.accepted || !round.is_significant() || !is_predicted {
        return 1.0;
    }
    1.0 - probability_of(round.p_value.powf(1.0 / EVIDENCE_TEMPERING))
}

/// Kinds that are similar to unknown physics, although none of them predicts withheld speeds better.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Location;
    use crate::port_scan::PortPlace;
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn a_rare_residual_that_held_out_speeds_have_is_no_chance() {
        let round = |p_value: f64, unknown_gain: &[f64]| Round {
            p_value,
            unknown_gain: unknown_gain.to_vec(),
            ..Round::default()
        };
        let of = |p_value: f64, unknown_gain: &[f64]| chance_max(&round(p_value, unknown_gain));
        let everywhere = [6.0, 5.0, 4.0];
        assert!(of(1e-10, &everywhere) < 0.15);
        assert!(of(1e-3, &everywhere) > 0.8);
        assert_eq!(of(0.1, &everywhere), 1.0);
        assert_eq!(of(1e-10, &[9.0, -2.0, -1.0]), 1.0);
        assert_eq!(of(1e-10, &[]), 1.0);
        let explained = Round { accepted: true, ..round(1e-10, &everywhere) };
        assert_eq!(chance_max(&explained), 1.0);
    }

    #[test]
    fn something_that_held_out_speeds_do_not_have_is_not_sure() {
        let change = nalgebra::DVector::zeros(0);
        let port =
            UnknownElement { place: PortPlace::Wheel, log_evidence: 60.0, behaviour: None, change };
        let of = |unknown_gain: &[f64]| {
            let (port, unknown_gain) = (Some(port.clone()), unknown_gain.to_vec());
            let round =
                Round { p_value: 1e-9, port_p_value: 1e-9, port, unknown_gain, ..Round::default() };
            nameless(&round, true)
        };
        let (confirmed, refuted) = (of(&[6.0, 5.0, 4.0]), of(&[6.0, -2.0, -2.0]));
        assert!(confirmed.accepted && refuted.accepted);
        assert!(confirmed.probability > 0.99 && refuted.probability == UNPREDICTED_MAX);
    }

    #[test]
    fn two_joints_within_a_spacing_are_one_and_two_hanging_sleepers_are_not() {
        let section = Section::new(TrackDesign::v_track(), 24, 1.0);
        let accepted = |physics: &str, x_m: f64| {
            let location = Location { x_m: [x_m, x_m], sleepers: Vec::new() };
            Hypothesis::accepted(physics, Some(location))
        };
        let are = |physics: &str, one: f64, other: f64| {
            are_same(&accepted(physics, one), &accepted(physics, other), &section)
        };
        assert!(are("rail_joint", 2.4375, 2.375));
        assert!(!are("rail_joint", 2.4375, 2.0));
        assert!(are("hanging_sleeper", 2.375, 2.375));
        assert!(!are("hanging_sleeper", 2.5, 2.375));
        let fit = Hypothesis { accepted: false, ..accepted("hanging_sleeper", 2.375) };
        assert!(are_same(&accepted("hanging_sleeper", 2.5), &fit, &section));
        let bolts = Hypothesis { location: None, ..accepted("sleeper_bolt", 0.0) };
        assert!(!are_same(&bolts, &accepted("sleeper_bolt", 2.5), &section));
    }
}
