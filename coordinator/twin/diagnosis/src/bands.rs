//! Frequency bands in which recording and simulation are compared.
//!
//! The feature of the paper is the synchrosqueezed spectrum, which has no closed form. The diagnosis uses
//! the wavelet power instead: it is linear in the power of the signal, and a track model predicts its mean
//! without a time simulation.

/// Number of bands per octave; neighbouring wavelets, with a width of a sixth of the frequency, overlap by
/// half.
const BANDS_PER_OCTAVE: f64 = 6.0;

/// Number of spectral lines per octave over which a band is averaged.
const LINES_PER_OCTAVE: f64 = 30.0;

/// Centre of the Morlet wavelet in rad, as in the features.
pub(crate) const CENTRE_RAD: f64 = 6.0;

/// Reach of a band in standard deviations.
const REACH: f64 = 4.0;

/// Bands of a Morlet wavelet, and the spectral lines over which they are averaged.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    centres_hz: Vec<f64>,
    lines_hz: Vec<f64>,
    weights: Vec<Vec<(usize, f64)>>,
}

impl Bands {
    /// Bands from `lowest_hz` to `highest_hz`, a sixth of an octave apart.
    pub fn new(lowest_hz: f64, highest_hz: f64) -> Self {
        let count = (BANDS_PER_OCTAVE * (highest_hz / lowest_hz).log2()).floor() as usize + 1;
        let centres_hz: Vec<f64> =
            (0..count).map(|band| lowest_hz * (band as f64 / BANDS_PER_OCTAVE).exp2()).collect();
        let reach = REACH / CENTRE_RAD;
        let (from, to) = (lowest_hz * (1.0 - reach), highest_hz * (1.0 + reach));
        let lines = (LINES_PER_OCTAVE * (to / from).log2()).ceil() as usize + 1;
        let lines_hz: Vec<f64> =
            (0..lines).map(|line| from * (line as f64 / LINES_PER_OCTAVE).exp2()).collect();
        let weights = centres_hz.iter().map(|&centre| weights(&lines_hz, centre)).collect();
        Self { centres_hz, lines_hz, weights }
    }

    /// Centres of the bands in Hz.
    pub fn centres_hz(&self) -> &[f64] {
        &self.centres_hz
    }

    /// Number of bands.
    pub fn count(&self) -> usize {
        self.centres_hz.len()
    }

    /// Frequencies in Hz of the spectral lines.
    pub fn lines_hz(&self) -> &[f64] {
        &self.lines_hz
    }

    /// Lines of a band and their weights in Hz: the power of the analytic signal in the band is the
    /// weighted sum of the one-sided power spectral density.
    pub fn weights(&self, band: usize) -> &[(usize, f64)] {
        &self.weights[band]
    }
}

/// Gain of a band's wavelet at a frequency, one at its centre.
pub(crate) fn gain(centre_hz: f64, frequency_hz: f64) -> f64 {
    let distance = CENTRE_RAD * (frequency_hz / centre_hz - 1.0);
    (-0.5 * distance * distance).exp()
}

/// Density per Hz at a spectral line of a tone with power one. The two lines beside the tone share it.
pub(crate) fn tone_density(line_hz: f64, tone_hz: f64) -> f64 {
    let step = std::f64::consts::LN_2 / LINES_PER_OCTAVE;
    let lines_apart = ((line_hz / tone_hz).ln() / step).abs();
    (1.0 - lines_apart).max(0.0) / (step * line_hz)
}

fn weights(lines_hz: &[f64], centre_hz: f64) -> Vec<(usize, f64)> {
    // Lines have equal steps of the logarithm.
    let width = |line_hz: f64| line_hz * std::f64::consts::LN_2 / LINES_PER_OCTAVE;
    let weight = |line_hz: f64| 2.0 * gain(centre_hz, line_hz).powi(2) * width(line_hz);
    let reach = REACH / CENTRE_RAD * centre_hz;
    let near = |line: &(usize, &f64)| (line.1 - centre_hz).abs() <= reach;
    lines_hz.iter().enumerate().filter(near).map(|(line, &hz)| (line, weight(hz))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_collects_twice_the_density_times_the_wavelets_bandwidth() {
        let bands = Bands::new(100.0, 4000.0);
        for (band, centre) in bands.centres_hz().iter().enumerate() {
            let sum: f64 = bands.weights(band).iter().map(|&(_, weight)| weight).sum();
            // The integral of exp(-36 (f / f_k - 1)^2) is f_k sqrt(pi) / 6.
            let expected = 2.0 * centre * std::f64::consts::PI.sqrt() / CENTRE_RAD;
            assert!((sum / expected - 1.0).abs() < 2e-3, "{centre}: {}", sum / expected);
        }
    }

    #[test]
    fn a_tone_has_the_gain_of_its_band() {
        let bands = Bands::new(100.0, 4000.0);
        let (tone_hz, centre_hz) = (417.0, bands.centres_hz()[12]);
        let line =
            |&(line, weight): &(usize, f64)| weight * tone_density(bands.lines_hz()[line], tone_hz);
        let power: f64 = bands.weights(12).iter().map(line).sum();
        let expected = 2.0 * gain(centre_hz, tone_hz).powi(2);
        // Lines stand 2 % apart, a seventh of the wavelet's width.
        assert!((power / expected - 1.0).abs() < 0.02, "{power}, {expected}");
    }
}
