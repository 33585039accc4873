//! Names that leave too much unexplained at their own place are taken back.

use super::extent::Extent;
use super::limits::FALSE_ALARM;
use super::threshold::is_local_shape;
use super::{Round, SearchOutcome};
use crate::candidate::Candidate;
use crate::port_scan::{PortPlace, PortScan, UnknownElement};
use crate::section::Section;

/// Share of the evidence for a name from which something unknown that is left at its place speaks
/// against it: one that is right leaves hardly any.
const LEFT: f64 = 0.1;

/// The same for what acts by laws that the wheel's load decides about: it is modelled with errors,
/// which grow with the effect.
const LEFT_UNDER_LOAD: f64 = 1.0 / 3.0;

impl SearchOutcome {
    /// Takes the last names back as long as what is left at their place speaks against them.
    pub(super) fn retract_names(&mut self, section: &Section) {
        let Some(last) = self.rounds.last().filter(|last| !last.accepted) else { return };
        let Some(port) =
            last.unknown_residual.as_ref().filter(|_| last.port_p_value <= FALSE_ALARM)
        else {
            return;
        };
        let place = Extent::of_port(&port.place, section);
        let mut left = port.log_evidence;
        while let Some(number) = self.accepted.len().checked_sub(1) {
            let threshold = retraction_threshold(&self.explained(section, place));
            if threshold.is_none_or(|threshold| left < threshold) {
                return;
            }
            let round = &mut self.rounds[number];
            round.accepted = false;
            round.remainder = Some(left);
            left += round.fitted[0].log_evidence;
            self.accepted.pop();
            self.rounds.truncate(number + 1);
            self.last = match number.checked_sub(1) {
                Some(before) => self.rounds[before].fitted[0].calibration.clone(),
                None => self.baseline.clone(),
            };
        }
    }

    /// What something unknown at the last name's place explains beside all names.
    pub(super) fn unknown_residual(
        &self,
        ports: &PortScan,
        section: &Section,
    ) -> Option<UnknownElement> {
        let there = Extent::of(self.accepted.last()?, section);
        let is_there = |place: &PortPlace| Extent::of_port(place, section).is_about(there);
        ports.best_where(&self.last.residual, &self.last.gradient, is_there)
    }

    /// What is accepted, last first, with its evidence, as long as it is at a place.
    fn explained(&self, section: &Section, place: Extent) -> Vec<(&Candidate, f64)> {
        let evidence = |(known, round): (_, &Round)| (known, round.fitted[0].log_evidence);
        let rounds = &self.rounds[..self.accepted.len()];
        let accepted = self.accepted.iter().zip(rounds).map(evidence).rev();
        let is_there = |known: &Candidate| Extent::of(known, section).is_about(place);
        accepted.take_while(|(known, _)| is_there(known)).collect()
    }
}

/// Least evidence in nats for something unknown that speaks against the first of these names, which
/// are at its place: what others of its kind explain beside it counts as well. None speaks against a
/// shape, whose phase to the surface the model does not know.
fn retraction_threshold(explained: &[(&Candidate, f64)]) -> Option<f64> {
    let &(last, _) = explained.first()?;
    let is_kind = |(known, _): &&(&Candidate, f64)| known.kind.physics == last.kind.physics;
    let evidence: f64 = explained.iter().take_while(is_kind).map(|(_, evidence)| evidence).sum();
    let share = if last.is_under_load() { LEFT_UNDER_LOAD } else { LEFT };
    (!is_local_shape(last)).then_some(share * evidence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::testing::section_with_candidates;

    #[test]
    fn what_is_left_speaks_against_a_name_but_not_against_a_shape_or_two_of_a_kind() {
        let (_, all) = section_with_candidates();
        let of = |physics: &str| {
            let is_it = |candidate: &&Candidate| candidate.kind.physics == physics;
            all.iter().find(is_it).unwrap()
        };
        let (gap, pad, dip) = (of("hanging_sleeper"), of("missing_railpad"), of("rail_joint"));
        assert_eq!(retraction_threshold(&[(gap, 300.0)]), Some(100.0));
        assert_eq!(retraction_threshold(&[(gap, 60.0), (gap, 300.0), (pad, 900.0)]), Some(120.0));
        assert_eq!(retraction_threshold(&[(pad, 300.0)]), Some(30.0));
        assert_eq!(retraction_threshold(&[(of("sensor_mount_resonance"), 900.0)]), Some(90.0));
        assert_eq!(retraction_threshold(&[(dip, 300.0)]), None);
        assert_eq!(retraction_threshold(&[]), None);
    }
}
