//! Background of a pass: a power spectral density that impacts do not affect.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use tracktwin_signal::Signal;

/// Number of segments per second of signal. The spectral lines are 50 Hz apart, narrower than the contact
/// resonances, and a segment is long enough for the ringing after an impact.
const SEGMENTS_PER_S: f64 = 50.0;

/// Smallest number of segments for a median.
const SEGMENTS_MIN: usize = 8;

/// Time in s of the fade-in and fade-out of a pass before the transform.
const FADE_S: f64 = 0.005;

/// One-sided power spectral density of a pass in the signal's unit squared per Hz.
#[derive(Clone, Debug)]
pub(crate) struct Background {
    step_hz: f64,
    density: Vec<f64>,
}

impl Background {
    /// Estimates the background as the median over half-overlapping Hann segments, divided by ln 2. This
    /// equals the mean if all segments are alike, and impacts in less than half of the segments do not
    /// change it.
    ///
    /// `None` if the signal is too short for a median, or constant.
    pub(crate) fn of(signal: &Signal) -> Option<Self> {
        let rate = signal.sample_rate_hz();
        let segment = ((rate / SEGMENTS_PER_S).round() as usize).max(16) & !1;
        let powers = powers(signal.samples(), segment);
        if powers.len() < SEGMENTS_MIN {
            return None;
        }
        let energy: f64 = (0..segment).map(|i| hann(i, segment).powi(2)).sum();
        let scale = 2.0 / (energy * rate * 2f64.ln());
        let density: Vec<f64> = (0..=segment / 2)
            .map(|bin| scale * median(powers.iter().map(|power| power[bin]).collect()))
            .collect();
        let alive = density[1..].iter().all(|&value| value > 0.0);
        alive.then_some(Self { step_hz: rate / segment as f64, density })
    }

    /// The density at a frequency in Hz, interpolated in the logarithm.
    pub(crate) fn at(&self, frequency_hz: f64) -> f64 {
        let last = self.density.len() - 1;
        let place = (frequency_hz / self.step_hz).clamp(1.0, last as f64);
        let bin = (place.floor() as usize).min(last - 1).max(1);
        let (low, high) = (self.density[bin], self.density[(bin + 1).min(last)]);
        low * (high / low).powf(place - bin as f64)
    }

    /// Density of the noise floor: the median of the upper half of the spectrum, where a recorder
    /// with a sufficient sample rate records only its own noise.
    pub(crate) fn floor(&self) -> f64 {
        // The last tenth belongs to the anti-alias filter.
        let bins = self.density.len();
        median(self.density[bins / 2..bins * 9 / 10].to_vec())
    }

    /// Highest frequency in Hz at which the density is `factor` times above the noise floor.
    pub(crate) fn audible_hz(&self, factor: f64) -> f64 {
        let floor = self.floor();
        let last = self.density.iter().rposition(|&value| value > factor * floor);
        last.unwrap_or(0) as f64 * self.step_hz
    }
}

/// Power of every bin of every segment.
fn powers(samples: &[f64], segment: usize) -> Vec<Vec<f64>> {
    if samples.len() < segment {
        return Vec::new();
    }
    let transform = tracktwin_fourier::forward(segment);
    let power = |start: usize| {
        let part = &samples[start..start + segment];
        let mean = part.iter().sum::<f64>() / segment as f64;
        let mut lines: Vec<_> = part
            .iter()
            .enumerate()
            .map(|(i, value)| Complex64::new((value - mean) * hann(i, segment), 0.0))
            .collect();
        transform.process(&mut lines);
        lines[..=segment / 2].iter().map(Complex64::norm_sqr).collect()
    };
    (0..=samples.len() - segment).step_by(segment / 2).map(power).collect()
}

