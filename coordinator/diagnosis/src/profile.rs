//! The shape that an extension gives rail or wheel, as the wheel feels it in bands.

use crate::bands::gain;
use rustfft::{Fft, FftPlanner, num_complex::Complex64};
use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;
use tracktwin_track::model::TrackModel;

/// Distance of two samples in m: the shortest waves compared have more than two of them.
const STEP_M: f64 = 1e-4;

/// Places at which a band's power is taken, per wave of its centre.
const PLACES_PER_WAVE: f64 = 5.0;

/// How far a band reaches, in its standard deviations.
const REACH: f64 = 4.0;

/// Track that is transformed on either side of the shape, in m: a band's wavelet fades within it.
const MARGIN_M: f64 = 0.3;

/// A shape of the rail's surface and its spectrum.
pub(crate) struct Profile {
    /// Where it begins and ends in m, margins included.
    stretch_m: Range<f64>,
    samples: usize,
    /// Amplitudes in m of waves with whole numbers of periods over the samples.
    spectrum: Vec<Complex64>,
}

impl Profile {
    /// The shape that a model's extensions give the rail; none if they give it none.
    pub(crate) fn of_rail(model: &TrackModel) -> Option<Self> {
        Self::new(model.layout().length_m(), |x_m| model.profile_m(x_m))
    }

    /// The shape of the wheel along the track in a pass in which it begins a turn at `start_m`;
    /// none if it is round.
    pub(crate) fn of_wheel(model: &TrackModel, start_m: f64) -> Option<Self> {
        Self::new(model.layout().length_m(), |x_m| model.wheel_profile_m(x_m - start_m))
    }

    fn new(length_m: f64, height_m: impl Fn(f64) -> f64) -> Option<Self> {
        let count = (length_m / STEP_M) as usize;
        let height = |sample: usize| height_m(sample as f64 * STEP_M);
        let highest = (0..count).map(height).fold(0.0, |highest: f64, h| highest.max(h.abs()));
        if highest == 0.0 {
            return None;
        }
        // What is a ten thousandth of the shape is heard as -80 dB.
        let part = |sample: &usize| height(*sample).abs() > 1e-4 * highest;
        let from_m = (0..count).find(part)? as f64 * STEP_M - MARGIN_M;
        let to_m = (0..count).rev().find(part)? as f64 * STEP_M + MARGIN_M;
        let samples = ((to_m - from_m) / STEP_M) as usize;
        let samples = samples.next_power_of_two();
        let mut spectrum: Vec<Complex64> = (0..samples)
            .map(|sample| Complex64::from(height_m(from_m + sample as f64 * STEP_M)))
            .collect();
        FftPlanner::new().plan_fft_forward(samples).process(&mut spectrum);
        spectrum.iter_mut().for_each(|amplitude| *amplitude /= samples as f64);
        Some(Self { stretch_m: from_m..to_m, samples, spectrum })
    }

    /// Mean power over a window, from place to place in m, of the band around `centre_hz` at a
    /// speed, where waves of a frequency are taken with a gain.
    pub(crate) fn power(
        &self,
        window_m: Range<f64>,
        speed_m_s: f64,
        centre_hz: f64,
        transfer: impl Fn(f64) -> f64,
    ) -> f64 {
        if window_m.end < self.stretch_m.start || window_m.start > self.stretch_m.end {
            return 0.0;
        }
        let wave_hz = speed_m_s / (self.samples as f64 * STEP_M);
        let reach_hz = REACH / crate::bands::CENTRE_RAD * centre_hz;
        let first = (((centre_hz - reach_hz) / wave_hz).ceil() as usize).max(1);
        let last = (((centre_hz + reach_hz) / wave_hz) as usize).min(self.samples / 2);
        let places = (PLACES_PER_WAVE * centre_hz / wave_hz) as usize;
        let places = places.next_power_of_two().min(self.samples);
        let mut values = vec![Complex64::ZERO; places];
        for wave in first..=last {
            let frequency_hz = wave as f64 * wave_hz;
            let weight = 2.0 * gain(centre_hz, frequency_hz) * transfer(frequency_hz);
            values[wave % places] += weight * self.spectrum[wave];
        }
        inverse(places).process(&mut values);
        let step_m = self.samples as f64 * STEP_M / places as f64;
        let place = |x_m: f64| ((x_m - self.stretch_m.start) / step_m).ceil().max(0.0) as usize;
        let (from, to) = (place(window_m.start), place(window_m.end));
        let sum: f64 =
            values[from.min(places)..to.min(places)].iter().map(Complex64::norm_sqr).sum();
        sum / (to.max(from + 1) - from) as f64
    }
}

/// The inverse transform of a length; lengths are few and come again and again.
fn inverse(length: usize) -> Arc<dyn Fft<f64>> {
    thread_local! {
        static PLANNER: RefCell<FftPlanner<f64>> = RefCell::new(FftPlanner::new());
    }
    PLANNER.with_borrow_mut(|planner| planner.plan_fft_inverse(length))
}
