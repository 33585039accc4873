//! Test whether all speeds belong to the same track.

use super::chance::squares;
use super::limits::FALSE_ALARM;
use super::probability::EVIDENCE_TEMPERING;
use super::round::Setting;
use super::{Round, SearchOutcome};
use crate::calibration::{CalibrationError, Problem};
use tracktwin_inspection::median;
use tracktwin_number::probability;

impl SearchOutcome {
    /// Compares the result with a model that has a separate track for each speed, and rejects all
    /// candidates if this model is significantly better: all speeds must pass a fixed cause.
    pub(super) fn compare_speeds(&mut self, setting: &Setting<'_>) -> Result<(), CalibrationError> {
        let forward = &setting.prepared.forward;
        if forward.speeds_m_s.len() < 2 {
            return Ok(());
        }
        let start = &self.baseline.values;
        let each = setting.at_each_speed(|observation| {
            let alone =
                Problem { forward, observation, candidates: &[] }.calibrate(start.clone())?;
            let deviation = observation.log_deviation() - observation.held_out_log_deviation();
            Ok((alone, deviation))
        })?;
        let alone: f64 = each.iter().map(|(alone, deviation)| alone.log_evidence - deviation).sum();
        // What is left without a name explains as well.
        let left = self.rounds.last().filter(|last| !last.accepted).map_or(0.0, Round::most);
        let together = self.last.log_evidence - self.observation.log_deviation() + left;
        let sleepers = forward.section.sleepers;
        let mut gains = squares(&self.last.residual, sleepers);
        for (alone, _) in &each {
            let left = squares(&alone.residual, sleepers);
            gains.iter_mut().zip(left).for_each(|(gain, left)| *gain -= left);
        }
        // What is wrong at one place is wrong with the track there, not with where the passes were.
        let all: f64 = gains.iter().sum();
        self.speed_disagreement = alone - together + 0.5 * (sleepers as f64 * median(gains) - all);
        if self.speeds_disagree() {
            self.accepted.clear();
            self.last = self.baseline.clone();
            self.rounds.truncate(1);
            self.rounds.iter_mut().for_each(|round| round.accepted = false);
        }
        Ok(())
    }

    /// Probability of such a difference if all speeds belong to the same track.
    pub fn speed_disagreement_p_value(&self) -> f64 {
        probability(-self.speed_disagreement.max(0.0) / EVIDENCE_TEMPERING)
    }

    /// Whether the speeds significantly belong to different tracks.
    pub fn speeds_disagree(&self) -> bool {
        self.speed_disagreement_p_value() <= FALSE_ALARM
    }
}

impl Round {
    /// The greatest log evidence in nats of all candidates and ports, at least zero.
    fn most(&self) -> f64 {
        let named = self.fitted.first().map(|fitted| fitted.log_evidence);
        let unknown = self.port.as_ref().map(|port| port.log_evidence);
        named.into_iter().chain(unknown).fold(0.0, f64::max)
    }
}
