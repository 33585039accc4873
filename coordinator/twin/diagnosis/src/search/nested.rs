//! Test of a candidate on held-out speeds, nested: the candidate that predicts a speed is selected without this speed.

use super::detected_shape::{is_detected, is_displaced};
use super::round::{Setting, is_predicted};
use super::{Fitted, SearchOutcome, log_densities};
use crate::calibration::CalibrationError;

/// Share of the best candidate's log evidence from which another candidate may predict a held-out speed;
/// `NESTED_MAX` is the largest number of these candidates.
const NESTED_SHARE: f64 = 0.5;
const NESTED_MAX: usize = 3;

impl SearchOutcome {
    /// Tests the best candidate on held-out speeds and accepts it if it predicts them better. Returns the
    /// gain in log density at each speed, in nats.
    ///
    /// The candidate that predicts a speed is selected without this speed, among those with nearly the best
    /// evidence. The gain therefore tests the choice of kind and location as well as the values. The location of a
    /// shape that the passes alone show at every speed needs no choice.
    pub(super) fn accept_if_predictive(
        &mut self,
        best: &Fitted,
        fitted: &[Fitted],
        setting: &Setting<'_>,
        densities: &mut Vec<Vec<f64>>,
    ) -> Result<Vec<f64>, CalibrationError> {
        let with = |fitted: &Fitted| {
            [&self.accepted[..], std::slice::from_ref(&fitted.candidate)].concat()
        };
        let section = &setting.prepared.forward.section;
        let shapes_m = &setting.prepared.detected_shapes_m;
        let is_displaced = |it: &Fitted| is_displaced(&it.candidate, section, shapes_m);
        let is_shown = is_detected(&best.candidate, section, shapes_m) && !is_displaced(best);
        let comes_near = |other: &&Fitted| {
            other.log_evidence >= NESTED_SHARE * best.log_evidence
                && !(is_shown && is_displaced(other))
        };
        let scores = fitted
            .iter()
            .filter(comes_near)
            .take(NESTED_MAX)
            .map(|fitted| setting.held_out(&with(fitted), &fitted.calibration.values))
            .collect::<Result<Vec<_>, _>>()?;
        let without = &densities[self.accepted.len()];
        let chosen = |speed: usize| {
            let at_speed = scores.iter().map(|scores| scores[speed]);
            at_speed.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
        };
        let gains: Vec<f64> = without
            .iter()
            .enumerate()
            .filter_map(|(speed, without)| Some(chosen(speed)?.log_density - without))
            .collect();
        if is_predicted(&gains) {
            self.accepted = with(best);
            self.last = best.calibration.clone();
            // The best comes first.
            densities.push(log_densities(&scores[0]));
        }
        Ok(gains)
    }
}
