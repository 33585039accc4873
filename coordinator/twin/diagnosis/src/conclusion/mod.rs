//! Conclusion: the diagnosis that follows from a search.

mod alone;
mod finding;
mod fit;
mod nameless;
mod notes;
mod place;
mod round;
mod speed_disagreement;
mod support_changes;

pub use self::alone::passes_alone;
pub(crate) use self::support_changes::further;
use crate::calibration::CalibrationError;
use crate::outcome::{Diagnosis, FORMAT, Hypothesis, Location, UNKNOWN, Verdict, meet};
use crate::port_scan::PortPlace;
use crate::prepared_recording::PreparedRecording;
use crate::search::SearchOutcome;
use crate::sentence::sentence;
use std::collections::BTreeMap;
use tracktwin_inspection::Inspection;
use tracktwin_inspection::chain::PassDefect;
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::{
    EffectFamily, FLEXIBLE_AXLE_BOX, Kind, LookAlikeGroup, SENSOR_MOUNT_RESONANCE, SUBGRADE_LAYER,
};

/// Largest probability if no held-out speed could be tested: at a single speed, structure and geometry have
/// the same effect.
const ONE_SPEED_MAX: f64 = 0.5;

/// Largest probability if no pass repeats another: the variation between passes is then an assumption.
const ONE_PASS_MAX: f64 = 0.9;

/// Largest probability of any hypothesis: the model itself may be wrong.
const MODEL_MAX: f64 = 0.97;

/// Largest probability of unknown physics on a track without measured error rates: of two unknown
/// hypotheses on recordings of a railway line, one had the correct location (docs/diagnosis-examples.md).
const UNMEASURED_UNKNOWN_MAX: f64 = 0.5;

/// Share of a group's probability that belongs to the kind which the fit names or, without a fit, the inspection.
const NAMED_SHARE: f64 = 0.65;

/// Probability from which physics is accepted beside a fault of the measuring chain.
const LIKELY: f64 = 0.5;

/// Factor on the probability of a hypothesis that does not predict withheld speeds better, that lacks a detected shape,
/// or that has no more evidence than errors of a line's model reach.
const FAILED_SHARE: f64 = 0.1;

/// Hypotheses with a smaller probability are not reported.
const PROBABILITY_MIN: f64 = 0.001;

/// Input of a conclusion.
pub struct Evidence<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// The prepared recording.
    pub prepared: &'a PreparedRecording,
    /// Inspection of the passes without a track model.
    pub inspection: &'a Inspection,
    /// Result of the search with the track model.
    pub search: &'a SearchOutcome,
}

impl Evidence<'_> {
    /// Draws the conclusion.
    ///
    /// # Errors
    /// [`CalibrationError`] if no model exists for the values of a calibrated track.
    pub fn conclude(&self) -> Result<Diagnosis, CalibrationError> {
        let mut hypotheses = self.hypotheses();
        self.add_patch(&mut hypotheses);
        let (most, unknown_max) = (self.probability_max(), self.unknown_max());
        for hypothesis in &mut hypotheses {
            let most = if hypothesis.physics == UNKNOWN { unknown_max } else { most };
            hypothesis.probability = hypothesis.probability.min(most);
        }
        // Before a probability is divided among names.
        let nothing_left_out = self.nothing(&hypotheses).min(most);
        let fitted: Vec<&str> =
            self.search.accepted.iter().map(|candidate| candidate.kind.physics).collect();
        add_siblings(&mut hypotheses, &fitted);
        add_wheel_mode(&mut hypotheses);
        add_resonator(&mut hypotheses, unknown_max);
        add_families(&mut hypotheses, most);
        hypotheses.sort_by(|a, b| {
            b.probability.total_cmp(&a.probability).then(b.accepted.cmp(&a.accepted))
        });
        let verdict = verdict(&hypotheses);
        if verdict == Verdict::Consistent {
            hypotheses.clear();
        }
        let levels = self.levels()?;
        let fit = self.fit(&hypotheses);
        let bias_removed = self.bias_removed(&hypotheses);
        let count = self.prepared.forward.section.sleepers;
        let sleepers: Vec<String> = (0..count).map(|sleeper| self.id(sleeper)).collect();
        let said = sentence(verdict, &hypotheses, nothing_left_out, &sleepers, &fit, &bias_removed);
        let support_changes = self.support_changes(verdict);
        let loss_of_contact = self.inspection.loss_of_contact.clone();
        let sentence = said + &further(&support_changes, loss_of_contact.as_ref());
        let notes = self.notes(&hypotheses);
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
            confirmation: None,
            support_changes,
            loss_of_contact,
            notes,
            sections: Vec::new(),
        })
    }

    /// Largest probability that the recording permits.
    fn probability_max(&self) -> f64 {
        if self.speeds() == 1 {
            ONE_SPEED_MAX
        } else if self.repeats() {
            MODEL_MAX
        } else {
            ONE_PASS_MAX
        }
    }

    /// Probability that nothing is left out, given these hypotheses.
    fn nothing(&self, hypotheses: &[Hypothesis]) -> f64 {
        let first = self.search.rounds.first().map_or(1.0, |round| round.probabilities().nothing);
        let accepted = hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
        if accepted.clone().next().is_none() {
            // Something without a name is no more certain than unknown physics.
            return first.max(1.0 - self.unknown_max());
        }
        first * accepted.map(|hypothesis| 1.0 - hypothesis.probability).product::<f64>()
    }

    /// Largest probability of unknown physics.
    fn unknown_max(&self) -> f64 {
        let most = self.probability_max();
        if self.prepared.forward.section.is_v_track() {
            most
        } else {
            most.min(UNMEASURED_UNKNOWN_MAX)
        }
    }

    fn speeds(&self) -> usize {
        self.prepared.forward.speeds_m_s.len()
    }

    /// Whether some pass repeats another at its speed.
    fn repeats(&self) -> bool {
        self.prepared.pass_numbers.iter().any(|passes| passes.len() > 1)
    }

    fn hypotheses(&self) -> Vec<Hypothesis> {
        let mut all: Vec<Hypothesis> = Vec::new();
        let rounds = self.search.rounds.iter().filter(|round| round.is_significant());
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
        self.add_speed_disagreement(&mut all);
        for finding in &self.inspection.findings {
            self.add_finding(finding, &mut all);
        }
        for finding in &self.inspection.nameless {
            self.add_nameless(finding, &mut all);
        }
        // What a faulty chain makes of the recording is not unknown physics, nor physics that is less likely
        // than not, and what is left of a saturated one no physics at all.
        let is_chain = |known: &Hypothesis| {
            Kind::from_name(&known.physics).is_some_and(|kind| kind.measuring_chain)
        };
        if all.iter().any(|known| known.accepted && is_chain(known)) {
            let saturated = |defect: &PassDefect| matches!(defect, PassDefect::Saturated { .. });
            let is_saturated = self.inspection.pass_defects.iter().any(saturated);
            let made_by_chain = |known: &&mut Hypothesis| {
                // An alternative to the fault itself keeps its probability.
                let is_unlikely = known.accepted && known.probability < LIKELY;
                !is_chain(known) && (known.physics == UNKNOWN || is_saturated || is_unlikely)
            };
            for known in all.iter_mut().filter(made_by_chain) {
                known.accepted = false;
                known.probability *= FAILED_SHARE;
            }
        }
        all.retain(|hypothesis| hypothesis.accepted || hypothesis.probability >= PROBABILITY_MIN);
        all
    }
}

