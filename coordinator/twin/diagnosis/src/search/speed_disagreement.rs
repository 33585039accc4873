//! Test whether all speeds belong to the same track.

use super::chance::squares;
use super::limits::FALSE_ALARM;
use super::probability::EVIDENCE_TEMPERING;
use super::round::Setting;
use super::{Round, SearchOutcome};
use crate::calibration::{CalibrationError, Problem};
use nalgebra::DVector;
use std::ops::Range;
use tracktwin_inspection::median;
use tracktwin_number::probability;

/// Mean correlation of the ballast along the track, between speeds fitted alone, from which on all speeds
/// have the same track. Sleepers in another order have none.
const SAME_TRACK: f64 = 0.5;

impl SearchOutcome {
    /// Compares the result with a model that has a separate track for each speed, and rejects all
    /// candidates if this model is significantly better: all speeds must pass a fixed cause.
    ///
    /// Separate tracks also absorb errors of the model that depend on the speed. So they do not count if the
    /// speeds, each for itself, find the same ballast along the track.
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
        let ballast = forward.unknowns.ballast();
        let found: Vec<&DVector<f64>> = each.iter().map(|(alone, _)| &alone.values).collect();
        if mean_correlation(&found, &ballast) >= SAME_TRACK {
            return Ok(());
        }
        let alone: f64 = each.iter().map(|(alone, deviation)| alone.log_evidence - deviation).sum();
        // What is left without a name explains as well.
        let left = self.rounds.last().filter(|last| !last.accepted).map_or(0.0, Round::most);
        let together = self.last.log_evidence - self.observation.log_deviation() + left;
        let sleepers = forward.section.sleepers();
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

/// Mean correlation, over all pairs, of the values with these indices.
fn mean_correlation(all: &[&DVector<f64>], indices: &Range<usize>) -> f64 {
    let deviations = all.iter().map(|values| {
        let own = values.rows(indices.start, indices.len());
        own.add_scalar(-own.mean())
    });
    let deviations: Vec<DVector<f64>> = deviations.collect();
    let pairs = (0..all.len()).flat_map(|first| (0..first).map(move |second| [first, second]));
    let correlations = pairs.map(|pair| {
        let [a, b] = pair.map(|index| &deviations[index]);
        a.dot(b) / (a.norm() * b.norm()).max(f64::MIN_POSITIVE)
    });
    let correlations: Vec<f64> = correlations.collect();
    correlations.iter().sum::<f64>() / correlations.len() as f64
}

impl Round {
    /// The greatest log evidence in nats of all candidates and ports, at least zero.
    fn most(&self) -> f64 {
        let named = self.fitted.first().map(|fitted| fitted.log_evidence);
        let unknown = self.port.as_ref().map(|port| port.log_evidence);
        named.into_iter().chain(unknown).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tracks_that_differ_by_a_factor_correlate_and_shuffled_ones_do_not() {
        let track = DVector::from_fn(20, |index, _| (index as f64 * 2.4).sin());
        let stiffer = track.add_scalar(0.7);
        let shuffled = DVector::from_fn(20, |index, _| track[7 * index % 20]);
        let mean = |all: &[&DVector<f64>]| mean_correlation(all, &(2..18));
        assert!((mean(&[&track, &stiffer]) - 1.0).abs() < 1e-12);
        assert!(mean(&[&track, &shuffled]).abs() < SAME_TRACK);
        assert!(mean(&[&track, &stiffer, &shuffled]) < SAME_TRACK);
    }
}
