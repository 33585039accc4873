//! The continuous wavelet transform (CWT), a literal implementation of the formula.
//!
//! This module contains padding and the transform with its derivative in time. Every voice needs two
//! Fourier transforms of the whole padded signal. This form is for plots and as the reference for the
//! faster transform of the features.

use crate::wavelet::Morlet;
use num_complex::Complex64;
use std::{f64::consts::TAU, ops::Range, sync::Arc};
use tracktwin_fourier::Fft;

/// Padding of the signal for the transform, which is circular.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Padding {
    /// Zeros after the signal, up to this many samples in all.
    Zeros(usize),
    /// The signal mirrored at its first and last sample, about equally on both sides, up to this
    /// many samples in all (at most three times the signal's).
    Reflected(usize),
}

impl Padding {
    /// The padded samples, and the index of the first sample of the signal in them.
    ///
    /// # Panics
    /// If the padded length is shorter than the signal, or a mirror image is longer than the signal.
    pub fn around(self, samples: &[f64]) -> (Vec<f64>, usize) {
        match self {
            Self::Zeros(length) => {
                assert!(length >= samples.len(), "padding makes no signal shorter");
                let mut padded = samples.to_vec();
                padded.resize(length, 0.0);
                (padded, 0)
            }
            Self::Reflected(length) => {
                let missing = length.checked_sub(samples.len()).expect("padding only adds");
                let before = missing.div_ceil(2);
                let after = missing - before;
                let last = samples.len() - 1;
                assert!(before <= last, "a mirror image is not longer than the signal");
                let padded = (samples[1..=before].iter().rev())
                    .chain(samples)
                    .chain(samples[last - after..last].iter().rev());
                (padded.copied().collect(), before)
            }
        }
    }
}

/// Complex values over frequency (rows) and time (columns, one per sample).
#[derive(Clone, Debug, PartialEq)]
pub struct TimeFrequency {
    /// Frequency of each row in Hz.
    pub frequencies_hz: Vec<f64>,
    columns: usize,
    values: Vec<Complex64>,
}

impl TimeFrequency {
    pub(crate) fn zeros(frequencies_hz: Vec<f64>, columns: usize) -> Self {
        let values = vec![Complex64::ZERO; frequencies_hz.len() * columns];
        Self { frequencies_hz, columns, values }
    }

    /// Number of columns.
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// The values at the frequency with this index, one per column.
    pub fn row(&self, index: usize) -> &[Complex64] {
        &self.values[index * self.columns..][..self.columns]
    }

    pub(crate) fn row_mut(&mut self, index: usize) -> &mut [Complex64] {
        &mut self.values[index * self.columns..][..self.columns]
    }

    /// Mean of the squared magnitude over a range of columns, one value per row.
    ///
    /// For a synchrosqueezed transform this is the LWPS (paper, eq. 4).
    pub fn mean_power(&self, columns: Range<usize>) -> Vec<f64> {
        let count = columns.len() as f64;
        (0..self.frequencies_hz.len())
            .map(|row| {
                self.row(row)[columns.clone()].iter().map(Complex64::norm_sqr).sum::<f64>() / count
            })
            .collect()
    }

    /// Largest magnitude, zero where there are no values.
    pub(crate) fn largest(&self) -> f64 {
        self.values.iter().map(Complex64::norm_sqr).fold(0.0, f64::max).sqrt()
    }
}

/// The continuous wavelet transform of a stretch and its derivative in time.
#[derive(Clone, Debug)]
pub struct Cwt {
    /// Scale `a_j` of each row in s.
    pub scales_s: Vec<f64>,
    /// `W(a_j, b)` (paper, eq. A.1), in units of the signal times the square root of a second.
    pub coefficients: TimeFrequency,
    /// `dW / db / (2 pi i)`: the coefficients with every frequency weighted by itself, in Hz.
    ///
    /// The ratio to the coefficients is the instantaneous frequency of eq. A.3. The derivative is
    /// analytical, not a difference in time.
    pub weighted: TimeFrequency,
}

