//! The recorder's filter and clock, where it takes fewer samples than there are steps.
//!
//! A windowed sinc without phase passes what is below 0.4 of the sample rate and stops what is above a half,
//! as the decimation filters of recorders do.

use crate::scheme::STEP_S;
use std::f64::consts::{PI, TAU};

/// Steps on either side of a sample that its filter needs.
pub(crate) const REACH: usize = 100;
/// Corner of the filter over the sample rate.
const CORNER: f64 = 0.45;

/// Values of steps at the samples of a recorder, from step `first` on, with `REACH` steps left at both ends:
/// filtered accelerations and interpolated positions.
pub(crate) fn sampled(
    sample_rate_hz: f64,
    first: usize,
    values: &[f64],
    position_m: &[f64],
) -> [Vec<f64>; 2] {
    let steps = 1.0 / (sample_rate_hz * STEP_S);
    let last = values.len().saturating_sub(REACH + 1);
    let count = (last.saturating_sub(first) as f64 / steps) as usize + 1;
    let places = (0..count).map(|sample| first as f64 + sample as f64 * steps);
    let filtered = |place: f64| {
        let middle = place as usize;
        let taps = middle.saturating_sub(REACH - 1)..(middle + REACH + 1).min(values.len());
        let weights = taps.clone().map(|step| weight(step as f64 - place, CORNER / steps));
        let (mut sum, mut of) = (0.0, 0.0);
        for (weight, value) in weights.zip(&values[taps]) {
            sum += weight * value;
            of += weight;
        }
        sum / of
    };
    let between = |place: f64| {
        let step = (place as usize).min(position_m.len() - 2);
        let share = place - step as f64;
        position_m[step] + share * (position_m[step + 1] - position_m[step])
    };
    [places.clone().map(filtered).collect(), places.map(between).collect()]
}

/// Sinc of a corner in shares of the step rate, under Blackman's window.
fn weight(offset: f64, corner: f64) -> f64 {
    let share = offset / REACH as f64;
    if share.abs() >= 1.0 {
        return 0.0;
    }
    let window = 0.42 + 0.5 * (PI * share).cos() + 0.08 * (TAU * share).cos();
    let angle = TAU * corner * offset;
    window * if angle.abs() < 1e-9 { 1.0 } else { angle.sin() / angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_below_the_corner_pass_unchanged_and_aliases_do_not() {
        let heard = |frequency_hz: f64| {
            let wave = |step: usize| (TAU * frequency_hz * STEP_S * step as f64).sin();
            let values: Vec<f64> = (0..20_000).map(wave).collect();
            let position_m: Vec<f64> = (0..20_000).map(|step| f64::from(step) * STEP_S).collect();
            sampled(25_600.0, 500, &values, &position_m)
        };
        let [samples, times_s] = heard(8000.0);
        for (sample, time_s) in samples.iter().zip(&times_s) {
            assert!((sample - (TAU * 8000.0 * time_s).sin()).abs() < 2e-3, "{time_s}");
        }
        assert!((times_s[1] - times_s[0] - 1.0 / 25_600.0).abs() < 1e-12);
        assert!((times_s[0] - 500.0 * STEP_S).abs() < 1e-12);
        assert!(heard(14_000.0)[0].iter().all(|sample| sample.abs() < 2e-3));
    }
}
