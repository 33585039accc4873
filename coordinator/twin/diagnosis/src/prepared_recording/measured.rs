//! Band powers of a recording, and what is prepared from them for a range of its sleepers.

use super::sleepers::{compared, too_short};
use super::{
    MARGIN_SPANS, PreparationError, PreparedRecording, SLEEPERS_MIN, Uncovered, check_track,
    highest_compared_hz,
};
use crate::bands::Bands;
use crate::forward::Forward;
use crate::section::Section;
use crate::spectra::{Spectra, SpeedSpectra};
use nalgebra::DVector;
use std::ops::Range;
use tracktwin_parameters::{Track, TrackDesign};
use tracktwin_signal::recording::Recording;

/// Lowest band times the time in which the fastest pass crosses a sleeper spacing. Below this frequency a
/// window is shorter than a wavelet. 80 Hz on V-Track at 13 km/h.
const LOWEST_PERIODS: f64 = 80.0 * 0.125 * 3.6 / 13.0;

/// Smallest number of bands for a diagnosis.
const BANDS_MIN: usize = 12;

/// Relative step to which a true speed is rounded from the nominal speed. Passes close to the nominal speed
/// thus share their null simulations.
const SPEED_STEP: f64 = 5e-3;

/// Band powers of a recording, and its comparable sleepers.
pub(super) struct Measured {
    bands: Bands,
    spectra: Spectra,
    /// The comparable sleepers.
    pub(super) sleepers: Range<usize>,
    /// Variance of one pass's log power at each speed; `None` where no passes share sleepers.
    pass_variances: Vec<Option<Vec<f64>>>,
    uncovered: Uncovered,
}

impl Measured {
    pub(super) fn of(
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
        let pass_variances = spectra.speeds.iter().map(SpeedSpectra::pass_variance).collect();
        Ok(Self { bands, spectra, sleepers, pass_variances, uncovered })
    }

    /// Prepares a range of the sleepers.
    pub(super) fn prepared(
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
        let pass_variance = self.variance_of_mean(sleepers.clone());
        let passes_repeat = self.pass_variances.iter().any(Option::is_some);
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

    /// Variance of the mean over the passes that cover a sleeper, per speed and band, in the mean over some sleepers.
    /// Where no passes at a speed share sleepers, the variance of another speed is taken, or 0.01 if there is none.
    fn variance_of_mean(&self, sleepers: Range<usize>) -> DVector<f64> {
        let known = &self.pass_variances;
        let typical =
            known.iter().flatten().next().cloned().unwrap_or(vec![0.01; self.bands.count()]);
        let of_speed = |(variance, speed): (&Option<Vec<f64>>, &SpeedSpectra)| {
            let share = |sleeper: usize| 1.0 / speed.covering(sleeper).count().max(1) as f64;
            let share = sleepers.clone().map(share).sum::<f64>() / sleepers.len() as f64;
            let variance = variance.as_ref().unwrap_or(&typical);
            variance.iter().map(|value| share * value).collect::<Vec<_>>()
        };
        DVector::from_vec(known.iter().zip(&self.spectra.speeds).flat_map(of_speed).collect())
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
    for sleeper in 0..forward.section.sleepers() {
        for (number, speed) in spectra.speeds.iter().enumerate() {
            let Some(mean) = speed.mean(first + sleeper) else { continue };
            let row = sleeper * forward.per_sleeper() + number * forward.bands.count();
            all.rows_mut(row, mean.len()).copy_from_slice(&mean);
        }
    }
    all
}
