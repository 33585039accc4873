//! Patches of the residual that no kind explains, and the corrugation that they suggest.

use super::chance::{excess, tail_probability, whitened};
use super::limits::FALSE_ALARM;
use super::round::{Setting, unknown_is_predicted};
use super::threshold::first_evidence;
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::observation::Observation;
use crate::patch_scan::{Fixed, Patch, PatchScan};
use nalgebra::{DMatrix, DVector};
use std::mem::discriminant;
use std::ops::Range;
use tracktwin_number::floored;

/// Smallest log power ratio of a patch that is visible in a plot of the residual: 1.5 dB.
const VISIBLE: f64 = 0.35;

/// Standard deviation of the model's error in nats at each sleeper and band, in the search for patches: 1.3 dB.
/// Without this error a few combinations of bands, which the simulations hardly vary, would decide.
const CELL_ERROR: f64 = 0.3;

/// A patch, and the probability of such a patch if nothing is left out.
type Visible = (Patch, f64);

impl Setting<'_> {
    /// As [`Setting::observe`], with an error of the model at each sleeper and band.
    fn observe_with_cell_error(
        &self,
        held_out: impl Fn(usize) -> bool,
    ) -> Result<Observation, CalibrationError> {
        let variance = DVector::from_element(self.covariance.nrows(), CELL_ERROR.powi(2));
        let covariance = &self.covariance + DMatrix::from_diagonal(&variance);
        Observation::new(self.log_power.clone(), &covariance, held_out)
            .ok_or(CalibrationError::NotFinite)
    }

    /// The patch with the largest deviation; `None` if it would not be visible in a plot. Observation and
    /// calibration have the error of [`Setting::observe_with_cell_error`].
    fn visible(
        &self,
        scan: &PatchScan,
        observation: &Observation,
        current: &Calibration,
        is_one: impl Fn(Fixed, &Range<usize>) -> bool + Sync,
    ) -> Option<Visible> {
        let patch = scan.best(&current.residual, &current.gradient, &is_one)?;
        let nulls = whitened(&self.nulls, observation, current);
        let excess = excess(current, &nulls, self.prepared.forward.section.sleepers());
        let p_value = tail_probability(
            &nulls,
            patch.deviations / excess.sqrt(),
            |residual, projected_gradient| {
                scan.best(residual, projected_gradient, &is_one).map(|patch| patch.deviations)
            },
        );
        (patch.height.abs() >= VISIBLE).then_some((patch, floored(p_value)))
    }

    /// The visible patch in the residual of the final model; `None` if there is none, or if it is significant but
    /// does not predict held-out speeds.
    pub(super) fn last_patch(
        &self,
        problem: &Problem<'_>,
        last: &Calibration,
    ) -> Result<Option<Visible>, CalibrationError> {
        let observation = &self.observe_with_cell_error(|_| false)?;
        let problem = &Problem { observation, ..*problem };
        let last = &problem.at(&last.values)?;
        let scan = PatchScan::new(problem, last);
        let Some((patch, p_value)) = self.visible(&scan, observation, last, |_, _| true) else {
            return Ok(None);
        };
        let is_kept = p_value > FALSE_ALARM
            || unknown_is_predicted(&self.patch_gains(problem, last, &scan, &patch)?);
        Ok(is_kept.then_some((patch, p_value)))
    }

    /// Corrugation candidate from the patch of waves in the baseline's residual, over the sleepers that fit best.
    /// `None` if there is no such patch, or if it has less than the evidence of a first name against chance: all
    /// speeds pass the same surface, so that a held-out speed does not tell a random part of it from a defect.
    pub(super) fn waves(
        &self,
        problem: &Problem<'_>,
        baseline: &Calibration,
    ) -> Result<Option<Candidate>, CalibrationError> {
        let observation = &self.observe_with_cell_error(|_| false)?;
        let problem = &Problem { observation, ..*problem };
        let rough = &problem.at(&baseline.values)?;
        let scan = PatchScan::new(problem, rough);
        let is_wave = |fixed, _: &_| matches!(fixed, Fixed::Wavelength(_));
        let found = self.visible(&scan, observation, rough, is_wave);
        let chance_max = (-first_evidence()).exp();
        let Some((patch, _)) = found.filter(|(_, p_value)| *p_value <= chance_max) else {
            return Ok(None);
        };
        let scan = PatchScan::of_every_length(problem, rough, patch.fixed);
        let patch = scan.best(&rough.residual, &rough.gradient, |_, _| true).unwrap_or(patch);
        let forward = &self.prepared.forward;
        let level = baseline.values[forward.unknowns.level().start].exp();
        let waves = patch.as_waves(&forward.section, level);
        Ok(waves.filter(|waves| self.prepared.may_be_named(waves.kind)))
    }

    /// Gain in nats on each speed, held out in turn, of the patch that the other speeds select. It is one of
    /// wavelength or of frequency as `found` is, because a single other speed does not tell them apart. Empty for a
    /// single speed. `all` are the patches of all speeds.
    fn patch_gains(
        &self,
        problem: &Problem<'_>,
        current: &Calibration,
        all: &PatchScan,
        found: &Patch,
    ) -> Result<Vec<f64>, CalibrationError> {
        let is_alike = |fixed, _: &_| discriminant(&fixed) == discriminant(&found.fixed);
        self.each_speed_held_out(|speed| {
            let is_held_out = |row| row / self.prepared.forward.bands.count() == speed;
            let observation = &self.observe_with_cell_error(is_held_out)?;
            let without = Problem { observation, ..*problem };
            let others = without.at(&current.values)?;
            let scan = PatchScan::new(&without, &others);
            let best = scan.best(&others.residual, &others.gradient, is_alike);
            let gain = best.and_then(|best| {
                let is_best = |fixed, sleepers: &Range<usize>| {
                    fixed == best.fixed && *sleepers == best.sleepers
                };
                let with = all.best(&current.residual, &current.gradient, is_best)?;
                Some(with.gain_over(&best))
            });
            Ok(gain.unwrap_or(f64::NEG_INFINITY))
        })
    }
}
