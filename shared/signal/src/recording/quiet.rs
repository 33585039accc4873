//! Checks whether the signal of a pass contains the acceleration of a rolling wheel.

use super::Pass;
use tracktwin_number::{rounded, significant};

/// Root mean square acceleration in m/s2 per km/h below which no wheel can have rolled. Ground rails and
/// round wheels give a hundred times as much.
const QUIET: f64 = 5e-3;
/// Steps of the recorder below which a signal is mostly rounding.
const STEPS_MIN: f64 = 2.0;
/// Number of samples examined for the resolution of the recorder.
const LOOKED_AT: usize = 20_000;

/// Reason to doubt that the wheel rolled or that the sensor was on, if there is one.
pub(super) fn doubt(pass: &Pass, gain_known: bool) -> Option<String> {
    let (samples, speed) = (pass.signal.samples(), pass.speed_km_h);
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let square = samples.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let rms = (square / samples.len() as f64).sqrt();
    let file = &pass.file;
    if gain_known && rms < QUIET * speed {
        let (rms, speed) = (significant(rms, 2), rounded(speed, 3));
        return Some(format!(
            "doubt: {file}: {rms} m/s2 rms is hardly a signal at {speed} km/h; check whether \
                 the train was standing, the sensor was off, or the unit or channel is wrong"
        ));
    }
    let step = step(samples)?;
    (rms < STEPS_MIN * step).then(|| {
        format!(
            "doubt: {file}: the signal is only {} steps of its resolution: hardly a signal; \
                 record with more gain, or with the train rolling",
            significant(rms / step, 2)
        )
    })
}

/// The recorder's step: the least difference of two values, if all are whole numbers of it.
fn step(samples: &[f64]) -> Option<f64> {
    let mut values = samples[..samples.len().min(LOOKED_AT)].to_vec();
    values.sort_by(f64::total_cmp);
    let apart = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let greatest = values.last()?.abs().max(values.first()?.abs());
    // Single precision makes values differ that were alike.
    let real = |difference: &f64| *difference > 1e-6 * greatest;
    let step = apart().filter(real).fold(f64::INFINITY, f64::min);
    let whole = |ratio: f64| (ratio - ratio.round()).abs() < 0.02 * ratio.max(1.0);
    (step.is_finite() && apart().filter(real).all(|difference| whole(difference / step)))
        .then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Signal;

    fn pass(rms: f64, step: f64) -> Pass {
        let value = |i: u32| rms * std::f64::consts::SQRT_2 * (0.7 * f64::from(i)).sin();
        let rounded = |v: f64| if step > 0.0 { (v / step).round() * step } else { v };
        let samples: Vec<f64> = (0..4000).map(|i| rounded(value(i))).collect();
        let position_m = (0..4000).map(|i| 0.01 * f64::from(i)).collect();
        let signal = Signal::new(2000.0, samples).unwrap();
        Pass {
            file: "a.csv".to_owned(),
            speed_km_h: 67.0,
            axle: None,
            signal,
            position_m,
            contact_loss_share: None,
        }
    }

    #[test]
    fn a_standing_train_is_doubted_and_a_rolling_one_is_not() {
        assert!(doubt(&pass(0.026, 0.0), true).unwrap().contains("0.026 m/s2 rms"));
        assert_eq!(doubt(&pass(0.026, 0.0), false), None);
        assert_eq!(doubt(&pass(5.0, 0.0), true), None);
    }

    #[test]
    fn a_signal_of_a_few_steps_is_doubted_in_any_unit() {
        assert!(doubt(&pass(0.015, 0.01), false).unwrap().contains("steps of its resolution"));
        assert_eq!(doubt(&pass(0.5, 0.01), false), None);
    }
}
