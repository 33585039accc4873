//! Rejection of accepted candidates that leave a large residual at their own location.

use super::extent::Extent;
use super::limits::FALSE_ALARM;
use super::{Round, SearchOutcome};
use crate::candidate::Candidate;
use crate::port_scan::{PortPlace, PortScan, UnknownElement};
use crate::section::Section;
use tracktwin_track::extension::Class;

/// Share of a candidate's evidence from which unknown physics in the residual at its location leads to
/// rejection; a correct candidate leaves hardly any residual.
const LEFT: f64 = 0.1;

/// The corresponding share for candidates with force laws that depend on the wheel load: their model has
/// errors, which grow with the effect.
const LEFT_UNDER_LOAD: f64 = 1.0 / 3.0;

/// Smallest evidence in nats for unknown physics in a residual that leads to rejection: on recordings with
/// nothing left out, 12 nats were found (docs/decisions/0015-what-was-tried-in-the-diagnosis.md).
const LEFT_MIN: f64 = 16.0;

impl SearchOutcome {
    /// Rejects the last accepted candidates while the residual at their location is too large.
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

    /// Unknown physics in the residual at the location of the last accepted candidate.
    pub(super) fn unknown_residual(
        &self,
        ports: &PortScan,
        section: &Section,
    ) -> Option<UnknownElement> {
        let there = Extent::of(self.accepted.last()?, section);
        let is_there = |place: &PortPlace| Extent::of_port(place, section).is_about(there);
        ports.best_where(&self.last.residual, &self.last.gradient, is_there)
    }

    /// Accepted candidates at a location with their log evidence, the last one first.
    fn explained(&self, section: &Section, place: Extent) -> Vec<(&Candidate, f64)> {
        let evidence = |(known, round): (_, &Round)| (known, round.fitted[0].log_evidence);
        let rounds = &self.rounds[..self.accepted.len()];
        let accepted = self.accepted.iter().zip(rounds).map(evidence).rev();
        let is_there = |known: &Candidate| Extent::of(known, section).is_about(place);
        accepted.take_while(|(known, _)| is_there(known)).collect()
    }
}

/// Smallest evidence in nats for unknown physics that leads to the rejection of the first of these
/// candidates. The evidence of others of its kind at the same location is included. `None` for a shape of rail
/// or wheel, because the model does not include its phase relative to the surface.
fn retraction_threshold(explained: &[(&Candidate, f64)]) -> Option<f64> {
    let &(last, _) = explained.first()?;
    let is_kind = |(known, _): &&(&Candidate, f64)| known.kind.physics == last.kind.physics;
    let evidence: f64 = explained.iter().take_while(is_kind).map(|(_, evidence)| evidence).sum();
    let share = if last.is_under_load() { LEFT_UNDER_LOAD } else { LEFT };
    let is_shape = last.kind.classes.contains(&Class::Wavelength);
    (!is_shape).then_some((share * evidence).max(LEFT_MIN))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::testing::section_with_candidates;
    use tracktwin_track::extension::Kind;

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
        let kind = Kind::from_name("wheel_out_of_round").unwrap();
        assert_eq!(retraction_threshold(&[(&Candidate { kind, ..dip.clone() }, 300.0)]), None);
        assert_eq!(retraction_threshold(&[]), None);
    }
}
