//! A recording prepared for diagnosis, or the reason why this is impossible.

mod sleepers;

use self::sleepers::{covered, overlapping};
use crate::bands::Bands;
use crate::forward::Forward;
use crate::null_model::NullModel;
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

/// Lowest band times the time in which the fastest pass rolls over a sleeper spacing: below, a window
/// holds hardly a wavelet. 80 Hz on V-Track at 13 km/h.
const LOWEST_PERIODS: f64 = 80.0 * 0.125 * 3.6 / 13.0;

/// Highest band in Hz, as far as the sample rate lets it: above, there is hardly any irregularity.
const HIGHEST_HZ: f64 = 5100.0;

/// Highest band as a part of the sample rate.
const SAMPLE_RATE_SHARE: f64 = 0.35;

/// Smallest number of bands for a diagnosis.
const BANDS_MIN: usize = 12;

/// Wave number times half the length of the contact patch above which powers are not compared.
const PATCH_WAVE_NUMBER: f64 = 4.0;

/// Least number of neighbouring sleepers that all passes cover.
const SLEEPERS_MIN: usize = 6;

/// Part of a spacing that a pass must cover beyond a sleeper's window, where low bands reach.
const MARGIN_SPANS: f64 = 0.6;

/// Greatest difference of two neighbouring sleepers' distance from the spacing, as a share of it: the
/// model's sleepers are evenly spaced.
const UNEVEN: f64 = 0.1;

/// Step, relative to the nominal speed, to which a true one is rounded: passes that nearly keep the nominal
/// one share their null simulations.
const SPEED_STEP: f64 = 5e-3;

/// Why a recording cannot be diagnosed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PreparationError {
    /// It states another track or vehicle than it would be compared with.
    #[error(
        "recording.json: {} {}, but the track it is compared with has {}; describe the recording's \
             track with --track", .0.quantity, .0.found(), .0.known()
    )]
    OtherTrack(OtherTrack),
    /// Its sleepers are not evenly spaced.
    #[error(
        "recording.json: sleepers: the distance between {} and {} is {distance_m:.3} m, the \
             model's {spacing_m} m; list every sleeper, or keep the evenly spaced stretch", .between[0], .between[1]
    )]
    Uneven {
        /// The two sleepers.
        between: [String; 2],
        /// Their distance in m.
        distance_m: f64,
        /// The model's in m.
        spacing_m: f64,
    },
    /// Levels without a unit.
    #[error("recording.json: nominal.gain_known: is false; the model needs accelerations in m/s2")]
    GainUnknown,
    /// No sleepers.
    #[error(
        "sleepers: their positions are unknown; add them to recording.json, or import with \
             --sleeper"
    )]
    NoSleepers,
    /// Too few sleepers.
    #[error(
        "passes: only {sleepers} neighbouring sleepers lie inside every pass with a margin of \
         {margin_m:.2} m; a diagnosis needs {SLEEPERS_MIN} or more: record a longer stretch"
    )]
    TooShort {
        /// Sleepers inside every pass.
        sleepers: usize,
        /// Margin in m.
        margin_m: f64,
    },
    /// Too low a sample rate.
    #[error(
        "sample_rate_Hz: {0} is too low: the comparison with the model is limited to \
             {high:.0} Hz", high = SAMPLE_RATE_SHARE * .0
    )]
    SampleRate(f64),
    /// Passes without a track in them.
    #[error("passes: unusable: {0}")]
    Unusable(PassDefect),
}

/// A recording in the terms of the forward model.
#[derive(Clone, Debug)]
pub struct PreparedRecording {
    /// Predicts it.
    pub forward: Forward,
    /// Its log powers in the order of [`Forward`], means over the passes of a speed.
    pub log_power: DVector<f64>,
    /// Variance of these means by what passes of one speed do not share, a value a speed and band.
    pub pass_variance: DVector<f64>,
    /// Number in the recording of the first sleeper compared.
    pub first_sleeper: usize,
    /// Numbers in the recording of the passes at each speed.
    pub pass_numbers: Vec<Vec<usize>>,
    /// Kinds of physics that may not be accepted.
    pub without: Vec<String>,
    /// Stretches in m in which the passes alone show a shape of the rail; empty until
    /// [`PreparedRecording::suggested`].
    pub detected_shapes_m: Vec<[f64; 2]>,
}