/// Divides the probability of a rail shape that only the inspection detected among the kinds of its group.
/// Without a fit the group is more certain than the kind: a rail joint may have a reduced bending
/// stiffness, or only a dip.
fn add_siblings(hypotheses: &mut Vec<Hypothesis>, fitted: &[&str]) {
    let mut siblings = Vec::new();
    for index in 0..hypotheses.len() {
        let hypothesis = &hypotheses[index];
        let kind = Kind::from_name(&hypothesis.physics);
        let Some(kind) = kind.filter(|it| it.group == LookAlikeGroup::RailDefect) else { continue };
        let is_sibling = |other: &Hypothesis| {
            other.physics != hypothesis.physics
                && Kind::from_name(&other.physics).is_some_and(|it| it.group == kind.group)
                && meet(other.location.as_ref(), hypothesis.location.as_ref())
        };
        let is_fitted = fitted.contains(&kind.physics);
        if !hypothesis.accepted || is_fitted || hypotheses.iter().any(is_sibling) {
            continue;
        }
        let others = kind.look_alikes.iter().filter_map(|name| Kind::from_name(name));
        let others: Vec<_> = others.filter(|other| other.group == kind.group).collect();
        let whole = hypothesis.probability;
        for other in &others {
            siblings.push(Hypothesis {
                physics: other.physics.to_owned(),
                family: Some(other.family.name().to_owned()),
                probability: (1.0 - NAMED_SHARE) * whole / others.len() as f64,
                accepted: false,
                parameters: BTreeMap::new(),
                assumed: BTreeMap::new(),
                look_alikes: names(other),
                would_separate: other.would_separate.to_owned(),
                ..hypothesis.clone()
            });
        }
        if !others.is_empty() {
            hypotheses[index].probability *= NAMED_SHARE;
        }
    }
    hypotheses.extend(siblings);
}

/// Divides the probability of an accepted flexible axle box, or resonance of the sensor, between it and a mode of the
/// wheel's disc. All are a mass on a spring between the contact and the sensor, and the catalogue has no mode of the
/// disc. A name that already shares its probability with the other one keeps it.
fn add_wheel_mode(hypotheses: &mut Vec<Hypothesis>) {
    let is_alike = |it: &&mut Hypothesis| {
        let kinds = [FLEXIBLE_AXLE_BOX.physics, SENSOR_MOUNT_RESONANCE.physics];
        it.accepted && it.probability > NAMED_SHARE && kinds.contains(&it.physics.as_str())
    };
    let Some(named) = hypotheses.iter_mut().find(is_alike) else { return };
    let mode = Hypothesis {
        family: Some(EffectFamily::UnknownWheel.name().to_owned()),
        accepted: false,
        ..unknown_like(named, &PortPlace::Wheel, 1.0 - NAMED_SHARE)
    };
    named.probability *= NAMED_SHARE;
    hypotheses.push(mode);
}

