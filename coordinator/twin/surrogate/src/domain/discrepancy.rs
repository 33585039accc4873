//! How far two simulators, or a simulator and a rig, may differ on one and the same track.

use faer::Mat;

/// Standard deviation of a difference in ln-power, 0.4 dB: what simulators with other
/// discretisations of the same track differ by in one-third octaves (`docs/accuracy.md`).
const SD_NEPER: f64 = 0.09;
/// Octaves over which the correlation of the difference falls to 1/e.
const LENGTH_OCTAVES: f64 = 0.5;
/// Part of the difference's variance that is the same at all speeds: that of the track. The rest
/// goes with wavelengths, as that of the surface does.
const COMMON: f64 = 0.5;

/// Covariance of the difference in bands of these frequencies, the speeds side by side.
pub(super) fn discrepancy(frequencies_hz: &[f64], speeds: usize) -> Mat<f64> {
    let bands = frequencies_hz.len();
    Mat::from_fn(speeds * bands, speeds * bands, |i, j| {
        let octaves = (frequencies_hz[i % bands] / frequencies_hz[j % bands]).log2().abs();
        let shared = if i / bands == j / bands { 1.0 } else { COMMON };
        SD_NEPER * SD_NEPER * shared * (-octaves / LENGTH_OCTAVES).exp()
    })
}