impl PreparationError {
    /// Whether the recording is of another track than it is compared with.
    pub const fn is_of_the_track(&self) -> bool {
        matches!(self, Self::OtherTrack(_) | Self::Uneven { .. })
    }
}

/// Whether a recording can be compared with a track of this design.
///
/// A recording whose sleepers are not known is compared with no track.
///
/// # Errors
/// [`PreparationError::OtherTrack`] and [`PreparationError::Uneven`].
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

/// What a recording has in bands, and the sleepers that can be compared.
struct Measured {
    bands: Bands,
    spectra: Spectra,
    sleepers: Range<usize>,
}

impl Measured {
    fn of(recording: &Recording, design: &TrackDesign) -> Result<Self, PreparationError> {
        check_track(recording, design)?;
        let fastest = recording.passes.iter().map(|pass| pass.speed_km_h).fold(0.0, f64::max);
        let lowest_hz = LOWEST_PERIODS * fastest / 3.6 / design.sleeper.spacing_m;
        let highest_hz = HIGHEST_HZ.min(SAMPLE_RATE_SHARE * recording.sample_rate_hz);
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
        let sleepers = covered(recording);
        if sleepers.len() < SLEEPERS_MIN {
            let margin_m = MARGIN_SPANS * recording.spacing_m;
            return Err(PreparationError::TooShort { sleepers: sleepers.len(), margin_m });
        }
        let spectra = Spectra::new(recording, &bands);
        Ok(Self { bands, spectra, sleepers })
    }

    /// Some of the sleepers.
    fn prepared(
        &self,
        recording: &Recording,
        track: &Track,
        sleepers: Range<usize>,
    ) -> PreparedRecording {
        let Self { bands, spectra, .. } = self;
        let first_x_m = recording.sleepers[sleepers.start].x_m;
        let section = Section::new(track.clone(), sleepers.len(), first_x_m);
        let reach_m = (0.5 + MARGIN_SPANS) * recording.spacing_m;
        let last_x_m = recording.sleepers[sleepers.end - 1].x_m;
        let stretch_m = [first_x_m - reach_m, last_x_m + reach_m];
        let speed = |speed: &SpeedSpectra| true_speed(recording, speed, stretch_m);
        let speeds: Vec<f64> = spectra.speeds.iter().map(speed).collect();
        let noise = spectra.speeds.iter().map(|speed| speed.noise_density).collect();
        let forward = Forward::new(section, bands.clone(), &speeds, noise);
        let log_power = log_power(&forward, spectra, sleepers.start);
        let pass_variance = pass_variance(&forward, spectra);
        let pass_numbers = spectra.speeds.iter().map(|speed| speed.passes.clone()).collect();
        let (first_sleeper, without, detected_shapes_m) = (sleepers.start, Vec::new(), Vec::new());
        PreparedRecording {
            forward,
            log_power,
            pass_variance,
            first_sleeper,
            pass_numbers,
            without,
            detected_shapes_m,
        }
    }
}

impl PreparedRecording {
    /// Prepares a recording.
    ///
    /// # Errors
    /// [`PreparationError`] states what is missing.
    pub fn new(recording: &Recording, track: &Track) -> Result<Self, PreparationError> {
        let measured = Measured::of(recording, &track.design)?;
        Ok(measured.prepared(recording, track, measured.sleepers.clone()))
    }

    /// The same in sections of at most `length` sleepers, each of which shares at least `overlap` with
    /// the next: a long track need not be fitted as a whole.
    ///
    /// # Errors
    /// As [`PreparedRecording::new`].
    pub fn sections(
        recording: &Recording,
        track: &Track,
        length: usize,
        overlap: usize,
    ) -> Result<Vec<Self>, PreparationError> {
        let measured = Measured::of(recording, &track.design)?;
        let ranges = overlapping(measured.sleepers.clone(), length, overlap);
        Ok(ranges.into_iter().map(|range| measured.prepared(recording, track, range)).collect())
    }