/// Divides the probability of an accepted layer under a single sleeper between it and a mass on a spring elsewhere
/// in the track, which no kind describes: an absorber on the rail has the same signature. A subgrade does not change
/// from one sleeper to the next, so that the unknown element comes first; the layer stays in the model.
fn add_resonator(hypotheses: &mut Vec<Hypothesis>, unknown_max: f64) {
    let is_single = |it: &Hypothesis| {
        let sleepers = it.location.as_ref().map_or(0, |place| place.sleepers.len());
        it.accepted && it.physics == SUBGRADE_LAYER.physics && sleepers == 1
    };
    let mut added = Vec::new();
    for layer in hypotheses.iter_mut().filter(|it| is_single(it)) {
        let mut unknown = unknown_like(layer, &PortPlace::Seats(Vec::new()), NAMED_SHARE);
        unknown.probability = unknown.probability.min(unknown_max);
        added.push(unknown);
        layer.probability *= 1.0 - NAMED_SHARE;
    }
    hypotheses.extend(added);
}

/// Unknown physics that acts as this hypothesis does, with a share of its probability.
fn unknown_like(named: &Hypothesis, port: &PortPlace, share: f64) -> Hypothesis {
    Hypothesis {
        physics: UNKNOWN.to_owned(),
        probability: share * named.probability,
        port: Some(port.name().to_owned()),
        parameters: BTreeMap::new(),
        assumed: BTreeMap::new(),
        look_alikes: vec![named.physics.clone()],
        ..named.clone()
    }
}

/// Sets the probability of each hypothesis's family at its location; its members exclude each other there.
fn add_families(hypotheses: &mut [Hypothesis], most: f64) {
    let all: Vec<_> = hypotheses
        .iter()
        .map(|it| (it.family.clone(), it.location.clone(), it.probability))
        .collect();
    for hypothesis in hypotheses {
        let is_member = |(family, location, _): &&(Option<String>, Option<Location>, f64)| {
            family.is_some()
                && *family == hypothesis.family
                && meet(location.as_ref(), hypothesis.location.as_ref())
        };
        let members: f64 = all.iter().filter(is_member).map(|(.., share)| share).sum();
        hypothesis.family_probability = members.max(hypothesis.probability).min(most);
    }
}

/// The verdict that follows from the most probable accepted hypothesis.
pub(crate) fn verdict(hypotheses: &[Hypothesis]) -> Verdict {
    let Some(first) = hypotheses.iter().find(|hypothesis| hypothesis.accepted) else {
        return Verdict::Consistent;
    };
    match Kind::from_name(&first.physics) {
        None => Verdict::UnknownPhysics,
        Some(kind) if kind.measuring_chain => Verdict::MeasurementChain,
        Some(_) => Verdict::LeftOutPhysics,
    }
}

fn names(kind: &Kind) -> Vec<String> {
    kind.look_alikes.iter().map(|&name| name.to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(sleepers: &[&str]) -> Hypothesis {
        let sleepers = sleepers.iter().map(|id| (*id).to_owned()).collect();
        let place = Location { x_m: [1.0, 1.0], sleepers };
        Hypothesis { probability: 0.96, ..Hypothesis::accepted("subgrade_layer", Some(place)) }
    }

    #[test]
    fn a_resonance_of_the_sensor_may_be_a_mode_of_the_wheel() {
        let named = |probability| Hypothesis {
            probability,
            ..Hypothesis::accepted("sensor_mount_resonance", None)
        };
        let mut sure = vec![named(0.97)];
        add_wheel_mode(&mut sure);
        let [sensor, mode] = &sure[..] else { panic!("{sure:?}") };
        assert!((sensor.probability - 0.6305).abs() < 1e-9 && sensor.accepted);
        assert!((mode.probability - 0.3395).abs() < 1e-9 && !mode.accepted);
        assert_eq!((mode.physics.as_str(), mode.port.as_deref()), (UNKNOWN, Some("wheel")));
        // An axle box has its share already.
        let mut shared = vec![named(0.57)];
        add_wheel_mode(&mut shared);
        assert_eq!(shared.len(), 1);
    }

    #[test]
    fn a_layer_under_one_sleeper_is_first_of_all_a_mass_on_a_spring() {
        let mut one = vec![layer(&["SN8"])];
        add_resonator(&mut one, 0.97);
        let [layer_again, unknown] = &one[..] else { panic!("{one:?}") };
        assert!((unknown.probability - 0.624).abs() < 1e-9 && unknown.accepted);
        assert!((layer_again.probability - 0.336).abs() < 1e-9 && layer_again.accepted);
        assert_eq!(unknown.physics, UNKNOWN);
        assert_eq!(unknown.family, layer_again.family);
        let mut run = vec![layer(&["SN8", "SN9"])];
        add_resonator(&mut run, 0.97);
        assert_eq!(run.len(), 1);
    }
}
