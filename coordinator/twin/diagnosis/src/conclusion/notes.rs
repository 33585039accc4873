//! Notes of a diagnosis.

use super::{Evidence, ONE_PASS_MAX, UNPREDICTED_MAX};
use crate::outcome::{Hypothesis, meet};
use crate::port_scan::PortPlace;
use tracktwin_inspection::{Finding, Inspection, SPEED_RATIO};
use tracktwin_number::chance;
use tracktwin_signal::recording::Recording;

/// Ratio of two speeds that separates effects of structure and geometry well.
const GOOD_SPEED_RATIO: f64 = 1.35;

impl Evidence<'_> {
    pub(super) fn notes(&self, hypotheses: &[Hypothesis]) -> Vec<String> {
        let mut notes: Vec<String> =
            self.inspection.pass_defects.iter().map(ToString::to_string).collect();
        notes.extend(self.inspection.notes_on_not_compared(self.recording));
        let uncovered = &self.prepared.uncovered;
        notes.extend(uncovered.note(self.recording));
        notes.extend((uncovered.sleepers > 0).then(|| self.lost()));
        if self.is_one_speed() {
            notes.push(one_speed(3.6 * self.prepared.forward.speeds_m_s[0]));
        }
        if !self.repeats() {
            notes.push(format!(
                "One pass per speed: the repeatability of passes is assumed, which limits every \
                     probability to {:.0} %. Add a second pass at each speed.",
                100.0 * ONE_PASS_MAX
            ));
        }
        notes.extend(lost(self.inspection, self.recording));
        if self.inspection.flat.is_some() {
            notes.push(
                "The flat strikes other sleepers in every pass, so that the passes differ: weak effects of the track \
                 are not visible beside it."
                    .to_owned(),
            );
        }
        notes.extend(self.speed_disagreement().or_else(|| self.remainder(hypotheses)));
        notes.extend(self.inspection.findings.iter().map(Finding::sentence));
        notes
    }

    /// Sentence on the sleepers that are not covered at every speed.
    pub(super) fn lost(&self) -> String {
        let last = self.prepared.forward.section.sleepers() - 1;
        self.prepared.uncovered.lost(&self.id(0), &self.id(last))
    }

    /// Note on the significant residual after the last search.
    fn remainder(&self, hypotheses: &[Hypothesis]) -> Option<String> {
        let round = self.search.rounds.last().filter(|round| round.is_significant())?;
        let place = round.port.as_ref().map_or(String::new(), |port| match &port.place {
            PortPlace::Wheel => " at the wheel".to_owned(),
            PortPlace::Seats(seats) if seats.len() <= 2 => format!(" near {}", self.id(seats[0])),
            PortPlace::Between([first, second]) => {
                format!(" between {} and {}", self.id(*first), self.id(*second))
            }
            PortPlace::Seats(_) => String::new(),
        });
        if let (Some(nats), Some(best)) = (round.remainder, round.fitted.first()) {
            return Some(format!(
                "{} explains most of the left-out physics{place}, but leaves {nats:.0} nats \
                     unexplained there: the cause is something similar.",
                best.candidate.kind.physics
            ));
        }
        if !round.unknown_is_predictive() {
            return Some(format!(
                "A significant residual remains{place} (probability by chance {}), but it does \
                     not predict a speed that is held out, which limits its probability to {:.0} %; a fixed \
                     cause would appear at every speed.",
                chance(round.p_value),
                100.0 * UNPREDICTED_MAX
            ));
        }
        let rest = if self.search.accepted.is_empty() { "Something" } else { "A remainder" };
        let left = format!(
            "{rest} is left{place} that chance does not explain (probability {}); it may be a \
                 model error, because no kind in the catalogue predicts the held-out speeds better.",
            chance(round.p_value)
        );
        let named =
            round.port.as_ref().is_some_and(|port| self.is_found_at(&port.place, hypotheses));
        (!round.accepted && !named).then_some(left)
    }

    /// Whether the inspection gave an accepted hypothesis at this port that the model did not fit.
    fn is_found_at(&self, place: &PortPlace, hypotheses: &[Hypothesis]) -> bool {
        let Some(place) = self.location_of_port(place) else { return false };
        let is_fitted = |physics: &str| {
            self.search.accepted.iter().any(|fitted| fitted.kind.physics == physics)
        };
        let is_there = |found: &Hypothesis| {
            found.location.is_some() && meet(found.location.as_ref(), Some(&place))
        };
        hypotheses.iter().any(|it| it.accepted && !is_fitted(&it.physics) && is_there(it))
    }
}

/// Note on contact loss.
pub(super) fn lost(inspection: &Inspection, recording: &Recording) -> Option<String> {
    let lost = inspection.loss_of_contact.as_ref()?;
    Some(format!(
        "loss_of_contact: {}: estimates near there are unreliable.",
        lost.sentence(recording.passes.len())
    ))
}

pub(super) fn one_speed(speed_km_h: f64) -> String {
    format!(
        "One speed only (speeds whose ratio is below {SPEED_RATIO} count as one): no test on a held-out speed was possible, \
             which limits the probability of a hypothesis that needs this test to {:.0} %. Add a pass at {:.0} \
             km/h or at {:.0} km/h.",
        100.0 * UNPREDICTED_MAX,
        speed_km_h / GOOD_SPEED_RATIO,
        speed_km_h * GOOD_SPEED_RATIO,
    )
}