    /// Whether physics of a kind may be named.
    pub(crate) fn may_be_named(&self, kind: &Kind) -> bool {
        !self.without.iter().any(|other| other == kind.physics)
    }

    /// The same powers at other sleepers: those of each speed in a separate order,
    /// `[speed][sleeper]`, so that speeds have no place in common. A control: no local effect can
    /// be found.
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

    /// Log powers of further passes over the track of a recording that was prepared, in the same order, means
    /// over those of a speed; none where no pass covers a sleeper at a speed.
    pub(crate) fn log_power_of(
        &self,
        recording: &Recording,
        further: &Recording,
    ) -> Vec<Option<f64>> {
        let forward = &self.forward;
        let spectra = Spectra::new(further, &forward.bands);
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

    /// The log powers less the null model's offset: what the forward model predicts where nothing is
    /// left out.
    pub fn expected_log_power(&self, null: &NullModel) -> DVector<f64> {
        &self.log_power - null.offset_of(self.forward.section.sleepers)
    }

    /// Covariance of any one sleeper's log powers: the null model's, and what the passes do not share.
    pub fn covariance(&self, null: &NullModel) -> DMatrix<f64> {
        let covariance = null.covariance(self.forward.bands.count(), &self.pass_variance);
        self.of_compared(covariance)
    }

    /// A sleeper's covariance with an infinite variance of what is not compared: waves that are short
    /// against the contact patch, for its filter is the coarsest part of the model.
    pub(crate) fn of_compared(&self, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
        let forward = &self.forward;
        let design = &forward.section.track.design;
        if !design.contact_patch_filter {
            return covariance;
        }
        let half_length_m = ContactPatch::new(design).half_length_m;
        for row in 0..covariance.nrows() {
            let (_, speed, band) = forward.place(row);
            let wave_number = TAU * forward.bands.centres_hz()[band] / forward.speeds_m_s[speed];
            if wave_number * half_length_m > PATCH_WAVE_NUMBER {
                covariance.row_mut(row).fill(0.0);
                covariance.column_mut(row).fill(0.0);
                covariance[(row, row)] = f64::INFINITY;
            }
        }
        covariance
    }
}

/// Mean speed in km/h of a speed's passes over a stretch, by their positions; the nominal one where it is
/// hardly different.
fn true_speed(recording: &Recording, speed: &SpeedSpectra, [from_m, to_m]: [f64; 2]) -> f64 {
    let of_pass = |&pass: &usize| {
        let pass = &recording.passes[pass];
        let sample = |x_m: f64| pass.position_m.partition_point(|&position| position < x_m);
        let last = pass.position_m.len() - 1;
        let [from, to] = [from_m, to_m].map(|x_m| sample(x_m).min(last));
        let way_m = pass.position_m[to] - pass.position_m[from];
        3.6 * way_m * pass.signal.sample_rate_hz() / (to - from).max(1) as f64
    };
    let mean = speed.passes.iter().map(of_pass).sum::<f64>() / speed.passes.len() as f64;
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

/// A single pass at a speed scatters as passes of the other speeds do, or as a twentieth of the
/// surface's power.
fn pass_variance(forward: &Forward, spectra: &Spectra) -> DVector<f64> {
    let bands = forward.bands.count();
    let known: Vec<_> = spectra.speeds.iter().map(SpeedSpectra::pass_variance).collect();
    let typical = known.iter().flatten().next().cloned().unwrap_or(vec![0.01; bands]);
    let of_speed = |(variance, speed): (&Option<Vec<f64>>, &SpeedSpectra)| {
        let count = speed.passes.len() as f64;
        let variance = variance.as_ref().unwrap_or(&typical);
        variance.iter().map(|value| value / count).collect::<Vec<_>>()
    };
    DVector::from_vec(known.iter().zip(&spectra.speeds).flat_map(of_speed).collect())
}
