//! Innovations of a pass: the part of every sample that the samples before it do not predict.

use super::background::{faded_lines, median};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use tracktwin_number::NORMAL_QUARTILE;
use tracktwin_signal::recording::Pass;

/// Number of samples that predict the next one: four poles for each of ten resonances.
const ORDER: usize = 40;
/// Share of the power that is added as white noise, so that a silent band stays solvable.
const FLOOR: f64 = 1e-9;
/// Number of steps per distance over which the usual size is determined.
const STEPS: usize = 20;

/// Innovations of a pass below a frequency.
///
/// The prediction removes the ringing of wheel and track after a blow, and the slope of the surface's spectrum.
/// Source: Makhoul 1975, *Linear prediction: a tutorial review*, Proc. IEEE 63, the autocorrelation method.
#[derive(Clone, Debug)]
pub(crate) struct Innovations {
    /// Position of every sample in m.
    pub position_m: Vec<f64>,
    /// Innovation of every sample in the unit of the signal.
    pub values: Vec<f64>,
}

impl Innovations {
    /// Innovations of the pass, resampled at twice `top_hz`; `None` if the pass is too short or silent.
    pub(crate) fn of(pass: &Pass, top_hz: f64) -> Option<Self> {
        let (position_m, values) = resampled(pass, top_hz);
        if values.len() < 10 * ORDER {
            return None;
        }
        let lagged = |lag: usize| {
            values[lag..].iter().zip(&values).map(|(late, early)| late * early).sum::<f64>()
        };
        let correlation: Vec<f64> = (0..=ORDER).map(lagged).collect();
        let matrix = DMatrix::from_fn(ORDER, ORDER, |row, column| {
            let floor = if row == column { FLOOR * correlation[0] } else { 0.0 };
            correlation[row.abs_diff(column)] + floor
        });
        let weights = matrix.cholesky()?.solve(&DVector::from_column_slice(&correlation[1..]));
        let innovation = |index: usize| {
            let before = (1..=ORDER.min(index)).map(|lag| weights[lag - 1] * values[index - lag]);
            values[index] - before.sum::<f64>()
        };
        let values = (0..values.len()).map(innovation).collect();
        Some(Self { position_m, values })
    }

    /// Usual size of an innovation, as a standard deviation.
    pub(crate) fn usual(&self) -> f64 {
        median(self.values.iter().map(|value| value.abs()).collect()) / NORMAL_QUARTILE
    }

    /// Innovations relative to their usual size over `reach_m` before or behind each, whichever is larger: where the
    /// level of the surface changes, the louder side tells what is usual.
    pub(crate) fn levelled(&self, reach_m: f64) -> Self {
        let count = self.values.len();
        let length_m = self.position_m[count - 1] - self.position_m[0];
        let step = ((reach_m / length_m * count as f64) as usize / STEPS).max(1);
        let usual = |from: usize, to: usize| {
            let values = &self.values[(from * step).min(count)..(to * step).min(count)];
            median(values.iter().map(|value| value.abs()).collect()) / NORMAL_QUARTILE
        };
        let of_step = |place: usize| {
            let before = usual(place.saturating_sub(STEPS), place);
            before.max(usual(place + 1, place + 1 + STEPS))
        };
        let sizes: Vec<f64> = (0..count.div_ceil(step)).map(of_step).collect();
        let size = |index: usize| sizes[index / step];
        let levelled = |(index, value): (usize, &f64)| value / size(index).max(f64::MIN_POSITIVE);
        let values = self.values.iter().enumerate().map(levelled).collect();
        Self { position_m: self.position_m.clone(), values }
    }

    /// Innovation at a position in m, interpolated; zero beyond the pass.
    pub(crate) fn at(&self, place_m: f64) -> f64 {
        let after = self.position_m.partition_point(|&x| x < place_m);
        if after == 0 || after == self.position_m.len() {
            return 0.0;
        }
        let [from, to] = [self.position_m[after - 1], self.position_m[after]];
        let share = (place_m - from) / (to - from);
        (1.0 - share) * self.values[after - 1] + share * self.values[after]
    }
}

