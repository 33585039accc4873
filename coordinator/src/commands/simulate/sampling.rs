//! Low-pass filter and clock of a recorder that takes fewer samples than the simulation has time steps.

use std::f64::consts::{PI, TAU};
use tracktwin_track::extension::Measured;

/// Corner of the filter relative to the sample rate.
const CORNER: f64 = 0.45;

/// Samples on either side of a sample that its filter contains.
const REACH: f64 = 40.0;

/// Sample rate of a time step, rounded to 1 nHz: 1 / 2e-5 s is 50 kHz, not 49999.99999999999 Hz.
pub(super) fn sample_rate_hz(time_step_s: f64) -> f64 {
    (1e9 / time_step_s).round() / 1e9
}

/// Filtered accelerations in m/s2 and positions in m at the samples of a recorder, from the first kept one on. The last
/// samples, whose filter would need later time steps, are left out; of a short pass no sample is left.
///
/// The filter is a sinc with Blackman's window and has no delay. It passes what lies below 0.4 of the sample rate and
/// stops what lies above a half.
pub(super) fn resampled(measured: &Measured, sample_rate_hz: f64) -> [Vec<f64>; 2] {
    let Measured { time_step_s, acceleration_m_s2, position_m, first } = measured;
    let first = *first as f64;
    let steps = 1.0 / (sample_rate_hz * time_step_s);
    let reach = REACH * steps;
    let last = acceleration_m_s2.len() as f64 - 1.0 - reach;
    let count = (((last - first) / steps).floor() + 1.0).max(0.0) as usize;
    let places = (0..count).map(|sample| first + sample as f64 * steps);
    let filtered = |place: f64| {
        let taps = (place - reach).ceil().max(0.0) as usize..=(place + reach) as usize;
        let [mut sum, mut weights] = [0.0; 2];
        for step in taps {
            let offset = (step as f64 - place) / steps;
            let weight = weight(offset);
            sum += weight * acceleration_m_s2[step];
            weights += weight;
        }
        sum / weights
    };
    let between = |place: f64| {
        let step = place as usize;
        position_m[step] + place.fract() * (position_m[step + 1] - position_m[step])
    };
    [places.clone().map(filtered).collect(), places.map(between).collect()]
}

/// Weight of a time step at an offset in samples.
fn weight(offset: f64) -> f64 {
    let share = PI * offset / REACH;
    let window = 0.42 + 0.5 * share.cos() + 0.08 * (2.0 * share).cos();
    let angle = TAU * CORNER * offset;
    window * if angle.abs() < 1e-9 { 1.0 } else { angle.sin() / angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_below_the_corner_pass_unchanged_and_aliases_do_not() {
        for sample_rate_hz in [2000.0, 25_600.0] {
            let heard = |frequency_hz: f64| {
                let angle = |step: u32| TAU * frequency_hz * 1e-5 * f64::from(step);
                let measured = Measured {
                    time_step_s: 1e-5,
                    acceleration_m_s2: (0..40_000).map(|step| angle(step).sin()).collect(),
                    position_m: (0..40_000).map(|step| 1e-5 * f64::from(step)).collect(),
                    first: 10_000,
                };
                resampled(&measured, sample_rate_hz)
            };
            let frequency_hz = 0.39 * sample_rate_hz;
            let [samples, times_s] = heard(frequency_hz);
            assert!((times_s[0] - 0.1).abs() < 1e-9);
            assert!((times_s[1] - times_s[0] - 1.0 / sample_rate_hz).abs() < 1e-9);
            assert!(
                (times_s[times_s.len() - 1] - 0.4 + 40.0 / sample_rate_hz).abs()
                    < 1.1 / sample_rate_hz
            );
            for (sample, time_s) in samples.iter().zip(times_s) {
                assert!((sample - (TAU * frequency_hz * time_s).sin()).abs() < 2e-3);
            }
            let [aliased, _] = heard(0.52 * sample_rate_hz);
            assert!(aliased.iter().all(|sample| sample.abs() < 2e-3));
        }
    }

    #[test]
    fn a_pass_that_is_shorter_than_the_filter_has_no_samples() {
        let from = |first: usize| Measured {
            time_step_s: 1e-5,
            acceleration_m_s2: vec![0.0; 3000],
            position_m: vec![0.0; 3000],
            first,
        };
        assert!(resampled(&from(0), 1000.0).iter().all(Vec::is_empty));
        assert!(resampled(&from(3000), 50_000.0).iter().all(Vec::is_empty));
        assert_eq!(resampled(&from(0), 2000.0)[0].len(), 20);
    }
}
