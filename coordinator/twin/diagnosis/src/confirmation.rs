//! Confirmation in the time domain, with passes that were not fitted.
//!
//! The search predicts mean powers in the frequency domain. The confirmation simulates the accepted
//! extensions in the time domain at their locations, with contact and force laws, and compares the result
//! with withheld passes. The prediction uses the fitted levels and spectrum. The difference between
//! simulated and expected powers at the mean level is added to it (docs/diagnosis.md, section 9).

use crate::calibration::{Calibration, Problem};
use crate::candidate::Candidate;
use crate::null_model::{NullError, NullModel, simulated, with_one_wheel};
use crate::observation::Observation;
use crate::outcome::{Confirmation, ConfirmedSpeed};
use crate::prepared_recording::PreparedRecording;
use crate::search::{Extent, HELD_OUT_MIN, SearchOutcome};
use crate::spectra::DECIBEL;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::{Class, InstanceError};
use tracktwin_track::model::ModelError;

/// Number of random surfaces that are simulated without and with the accepted extensions.
const CONFIRMING_SURFACES: u64 = 8;

/// Random seed of the first surface.
const SEED: u64 = 0x636f_6e66;

/// Errors of a confirmation.
#[derive(Debug, thiserror::Error)]
pub enum ConfirmationError {
    /// An accepted candidate cannot be built as an extension.
    #[error(transparent)]
    Extension(#[from] InstanceError),
    /// The fitted track cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A simulation fails.
    #[error(transparent)]
    Simulation(#[from] NullError),
    /// The covariance of the log powers is not positive definite.
    #[error("the null simulations give no covariance of the log powers")]
    Covariance,
}

/// Data of a confirmation: a search on some passes of a recording, with its null model.
pub struct Confirming<'a> {
    /// The recording without the withheld passes.
    pub recording: &'a Recording,
    /// The prepared recording, from `recording`.
    pub prepared: &'a PreparedRecording,
    /// The result of the search.
    pub search: &'a SearchOutcome,
    /// The null model of the search.
    pub null: &'a NullModel,
}

impl Confirming<'_> {
    /// Compares the accepted extensions with withheld passes. `None` if nothing was accepted, or if an
    /// accepted extension has no fixed effect in a simulated pass: faults of the measuring chain, and
    /// physics that depends on the unknown angle of the wheel.
    ///
    /// # Errors
    /// [`ConfirmationError`].
    pub fn with(
        &self,
        withheld: &Recording,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Option<Confirmation>, ConfirmationError> {
        let accepted = &self.search.accepted;
        let is_shown = |candidate: &Candidate| {
            let kind = candidate.kind;
            !kind.measuring_chain && !kind.classes.contains(&Class::WheelAngle)
        };
        if accepted.is_empty() || !accepted.iter().all(is_shown) {
            return Ok(None);
        }
        let forward = &self.prepared.forward;
        let measured = self.prepared.log_power_of(self.recording, withheld);
        let half = |first: f64| move |share: f64| progress(first + 0.5 * share);
        let before = self.predicted(&[], &self.search.baseline, &half(0.0))?;
        let after = self.predicted(accepted, &self.search.last, &half(0.5))?;
        // What a pass does not cover counts for nothing.
        let difference = |predicted: &DVector<f64>| {
            let of_row = |row: usize| measured[row].map_or(0.0, |value| value - predicted[row]);
            DVector::from_fn(predicted.len(), |row, _| of_row(row))
        };
        let [before, after] = [difference(&before), difference(&after)];
        let covariance = self.covariance_of_a_pass();
        let observation = Observation::new(DVector::zeros(before.len()), &covariance, |_| false)
            .ok_or(ConfirmationError::Covariance)?;
        let (sleepers, per_sleeper) = (self.sleepers(), forward.per_sleeper());
        let rows = sleepers.start * per_sleeper..sleepers.end * per_sleeper;
        let square =
            |difference| observation.whiten(difference).rows(rows.start, rows.len()).norm_squared();
        let gain_nats = 0.5 * (square(&before) - square(&after));
        let at_speed = |speed: usize| {
            let is_seen = |row: &usize| forward.place(*row).1 == speed && measured[*row].is_some();
            rows.clone().filter(is_seen).collect::<Vec<_>>()
        };
        let in_db = |difference: &DVector<f64>, rows: &[usize]| {
            let squares: f64 = rows.iter().map(|&row| difference[row].powi(2)).sum();
            DECIBEL * (squares / rows.len() as f64).sqrt()
        };
        let of_speed = |speed: usize| {
            let rows = at_speed(speed);
            (!rows.is_empty()).then(|| ConfirmedSpeed {
                speed_km_h: 3.6 * forward.speeds_m_s[speed],
                before_db: in_db(&before, &rows),
                after_db: in_db(&after, &rows),
            })
        };
        Ok(Some(Confirmation {
            passes: withheld.passes.iter().map(|pass| pass.file.clone()).collect(),
            speeds: (0..forward.speeds_m_s.len()).filter_map(of_speed).collect(),
            sleepers: sleepers.len(),
            gain_nats,
            is_confirmed: gain_nats >= HELD_OUT_MIN,
        }))
    }

    /// Log powers of a pass in the time domain, with the fitted levels and spectrum.
    fn predicted(
        &self,
        candidates: &[Candidate],
        calibration: &Calibration,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<DVector<f64>, ConfirmationError> {
        let (forward, observation) = (&self.prepared.forward, &self.search.observation);
        let values = &calibration.values;
        let extensions = Problem { forward, observation, candidates }.extensions(values)?;
        let expected = forward.log_power(values, &extensions)?;
        let quiet = with_one_wheel(forward);
        let extensions = Problem { forward: &quiet, observation, candidates }.extensions(values)?;
        let surfaces = [CONFIRMING_SURFACES, SEED];
        let share = |done: f64| progress(done / CONFIRMING_SURFACES as f64);
        let simulated = simulated(&quiet, values, &extensions, surfaces, &share)?;
        let count = simulated.len() as f64;
        Ok(simulated.into_iter().fold(expected, |sum, difference| sum + difference / count))
    }

    /// Covariance of a sleeper's log powers in a single pass.
    fn covariance_of_a_pass(&self) -> DMatrix<f64> {
        let (prepared, bands) = (self.prepared, self.prepared.forward.bands.count());
        let passes = |row: usize| prepared.pass_numbers[row / bands].len() as f64;
        let variance = DVector::from_fn(prepared.pass_variance.len(), |row, _| {
            prepared.pass_variance[row] * passes(row)
        });
        prepared.of_compared(self.null.covariance(bands, &variance))
    }

    /// Range of the sleepers that the accepted extensions affect.
    fn sleepers(&self) -> Range<usize> {
        let forward = &self.prepared.forward;
        let of = |candidate: &Candidate| {
            if candidate.is_everywhere() {
                return 0..forward.section.sleepers;
            }
            let extent = Extent::of(candidate, &forward.section).with_reach();
            let [from, to] = extent.spacings().map(|spacings| spacings.max(0.0));
            from.floor() as usize..(to.ceil() as usize + 1).min(forward.section.sleepers)
        };
        let all: Vec<Range<usize>> = self.search.accepted.iter().map(of).collect();
        let start = all.iter().map(|range| range.start).min().unwrap_or(0);
        start..all.iter().map(|range| range.end).max().unwrap_or(start)
    }
}
