//! A recording prepared for diagnosis, or the reason why this is impossible.

mod sleepers;

pub use self::sleepers::{Uncovered, check_length, short_passes};
pub(crate) use self::sleepers::{covers, overlapping};

use self::sleepers::{compared, too_short};
use crate::bands::Bands;
use crate::forward::Forward;
use crate::null_model::NullModel;
use crate::observation::leave_out;
use crate::section::Section;
use crate::spectra::{Spectra, SpeedSpectra, are_one_speed};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::ops::Range;
use tracktwin_inspection::chain::PassDefect;
use tracktwin_parameters::{Track, TrackDesign};
use tracktwin_signal::recording::{OtherTrack, Recording};
use tracktwin_track::extension::Kind;
use tracktwin_track::model::ContactPatch;

/// Lowest band times the time in which the fastest pass crosses a sleeper spacing. Below this frequency a
/// window is shorter than a wavelet. 80 Hz on V-Track at 13 km/h.
const LOWEST_PERIODS: f64 = 80.0 * 0.125 * 3.6 / 13.0;

/// Highest band in Hz if the sample rate permits; the irregularity is negligible above it.
const HIGHEST_HZ: f64 = 5100.0;

/// Highest band as a share of the sample rate. Filters begin to act at 0.4 of it, 2.8 standard deviations of
/// the band's power above.
const SAMPLE_RATE_SHARE: f64 = 0.3;

/// Highest frequency in Hz that is compared in a recording of this sample rate in Hz.
pub fn highest_compared_hz(sample_rate_hz: f64) -> f64 {
    HIGHEST_HZ.min(SAMPLE_RATE_SHARE * sample_rate_hz)
}

/// Smallest number of bands for a diagnosis.
const BANDS_MIN: usize = 12;

/// Smallest number of neighbouring sleepers that all passes must cover.
const SLEEPERS_MIN: usize = 6;

/// Margin that a pass must cover beyond a sleeper's window, as a share of the spacing; low bands depend on
/// it.
const MARGIN_SPANS: f64 = 0.6;

/// Largest deviation of the distance of two neighbouring sleepers from the spacing, as a share of the
/// spacing; the sleepers of the model are evenly spaced.
const UNEVEN: f64 = 0.1;

/// Relative step to which a true speed is rounded from the nominal speed. Passes close to the nominal speed
/// thus share their null simulations.
const SPEED_STEP: f64 = 5e-3;

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

/// Band powers of a recording, and its comparable sleepers.
struct Measured {
    bands: Bands,
    spectra: Spectra,
    sleepers: Range<usize>,
    uncovered: Uncovered,
}

impl Measured {
    fn of(
        recording: &Recording,
        design: &TrackDesign,
        except: &[usize],
    ) -> Result<Self, PreparationError> {
        check_track(recording, design)?;
        let (sleepers, uncovered) = compared(recording, except);
        let except = &[except, &uncovered.short_passes].concat();
        let passes = recording.passes.iter().enumerate().filter(|(it, _)| !except.contains(it));
        let fastest = passes.map(|(_, pass)| pass.speed_km_h).fold(0.0, f64::max);
        let lowest_hz = LOWEST_PERIODS * fastest / 3.6 / design.sleeper.spacing_m;
        let highest_hz = highest_compared_hz(recording.sample_rate_hz);
        let bands = Bands::new(lowest_hz, highest_hz.max(lowest_hz));
        if bands.count() < BANDS_MIN {
            return Err(PreparationError::SampleRate(recording.sample_rate_hz));
        }
        if recording.sleepers.is_empty() {
            return Err(PreparationError::NoSleepers);
        }
        if !recording.gain_known() {
            return Err(PreparationError::GainUnknown);
        }
        if sleepers.len() < SLEEPERS_MIN {
            return Err(too_short(recording, sleepers.len()));
        }
        let spectra = Spectra::new(recording, &bands, except);
        Ok(Self { bands, spectra, sleepers, uncovered })
    }

