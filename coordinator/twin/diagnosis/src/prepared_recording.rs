//! A recording prepared for diagnosis, or the reason why this is impossible.

mod measured;
mod sleepers;

pub use self::sleepers::{Uncovered, check_length, short_passes};
pub(crate) use self::sleepers::{covers, overlapping};

use self::measured::Measured;
use crate::forward::Forward;
use crate::null_model::NullModel;
use crate::observation::leave_out;
use crate::spectra::{Spectra, SpeedSpectra, are_one_speed};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::ops::Range;
use tracktwin_inspection::chain::PassDefect;
use tracktwin_parameters::{Track, TrackDesign};
use tracktwin_signal::recording::{OtherTrack, Recording};
use tracktwin_track::extension::Kind;
use tracktwin_track::model::ContactPatch;

/// Highest band in Hz if the sample rate permits; the irregularity is negligible above it.
const HIGHEST_HZ: f64 = 5100.0;

/// Highest band as a share of the sample rate. Filters begin to act at 0.4 of it, 2.8 standard deviations of
/// the band's power above.
const SAMPLE_RATE_SHARE: f64 = 0.3;

/// Highest frequency in Hz that is compared in a recording of this sample rate in Hz.
pub fn highest_compared_hz(sample_rate_hz: f64) -> f64 {
    HIGHEST_HZ.min(SAMPLE_RATE_SHARE * sample_rate_hz)
}

/// Smallest number of neighbouring sleepers that must be covered at every speed.
const SLEEPERS_MIN: usize = 6;

/// Margin that a pass must cover beyond a sleeper's window, as a share of the spacing; low bands depend on
/// it.
const MARGIN_SPANS: f64 = 0.6;

/// Largest deviation of the distance of two neighbouring sleepers from the spacing, as a share of the
/// spacing; the sleepers of the model are evenly spaced.
const UNEVEN: f64 = 0.1;

/// Reason why a recording cannot be diagnosed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PreparationError {
    /// The recording states another track or vehicle than the track description.
    #[error(
        "recording.json: {} {}, but the track it is compared with has {}; describe the recording's \
             track with --track", .0.quantity, .0.found(), .0.known()
    )]
    OtherTrack(OtherTrack),
    /// The sleepers are not evenly spaced.
    #[error(
        "recording.json: sleepers: the distance between {} and {} is {distance_m:.3} m, the \
             model's {spacing_m} m; list every sleeper, or keep the evenly spaced stretch", .between[0], .between[1]
    )]
    Uneven {
        /// Ids of the two sleepers.
        between: [String; 2],
        /// Distance of the two sleepers in m.
        distance_m: f64,
        /// Sleeper spacing of the model in m.
        spacing_m: f64,
    },
    /// The sensor gain is unknown, and the levels have no unit.
    #[error(
        "recording.json: nominal.gain_known: is false; the model needs accelerations in m/s2: import again with \
         `--unit m/s2` or `--unit g`"
    )]
    GainUnknown,
    /// The positions of the sleepers are unknown.
    #[error(
        "sleepers: their positions are unknown; add them to recording.json, or import with \
             --sleeper"
    )]
    NoSleepers,
    /// Too few sleepers lie inside a pass at every speed.
    #[error(
        "passes: only {sleepers} neighbouring sleepers lie inside a pass at every speed with a margin of \
         {margin_m:.2} m; a diagnosis needs {SLEEPERS_MIN} or more: record a longer stretch"
    )]
    TooShort {
        /// Number of sleepers inside a pass at every speed.
        sleepers: usize,
        /// Required margin in m.
        margin_m: f64,
    },
    /// The sample rate, in Hz, is too low.
    #[error(
        "sample_rate_Hz: {0} is too low: the comparison with the model is limited to \
             {high:.0} Hz", high = SAMPLE_RATE_SHARE * .0
    )]
    SampleRate(f64),
    /// A pass defect makes the recording unusable.
    #[error("passes: unusable: {0}")]
    Unusable(PassDefect),
}

/// A recording in the form that the forward model predicts.
#[derive(Clone, Debug)]
pub struct PreparedRecording {
    /// The forward model.
    pub forward: Forward,
    /// Log powers in the order of [`Forward`], as means over the passes of a speed.
    pub log_power: DVector<f64>,
    /// Variance of these means from the variation between passes of one speed, one value per speed and
    /// band.
    pub pass_variance: DVector<f64>,
    /// Index in the recording of the first compared sleeper.
    pub first_sleeper: usize,
    /// Indices in the recording of the passes at each speed.
    pub pass_numbers: Vec<Vec<usize>>,
    /// Whether passes at one speed share sleepers.
    pub passes_repeat: bool,
    /// What is not compared because no pass at some speed covers it.
    pub uncovered: Uncovered,
    /// Names of kinds that may not be accepted.
    pub without: Vec<String>,
    /// Stretches in m in which an inspection of the passes found a shape of the rail; empty before
    /// [`PreparedRecording::suggested`].
    pub detected_shapes_m: Vec<[f64; 2]>,
}

impl PreparationError {
    /// Whether the error states that the recording belongs to another track.
    pub const fn is_of_the_track(&self) -> bool {
        matches!(self, Self::OtherTrack(_) | Self::Uneven { .. })
    }
}

