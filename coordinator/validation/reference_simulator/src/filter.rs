//! From the simulation's steps to the recording's samples, without a shift in time.

use std::f64::consts::PI;

/// Half the length of the filter in steps of the simulation.
const HALF: usize = 48;

/// Every second sample after a low-pass of linear phase at half of the new rate.
///
/// A sinc under Blackman's window, normalised: flat within 1e-3 to 0.4 of the new rate and below
/// -70 dB from 0.6 of it on. Values beyond the ends repeat those at the ends.
pub(crate) fn halve_rate(samples: &[f64]) -> Vec<f64> {
    let taps = taps();
    let last = samples.len().saturating_sub(1);
    let at = |index: usize, tap: usize| samples[(index + tap).saturating_sub(HALF).min(last)];
    let value = |index: usize| -> f64 {
        taps.iter().enumerate().map(|(tap, weight)| weight * at(index, tap)).sum()
    };
    (0..samples.len()).step_by(2).map(value).collect()
}

fn taps() -> Vec<f64> {
    let tap = |index: usize| {
        let from_middle = index as f64 - HALF as f64;
        let phase = 0.5 * PI * from_middle;
        let sinc = if from_middle == 0.0 { 1.0 } else { phase.sin() / phase };
        let turn = PI * (index as f64 + 1.0) / (HALF as f64 + 1.0);
        sinc * (0.42 - 0.5 * turn.cos() + 0.08 * (2.0 * turn).cos())
    };
    let taps: Vec<f64> = (0..=2 * HALF).map(tap).collect();
    let sum: f64 = taps.iter().sum();
    taps.into_iter().map(|tap| tap / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude of a tone of so many turns a new sample that passes the filter.
    fn passed(turns: f64) -> f64 {
        let tone = |index: u32| (2.0 * PI * turns * 0.5 * f64::from(index)).cos();
        let samples: Vec<f64> = (0..4000).map(tone).collect();
        let kept = &halve_rate(&samples)[100..1900];
        kept.iter().zip(100..).map(|(value, n)| value * tone(2 * n)).sum::<f64>() / 900.0
    }

    #[test]
    fn tones_below_pass_unchanged_in_time_and_those_above_vanish() {
        assert!((passed(0.04) - 1.0).abs() < 1e-3);
        assert!((passed(0.4) - 1.0).abs() < 2e-3);
        assert!(passed(0.61).abs() < 1e-3 && passed(0.9).abs() < 1e-3);
    }
}
