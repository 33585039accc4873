//! Power spectral density by Welch's method, comparable with the levels of other programs.
//!
//! The features come from the synchrosqueezed transform. The spectrum serves for tests of accuracy and
//! noise.

use crate::Signal;
use num_complex::Complex64;
use std::f64::consts::TAU;

/// The signal is shorter than one segment, or the segment has no samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{samples} samples are fewer than one segment of {segment}")]
pub struct WelchError {
    /// Number of samples of the signal.
    pub samples: usize,
    /// Number of samples of a segment.
    pub segment: usize,
}

/// One-sided power spectral density on evenly spaced bins from 0 to half the sample rate.
#[derive(Clone, Debug, PartialEq)]
pub struct PowerSpectrum {
    bin_width_hz: f64,
    density: Vec<f64>,
}

impl PowerSpectrum {
    /// Welch's estimate, in the squared unit of the signal per Hz: the mean of the periodograms of
    /// segments of `segment` samples. The segments overlap by half; each has its mean removed and a Hann
    /// window.
    ///
    /// The integral of the density equals the variance of the signal, independent of the window.
    /// Source: Welch 1967, *The use of fast Fourier transform for the estimation of power spectra*.
    ///
    /// # Errors
    /// [`WelchError`] if no segment fits into the signal.
    pub fn welch(signal: &Signal, segment: usize) -> Result<Self, WelchError> {
        let samples = signal.samples();
        if segment < 2 || samples.len() < segment {
            return Err(WelchError { samples: samples.len(), segment });
        }
        let window: Vec<f64> = (0..segment)
            .map(|index| 0.5 - 0.5 * (TAU * index as f64 / segment as f64).cos())
            .collect();
        let transform = tracktwin_fourier::forward(segment);
        let mut density = vec![0.0; segment / 2 + 1];
        let starts: Vec<_> = (0..=samples.len() - segment).step_by(segment / 2).collect();
        for &start in &starts {
            let mut lines = windowed(&samples[start..start + segment], &window);
            transform.process(&mut lines);
            for (sum, line) in density.iter_mut().zip(&lines) {
                *sum += line.norm_sqr();
            }
        }
        let energy: f64 = window.iter().map(|weight| weight * weight).sum();
        let scale = 1.0 / (energy * signal.sample_rate_hz() * starts.len() as f64);
        for (bin, value) in density.iter_mut().enumerate() {
            // Mean and Nyquist frequency have no mirror image to fold onto them.
            let sides = if bin == 0 || 2 * bin == segment { 1.0 } else { 2.0 };
            *value *= sides * scale;
        }
        Ok(Self { bin_width_hz: signal.sample_rate_hz() / segment as f64, density })
    }

    /// Width of a bin in Hz.
    pub const fn bin_width_hz(&self) -> f64 {
        self.bin_width_hz
    }

    /// The density in each bin, the first at 0 Hz.
    pub fn density(&self) -> &[f64] {
        &self.density
    }

    /// Mean density of the bins from `low_hz` (included) to `high_hz` (excluded). `None` if no bin lies
    /// in this range.
    pub fn mean_density(&self, low_hz: f64, high_hz: f64) -> Option<f64> {
        let bin = |frequency: f64| (frequency / self.bin_width_hz).ceil() as usize;
        let bins = self.density.get(bin(low_hz)..bin(high_hz).min(self.density.len()))?;
        (!bins.is_empty()).then(|| bins.iter().sum::<f64>() / bins.len() as f64)
    }

    /// Level of the mean density in the one-third octave around `centre_hz`, in dB re one squared unit
    /// per Hz. `None` if no bin lies in this band.
    pub fn third_octave_level(&self, centre_hz: f64) -> Option<f64> {
        let side = 2.0_f64.powf(1.0 / 6.0);
        self.mean_density(centre_hz / side, centre_hz * side).map(|mean| 10.0 * mean.log10())
    }
}

/// A segment without its mean, under the window.
fn windowed(segment: &[f64], window: &[f64]) -> Vec<Complex64> {
    let mean = segment.iter().sum::<f64>() / segment.len() as f64;
    segment
        .iter()
        .zip(window)
        .map(|(value, weight)| Complex64::new((value - mean) * weight, 0.0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tone(frequency_hz: f64, samples: usize) -> Signal {
        let values = (0..samples)
            .map(|index| 3.0 + 2.0 * (TAU * frequency_hz * index as f64 / 1000.0).sin());
        Signal::new(1000.0, values.collect()).unwrap()
    }

    #[test]
    fn the_integral_of_the_density_is_the_variance() {
        let spectrum = PowerSpectrum::welch(&tone(100.0, 4000), 1000).unwrap();
        let power: f64 = spectrum.density().iter().sum::<f64>() * spectrum.bin_width_hz();
        // A tone of amplitude 2 at a bin's centre; its mean of 3 is taken away. Rounding only.
        assert!((power - 2.0).abs() < 1e-9, "{power}");
    }

    #[test]
    fn a_tone_in_a_third_octave_has_its_power_over_the_bins_width() {
        let spectrum = PowerSpectrum::welch(&tone(100.0, 4000), 1000).unwrap();
        // Bins of 1 Hz: the octave from 89.09 to 112.25 Hz holds 90 to 112.
        let expected = 10.0 * (2.0_f64 / 23.0).log10();
        let level = spectrum.third_octave_level(100.0).unwrap();
        assert!((level - expected).abs() < 1e-9, "{level} against {expected}");
    }

    #[test]
    fn a_band_between_two_bins_has_no_level() {
        let spectrum = PowerSpectrum::welch(&tone(100.0, 4000), 1000).unwrap();
        assert_eq!(spectrum.mean_density(10.2, 10.8), None);
        assert_eq!(spectrum.mean_density(600.0, 700.0), None);
    }

    #[test]
    fn a_signal_shorter_than_a_segment_is_refused() {
        let error = PowerSpectrum::welch(&tone(100.0, 500), 1000).unwrap_err();
        assert_eq!(error, WelchError { samples: 500, segment: 1000 });
    }
}
