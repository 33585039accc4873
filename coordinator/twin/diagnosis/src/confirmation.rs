//! Confirmation in the time domain, with passes that were not fitted.
//!
//! The search predicts mean powers in the frequency domain. The confirmation simulates the accepted
//! extensions in the time domain at their locations, with contact and force laws, and compares the result
//! with withheld passes. The prediction uses the fitted levels and spectrum. The difference between
//! simulated and expected powers at the mean level is added to it (docs/diagnosis.md, section 9).

use crate::calibration::{Calibration, Problem};
use crate::candidate::Candidate;
use crate::null_model::{NullError, NullModel, simulated, with_one_wheel};
use crate::observation::{Observation, leave_out};
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
        // No pass covers the others; `gain_nats` leaves them out.
        let difference = |predicted: &DVector<f64>| {
            let of_row = |row: usize| measured[row].map_or(0.0, |value| value - predicted[row]);
            DVector::from_fn(predicted.len(), |row, _| of_row(row))
        };
        let [before, after] = [difference(&before), difference(&after)];
        let (sleepers, per_sleeper) = (self.sleepers(), forward.per_sleeper());
        let rows = sleepers.start * per_sleeper..sleepers.end * per_sleeper;
        let is_seen = |row: usize| measured[row].is_some();
        let covariance = self.covariance_of_a_pass();
        let gain_nats = gain_nats(&covariance, sleepers.clone(), [&before, &after], is_seen)
            .ok_or(ConfirmationError::Covariance)?;
        let at_speed = |speed: usize| {
            rows.clone().filter(|&row| forward.place(row).1 == speed && is_seen(row)).collect()
        };
        let in_db = |difference: &DVector<f64>, rows: &[usize]| {
            let squares: f64 = rows.iter().map(|&row| difference[row].powi(2)).sum();
            DECIBEL * (squares / rows.len() as f64).sqrt()
        };
        let of_speed = |speed: usize| {
            let rows: Vec<usize> = at_speed(speed);
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
                return 0..forward.section.sleepers();
            }
            let extent = Extent::of(candidate, &forward.section).with_reach();
            let [from, to] = extent.spacings().map(|spacings| spacings.max(0.0));
            from.floor() as usize..(to.ceil() as usize + 1).min(forward.section.sleepers())
        };
        let all: Vec<Range<usize>> = self.search.accepted.iter().map(of).collect();
        let start = all.iter().map(|range| range.start).min().unwrap_or(0);
        start..all.iter().map(|range| range.end).max().unwrap_or(start)
    }
}

/// Gain in log density of the log powers of some sleepers that the withheld passes cover (`is_seen`), from two vectors
/// of measured minus predicted log powers. `covariance` is that of a sleeper. `None` if it is not positive definite.
fn gain_nats(
    covariance: &DMatrix<f64>,
    mut sleepers: Range<usize>,
    [before, after]: [&DVector<f64>; 2],
    is_seen: impl Fn(usize) -> bool,
) -> Option<f64> {
    let count = covariance.nrows();
    let of_sleeper = |sleeper: usize| {
        let first = sleeper * count;
        let mut covariance = covariance.clone();
        (0..count)
            .filter(|row| !is_seen(first + row))
            .for_each(|row| leave_out(&mut covariance, row));
        let observation = Observation::new(DVector::zeros(count), &covariance, |_| false)?;
        let square = |difference: &DVector<f64>| {
            observation.whiten(&difference.rows(first, count).into_owned()).norm_squared()
        };
        Some(0.5 * (square(before) - square(after)))
    };
    sleepers.try_fold(0.0, |sum, sleeper| Some(sum + of_sleeper(sleeper)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_withheld_pass_covers_counts_for_nothing() {
        let covariance = DMatrix::from_row_slice(2, 2, &[0.04, 0.036, 0.036, 0.04]);
        let before = DVector::from_vec(vec![0.0, 0.4, 0.4, 0.4, 9.0, 9.0]);
        let after = DVector::zeros(6);
        let gain = |is_seen: [bool; 6]| {
            gain_nats(&covariance, 0..3, [&before, &after], |row| is_seen[row]).unwrap()
        };
        // Two standard deviations of one value, without the correlation with a value that is missing.
        assert!((gain([false, true, false, false, false, false]) - 2.0).abs() < 1e-9);
        // Of two equal values, correlated by 0.9, the second adds little.
        let both = gain([false, false, true, true, false, false]);
        assert!((both - 2.0 * 2.0 / 1.9).abs() < 1e-9, "{both}");
    }
}