/// The analytic signal in a band, divided by the square root of the background's density.
///
/// The background has a mean squared magnitude of one. Division by the background removes the resonances of
/// the track; a short defect becomes a short event.
pub(crate) fn whitened(
    signal: &Signal,
    background: &Background,
    [low_hz, high_hz]: [f64; 2],
) -> Vec<Complex64> {
    let rate = signal.sample_rate_hz();
    let mut lines = faded_lines(signal);
    let length = lines.len();
    let scale = (2.0 / (high_hz - low_hz)).sqrt() / length as f64;
    for (bin, line) in lines.iter_mut().enumerate() {
        let frequency = bin as f64 * rate / length as f64;
        let inside = (low_hz..=high_hz).contains(&frequency) && 2 * bin < length;
        *line *= if inside { scale / background.at(frequency).sqrt() } else { 0.0 };
    }
    tracktwin_fourier::inverse(length).process(&mut lines);
    lines.truncate(signal.samples().len());
    lines
}

/// Spectral lines of a signal that fades in and out, without its mean, at a smooth length.
pub(crate) fn faded_lines(signal: &Signal) -> Vec<Complex64> {
    let samples = signal.samples();
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let fade = ((FADE_S * signal.sample_rate_hz()) as usize).min(samples.len() / 4).max(1);
    let mut lines = vec![Complex64::ZERO; smooth_length(samples.len())];
    for (index, (line, value)) in lines.iter_mut().zip(samples).enumerate() {
        let edge = index.min(samples.len() - 1 - index);
        let weight =
            if edge < fade { 0.5 - 0.5 * (PI * edge as f64 / fade as f64).cos() } else { 1.0 };
        line.re = weight * (value - mean);
    }
    tracktwin_fourier::forward(lines.len()).process(&mut lines);
    lines
}

/// The smallest number not below `length` with no prime factors except 2, 3 and 5, for a fast transform.
pub(crate) fn smooth_length(length: usize) -> usize {
    let is_smooth = |mut number: usize| {
        for factor in [2, 3, 5] {
            while number.is_multiple_of(factor) {
                number /= factor;
            }
        }
        number == 1
    };
    // A power of two lies within.
    let upper = length.max(1).next_power_of_two();
    (length.max(1)..=upper).find(|&number| is_smooth(number)).unwrap_or(upper)
}

/// The periodic Hann window.
pub(crate) fn hann(index: usize, length: usize) -> f64 {
    0.5 - 0.5 * (TAU * index as f64 / length as f64).cos()
}

/// Median; the upper of the two middle values for an even count, zero for an empty list.
pub fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::noise;

    #[test]
    fn white_noise_has_its_density_and_whitens_to_one() {
        // Variance 4 over 5 kHz.
        let samples = noise(1, 40_000).iter().map(|value| 2.0 * value).collect();
        let signal = Signal::new(1e4, samples).unwrap();
        let background = Background::of(&signal).unwrap();
        let expected = 4.0 / 5000.0;
        // A median of 400 values of an exponential variable is known to 10 %.
        assert!((background.at(2500.0) / expected - 1.0).abs() < 0.3);
        assert!((background.floor() / expected - 1.0).abs() < 0.05);
        let white = whitened(&signal, &background, [500.0, 4000.0]);
        let power = white.iter().map(Complex64::norm_sqr).sum::<f64>() / white.len() as f64;
        // 14,000 degrees of freedom, and the median's own bias of 1/(2 n).
        assert!((power - 1.0).abs() < 0.05, "{power}");
    }

    #[test]
    fn impacts_do_not_move_the_background() {
        let mut samples = noise(2, 40_000);
        for index in (1000..40_000).step_by(4000) {
            samples[index] += 500.0;
        }
        let with = Background::of(&Signal::new(1e4, samples).unwrap()).unwrap();
        let without = Background::of(&Signal::new(1e4, noise(2, 40_000)).unwrap()).unwrap();
        // Ten impacts in twenty of four hundred segments move the median by a tenth of its scatter.
        assert!((with.floor() / without.floor() - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_signal_that_is_short_or_still_has_no_background() {
        assert!(Background::of(&Signal::new(1e4, vec![0.0; 40_000]).unwrap()).is_none());
        assert!(Background::of(&Signal::new(1e4, noise(3, 500)).unwrap()).is_none());
    }

    #[test]
    fn lengths_for_transforms_are_smooth() {
        assert_eq!([97, 100, 1, 121].map(smooth_length), [100, 100, 1, 125]);
    }
}