/// Positions in m and samples of a pass at a sample rate of twice `top_hz`, or at its own if that is lower.
fn resampled(pass: &Pass, top_hz: f64) -> (Vec<f64>, Vec<f64>) {
    let lines = faded_lines(&pass.signal);
    let (length, rate) = (lines.len(), pass.signal.sample_rate_hz());
    let kept = ((length as f64 * 2.0 * top_hz / rate) as usize).min(length);
    let mut low: Vec<Complex64> = vec![Complex64::ZERO; kept];
    let half = kept.div_ceil(2);
    low[..half].copy_from_slice(&lines[..half]);
    for line in 1..half {
        low[kept - line] = lines[length - line];
    }
    tracktwin_fourier::inverse(kept).process(&mut low);
    let step = length as f64 / kept as f64;
    let last = pass.position_m.len() - 1;
    let places =
        (0..kept).map(|index| index as f64 * step).take_while(|&place| place < last as f64);
    let position = |place: f64| {
        let before = place as usize;
        let [from, to] = [before, before + 1].map(|index| pass.position_m[index]);
        from + (place - before as f64) * (to - from)
    };
    let position_m: Vec<f64> = places.map(position).collect();
    let values = low[..position_m.len()].iter().map(|value| value.re / length as f64).collect();
    (position_m, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::noise;
    use std::f64::consts::TAU;
    use tracktwin_signal::Signal;

    fn pass(samples: Vec<f64>) -> Pass {
        let position_m = (0..samples.len()).map(|index| 1e-3 * index as f64).collect();
        let signal = Signal::new(1e4, samples).unwrap();
        Pass {
            file: String::new(),
            speed_km_h: 36.0,
            signal,
            position_m,
            axle: None,
            contact_loss_share: None,
        }
    }

    #[test]
    fn a_resonance_is_predicted_and_its_blow_is_not() {
        // Noise and one blow ring for a hundred samples at 300 Hz.
        let (decay, omega) = ((-0.01f64).exp(), TAU * 0.03);
        let mut samples = noise(3, 20_000);
        samples[12_000] += 40.0;
        for index in 2..samples.len() {
            samples[index] +=
                2.0 * decay * omega.cos() * samples[index - 1] - decay * decay * samples[index - 2];
        }
        let found = Innovations::of(&pass(samples), 5000.0).unwrap();
        let inner = &found.values[1000..19_000];
        let loudest = (0..inner.len()).max_by(|&a, &b| inner[a].total_cmp(&inner[b])).unwrap();
        assert_eq!(loudest + 1000, 12_000);
        assert!((inner[loudest] - 40.0).abs() < 4.0, "{}", inner[loudest]);
        let mean = inner.iter().map(|value| value * value).sum::<f64>() / inner.len() as f64;
        // The blow adds 0.09; noise of variance one before the ringing.
        assert!((mean - 1.09).abs() < 0.05, "{mean}");
    }

    #[test]
    fn levelled_innovations_have_one_size_on_either_side_of_a_step() {
        let mut values = noise(4, 20_000);
        for value in &mut values[12_000..] {
            *value *= 5.0;
        }
        let position_m = (0..values.len()).map(|index| 1e-3 * index as f64).collect();
        let levelled = Innovations { position_m, values }.levelled(1.0).values;
        let deviation = |range: std::ops::Range<usize>| {
            let values = &levelled[range];
            (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
        };
        for range in [1000..10_900, 12_000..13_000, 13_000..20_000] {
            assert!((deviation(range.clone()) - 1.0).abs() < 0.1, "{range:?}");
        }
        // Just before the step what is behind it is usual.
        assert!((deviation(11_700..12_000) - 0.2).abs() < 0.05);
    }

    #[test]
    fn a_slow_wave_keeps_its_place_at_a_lower_sample_rate() {
        let wave = |place: f64| (TAU * place / 200.0).sin();
        let samples = (0..20_000).map(|index| wave(f64::from(index))).collect();
        let (position_m, values) = resampled(&pass(samples), 500.0);
        let inside = position_m.iter().zip(&values).filter(|(x, _)| (1.0..19.0).contains(*x));
        let error = inside.map(|(x, value)| (value - wave(x / 1e-3)).abs()).fold(0.0, f64::max);
        assert!(error < 2e-3, "{error}");
        assert!((position_m[1] - 1e-2).abs() < 1e-5);
    }

    #[test]
    fn silence_has_no_innovations() {
        assert!(Innovations::of(&pass(vec![0.0; 20_000]), 1000.0).is_none());
        assert!(Innovations::of(&pass(noise(1, 300)), 5000.0).is_none());
    }
}