    /// Prepares a range of the sleepers.
    fn prepared(
        &self,
        recording: &Recording,
        track: &Track,
        sleepers: Range<usize>,
    ) -> PreparedRecording {
        let Self { bands, spectra, .. } = self;
        let x_m = recording.sleepers[sleepers.clone()].iter().map(|sleeper| sleeper.x_m).collect();
        let section = Section::at(track.clone(), x_m);
        let reach_m = (0.5 + MARGIN_SPANS) * recording.spacing_m;
        let stretch_m = [section.x_m(0) - reach_m, section.x_m(sleepers.len() - 1) + reach_m];
        let speed = |speed: &SpeedSpectra| true_speed(recording, speed, stretch_m);
        let speeds: Vec<f64> = spectra.speeds.iter().map(speed).collect();
        let noise = spectra.speeds.iter().map(|speed| speed.noise_density).collect();
        let forward = Forward::new(section, bands.clone(), &speeds, noise);
        let log_power = log_power(&forward, spectra, sleepers.start);
        let pass_variance = pass_variance(&forward, spectra, sleepers.clone());
        let passes_repeat = spectra.speeds.iter().any(|speed| speed.pass_variance().is_some());
        let pass_numbers = spectra.speeds.iter().map(|speed| speed.passes.clone()).collect();
        let (first_sleeper, without, detected_shapes_m) = (sleepers.start, Vec::new(), Vec::new());
        PreparedRecording {
            forward,
            log_power,
            pass_variance,
            first_sleeper,
            pass_numbers,
            passes_repeat,
            uncovered: self.uncovered.clone(),
            without,
            detected_shapes_m,
        }
    }
}

impl PreparedRecording {
    /// Indices in the recording of the compared sleepers.
    pub fn sleepers(&self) -> Range<usize> {
        self.first_sleeper..self.first_sleeper + self.forward.section.sleepers
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
            for sleeper in 0..forward.section.sleepers {
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
        &self.log_power - null.offset_of(self.forward.section.sleepers)
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

/// Mean speed in km/h of the passes of a speed over a stretch, from their positions, rounded in steps of
/// [`SPEED_STEP`] from the nominal speed.
fn true_speed(recording: &Recording, speed: &SpeedSpectra, [from_m, to_m]: [f64; 2]) -> f64 {
    let of_pass = |&pass: &usize| -> Option<f64> {
        let pass = &recording.passes[pass];
        let sample = |x_m: f64| pass.position_m.partition_point(|&position| position < x_m);
        let last = pass.position_m.len() - 1;
        let [from, to] = [from_m, to_m].map(|x_m| sample(x_m).min(last));
        let way_m = pass.position_m[to] - pass.position_m[from];
        let speed_km_h = 3.6 * way_m * pass.signal.sample_rate_hz() / (to - from).max(1) as f64;
        // A pass may lie elsewhere.
        (way_m > 0.0).then_some(speed_km_h)
    };
    let all: Vec<f64> = speed.passes.iter().filter_map(of_pass).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let steps = ((mean / speed.speed_km_h - 1.0) / SPEED_STEP).round();
    speed.speed_km_h * (1.0 + SPEED_STEP * steps)
}

fn log_power(forward: &Forward, spectra: &Spectra, first: usize) -> DVector<f64> {
    let mut all = DVector::zeros(forward.count());
    for sleeper in 0..forward.section.sleepers {
        for (number, speed) in spectra.speeds.iter().enumerate() {
            let Some(mean) = speed.mean(first + sleeper) else { continue };
            let row = sleeper * forward.per_sleeper() + number * forward.bands.count();
            all.rows_mut(row, mean.len()).copy_from_slice(&mean);
        }
    }
    all
}

/// Variance of the mean over the passes that cover a sleeper, per speed and band, in the mean over some sleepers. Where no
/// passes at a speed share sleepers, the variance of another speed is taken, or 0.01 if there is none.
fn pass_variance(forward: &Forward, spectra: &Spectra, sleepers: Range<usize>) -> DVector<f64> {
    let bands = forward.bands.count();
    let known: Vec<_> = spectra.speeds.iter().map(SpeedSpectra::pass_variance).collect();
    let typical = known.iter().flatten().next().cloned().unwrap_or(vec![0.01; bands]);
    let of_speed = |(variance, speed): (&Option<Vec<f64>>, &SpeedSpectra)| {
        let share = |sleeper: usize| 1.0 / speed.covering(sleeper).count().max(1) as f64;
        let share = sleepers.clone().map(share).sum::<f64>() / sleepers.len() as f64;
        let variance = variance.as_ref().unwrap_or(&typical);
        variance.iter().map(|value| share * value).collect::<Vec<_>>()
    };
    DVector::from_vec(known.iter().zip(&spectra.speeds).flat_map(of_speed).collect())
}
