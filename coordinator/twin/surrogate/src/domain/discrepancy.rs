//! Discrepancy between two simulators of one track, or between a simulator and a measurement.

use faer::Mat;

/// Standard deviation of the difference in ln-power, 0.4 dB: two simulators with different discretisations
/// of the same track differ by this amount in one-third octaves (`docs/accuracy.md`).
const SD_NEPER: f64 = 0.09;
/// Octaves over which the correlation of the difference falls to 1/e.
const LENGTH_OCTAVES: f64 = 0.5;
/// Share of the variance of the difference that is common to all speeds and belongs to the track. The rest
/// depends on the wavelength, as the surface does, and is independent between speeds.
const COMMON: f64 = 0.5;

/// Covariance of the difference in ln-power between bands at these frequencies, with the speeds one after
/// the other: (speeds * bands) x (speeds * bands).
pub(super) fn discrepancy(frequencies_hz: &[f64], speeds: usize) -> Mat<f64> {
    let bands = frequencies_hz.len();
    Mat::from_fn(speeds * bands, speeds * bands, |i, j| {
        let octaves = (frequencies_hz[i % bands] / frequencies_hz[j % bands]).log2().abs();
        let shared = if i / bands == j / bands { 1.0 } else { COMMON };
        SD_NEPER * SD_NEPER * shared * (-octaves / LENGTH_OCTAVES).exp()
    })
}