impl Cwt {
    /// Transforms `samples` at these scales in s, with one row per scale and one column per sample:
    /// `W(a, b) = sqrt(a) F^-1( F(s) psihat(a w) )` (paper, eq. A.1).
    ///
    /// # Panics
    /// Under the conditions of [`Padding::around`].
    pub fn new(
        samples: &[f64],
        sample_rate_hz: f64,
        padding: Padding,
        wavelet: Morlet,
        scales_s: &[f64],
    ) -> Self {
        let (padded, first) = padding.around(samples);
        let length = padded.len();
        let inverse = tracktwin_fourier::inverse(length);
        let spectrum = positive_spectrum(&padded, &tracktwin_fourier::forward(length));
        let line_hz = sample_rate_hz / length as f64;

        let frequencies_hz: Vec<_> = scales_s.iter().map(|&a| wavelet.frequency_hz(a)).collect();
        let mut coefficients = TimeFrequency::zeros(frequencies_hz, samples.len());
        let mut weighted = coefficients.clone();
        let mut voice = vec![Complex64::ZERO; length];
        let mut weighted_voice = voice.clone();
        for (row, &scale) in scales_s.iter().enumerate() {
            voice.fill(Complex64::ZERO);
            weighted_voice.fill(Complex64::ZERO);
            for (k, &value) in spectrum.iter().enumerate() {
                let frequency_hz = k as f64 * line_hz;
                voice[k] = value * (scale.sqrt() * wavelet.fourier(scale * TAU * frequency_hz));
                weighted_voice[k] = voice[k] * frequency_hz;
            }
            inverse.process(&mut voice);
            inverse.process(&mut weighted_voice);
            let stretch = first..first + samples.len();
            coefficients.row_mut(row).copy_from_slice(&voice[stretch.clone()]);
            weighted.row_mut(row).copy_from_slice(&weighted_voice[stretch]);
        }
        Self { scales_s: scales_s.to_vec(), coefficients, weighted }
    }
}

/// Fourier coefficients at the frequencies from zero to the Nyquist line, divided by the number of
/// samples so that a plain inverse transform gives the signal back.
fn positive_spectrum(samples: &[f64], forward: &Arc<dyn Fft<f64>>) -> Vec<Complex64> {
    let mut spectrum: Vec<_> = samples.iter().map(|&x| Complex64::new(x, 0.0)).collect();
    forward.process(&mut spectrum);
    spectrum.truncate(samples.len() / 2 + 1);
    let scale = 1.0 / samples.len() as f64;
    for value in &mut spectrum {
        *value *= scale;
    }
    spectrum
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_reflection_repeats_neither_the_first_nor_the_last_sample() {
        let (padded, first) = Padding::Reflected(8).around(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(padded, [3.0, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 4.0]);
        assert_eq!(first, 2);
    }

    #[test]
    fn the_transform_is_the_integral_of_signal_and_wavelet() {
        // A pulse well inside the stretch: neither padding nor the circle matters.
        let (rate, wavelet) = (10_000.0, Morlet::new(6.0));
        let pulse = |t: f64| (-(t / 0.01).powi(2)).exp() * (TAU * 150.0 * t).cos();
        let samples: Vec<_> = (0..2000).map(|n| pulse((f64::from(n) - 1000.0) / rate)).collect();
        let scale = wavelet.scale(170.0);
        let cwt = Cwt::new(&samples, rate, Padding::Zeros(2048), wavelet, &[scale]);
        for b in [900_u16, 1000, 1075] {
            let integral: Complex64 = (0_u16..)
                .zip(&samples)
                .map(|(n, sample)| {
                    let u = (f64::from(n) - f64::from(b)) / rate / scale;
                    let (sine, cosine) = (6.0 * u).sin_cos();
                    let wave = Complex64::new(cosine - (-18_f64).exp(), -sine);
                    let envelope = PI.powf(-0.25) * (-0.5 * u * u).exp();
                    wave * envelope * *sample / (rate * scale.sqrt())
                })
                .sum();
            let value = cwt.coefficients.row(0)[usize::from(b)];
            // Negative frequencies, which the analytic form drops, hold e^-18 of the wavelet.
            assert!((value - integral).norm() < 1e-7 * integral.norm(), "{value} {integral}");
        }
    }
}