/// Checks that a recording can be compared with a track of this design.
///
/// A recording without sleeper positions passes the check.
///
/// # Errors
/// [`PreparationError::OtherTrack`] or [`PreparationError::Uneven`].
pub fn check_track(recording: &Recording, design: &TrackDesign) -> Result<(), PreparationError> {
    if recording.sleepers.is_empty() {
        return Ok(());
    }
    recording.check_track(design).map_err(PreparationError::OtherTrack)?;
    let spacing_m = design.sleeper.spacing_m;
    let uneven = recording.sleepers.windows(2).find_map(|pair| {
        let distance_m = pair[1].x_m - pair[0].x_m;
        let is_even = (distance_m / spacing_m - 1.0).abs() <= UNEVEN;
        (!is_even).then(|| ([0, 1].map(|end| pair[end].id.clone()), distance_m))
    });
    match uneven {
        Some((between, distance_m)) => {
            Err(PreparationError::Uneven { between, distance_m, spacing_m })
        }
        None => Ok(()),
    }
}

impl PreparedRecording {
    /// Indices in the recording of the compared sleepers.
    pub fn sleepers(&self) -> Range<usize> {
        self.first_sleeper..self.first_sleeper + self.forward.section.sleepers()
    }

    /// Prepares a recording for comparison with `track`, without the passes with the indices `except`.
    ///
    /// # Errors
    /// [`PreparationError`] with the first requirement that the recording does not meet.
    pub fn new(
        recording: &Recording,
        track: &Track,
        except: &[usize],
    ) -> Result<Self, PreparationError> {
        let measured = Measured::of(recording, &track.design, except)?;
        Ok(measured.prepared(recording, track, measured.sleepers.clone()))
    }

    /// Prepares a recording in sections of at most `length` sleepers, so that a long track need not be
    /// fitted as a whole. Neighbouring sections share at least `overlap` sleepers.
    ///
    /// # Errors
    /// The errors of [`PreparedRecording::new`].
    pub fn sections(
        recording: &Recording,
        track: &Track,
        length: usize,
        overlap: usize,
    ) -> Result<Vec<Self>, PreparationError> {
        let measured = Measured::of(recording, &track.design, &[])?;
        let ranges = overlapping(measured.sleepers.clone(), length, overlap);
        Ok(ranges.into_iter().map(|range| measured.prepared(recording, track, range)).collect())
    }

    /// Whether a hypothesis of this kind may be accepted.
    pub(crate) fn may_be_named(&self, kind: &Kind) -> bool {
        !self.without.iter().any(|other| other == kind.physics)
    }

    /// Moves the log powers to other sleepers, with a separate order for each speed, `[speed][sleeper]`.
    /// Speeds then have no common location, and no local effect can be found. Serves as a control.
    pub fn shuffle(&mut self, orders: &[Vec<usize>]) {
        let (bands, per_sleeper) = (self.forward.bands.count(), self.forward.per_sleeper());
        let measured = self.log_power.clone();
        for (speed, order) in orders.iter().enumerate() {
            for (sleeper, &from) in order.iter().enumerate() {
                let row = |sleeper: usize| sleeper * per_sleeper + speed * bands;
                let moved = measured.rows(row(from), bands);
                self.log_power.rows_mut(row(sleeper), bands).copy_from(&moved);
            }
        }
    }

    /// Log powers of further passes over the same track, in the same order, as means over the passes of a
    /// speed; `None` where no pass covers a sleeper at a speed.
    pub(crate) fn log_power_of(
        &self,
        recording: &Recording,
        further: &Recording,
    ) -> Vec<Option<f64>> {
        let forward = &self.forward;
        let spectra = Spectra::new(further, &forward.bands, &[]);
        let mut all = vec![None; forward.count()];
        for (number, passes) in self.pass_numbers.iter().enumerate() {
            let speed_km_h = recording.passes[passes[0]].speed_km_h;
            let is_it = |speed: &&SpeedSpectra| are_one_speed(speed.speed_km_h, speed_km_h);
            let Some(speed) = spectra.speeds.iter().find(is_it) else { continue };
            for sleeper in 0..forward.section.sleepers() {
                let Some(mean) = speed.mean(self.first_sleeper + sleeper) else { continue };
                let row = sleeper * forward.per_sleeper() + number * forward.bands.count();
                for (value, mean) in all[row..].iter_mut().zip(mean) {
                    *value = Some(mean);
                }
            }
        }
        all
    }

    /// The log powers minus the offset of the null model: the values that the forward model predicts if
    /// nothing is left out.
    pub fn expected_log_power(&self, null: &NullModel) -> DVector<f64> {
        &self.log_power - null.offset_of(self.forward.section.sleepers())
    }

    /// Covariance of the log powers of one sleeper: that of the null model plus the variation between
    /// passes.
    pub fn covariance(&self, null: &NullModel) -> DMatrix<f64> {
        let covariance = null.covariance(self.forward.bands.count(), &self.pass_variance);
        self.of_compared(covariance)
    }

    /// A sleeper's covariance, with infinite variance for log powers that are not compared: those of waves
    /// that the contact patch averages out.
    pub(crate) fn of_compared(&self, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
        let forward = &self.forward;
        let design = &forward.section.track.design;
        if !design.contact_patch_filter {
            return covariance;
        }
        let patch = ContactPatch::new(design);
        for row in 0..covariance.nrows() {
            let (_, speed, band) = forward.place(row);
            let wave_number = TAU * forward.bands.centres_hz()[band] / forward.speeds_m_s[speed];
            if patch.averages_out(wave_number) {
                leave_out(&mut covariance, row);
            }
        }
        covariance
    }
}
