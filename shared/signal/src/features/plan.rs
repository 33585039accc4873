//! Plan for the computation of the voices of a stretch. It depends only on lengths and sample rate.
//!
//! A voice of high frequency depends on a short stretch around the window. A voice of low frequency has a
//! small bandwidth. The plan therefore processes the voices by octave. For each octave, it uses a circular
//! buffer that is just long enough for the lowest voice. It computes one Fourier transform of the signal per
//! octave, and one inverse transform per voice at the required instants only. The number of instants gives
//! the length of the inverse transform. Higher frequencies alias onto lower ones; the values at the instants
//! are still exact.

use super::{FeatureDefinition, stretch::Stretch};
use crate::wavelet::Morlet;
use num_complex::Complex64;
use std::{f64::consts::TAU, ops::Range, sync::Arc};
use tracktwin_fourier::{Fft, RealToComplex};

/// Distance, in standard deviations of the wavelet, up to which voices contribute to a bin. Farther
/// voices contain less than 0.2 % of a tone.
pub(super) const VOICE_REACH: f64 = 3.0;

/// Truncation of a wavelet in its standard deviations. The weight beyond is 4e-6.
const REACH: f64 = 5.0;

/// Half the band of a voice around its centre, in rad: beyond, the wavelet is below 5e-9.
const HALF_BAND: f64 = 6.2;

/// Instants are a whole number of these parts of a sample apart.
const PARTS_OF_A_SAMPLE: usize = 16;

/// Windows are planned in steps of this many instants, so that passes at one speed share a plan.
const INSTANTS_STEP: usize = 32;

/// Instants of a window: where they lie, in samples from the window's start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Instants {
    /// Distance of two instants, in sixteenths of a sample.
    parts: usize,
    /// How many there are.
    pub(super) count: usize,
}

impl Instants {
    /// The instants of a window of `samples` samples, at about `rate_hz` per second.
    pub(super) fn new(samples: usize, sample_rate_hz: f64, rate_hz: f64) -> Self {
        let parts = PARTS_OF_A_SAMPLE as f64 * sample_rate_hz / rate_hz;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
        let parts = (parts.round() as usize).max(1);
        Self { parts, count: (samples * PARTS_OF_A_SAMPLE).div_ceil(parts) }
    }

    /// The instants of the longest window that shares the plan.
    pub(super) const fn planned(self) -> Self {
        Self { parts: self.parts, count: self.count.next_multiple_of(INSTANTS_STEP) }
    }

    /// Every `2^halvings`-th instant.
    const fn halved(self, halvings: u32) -> Self {
        Self { parts: self.parts << halvings, count: self.count.div_ceil(1 << halvings) }
    }

    /// Interval of two instants in s.
    pub(super) fn interval_s(self, sample_rate_hz: f64) -> f64 {
        self.parts as f64 / PARTS_OF_A_SAMPLE as f64 / sample_rate_hz
    }

    /// Numbers of instants and samples of the shortest circular buffer that holds the window and
    /// `samples` further samples, with a length suitable for a fast transform.
    fn circle(self, samples: usize) -> (usize, usize) {
        let needed = self.count + (samples * PARTS_OF_A_SAMPLE).div_ceil(self.parts);
        let instants = quick_length(needed.div_ceil(PARTS_OF_A_SAMPLE)) * PARTS_OF_A_SAMPLE;
        (instants, instants / PARTS_OF_A_SAMPLE * self.parts)
    }
}

/// The smallest product of twos and threes that is not below `length`.
fn quick_length(length: usize) -> usize {
    // 3^30 samples are more than anybody has.
    (0..=30)
        .map(|threes| 3_usize.pow(threes))
        .take_while(|&odd| odd < 3 * length)
        .map(|odd| odd * length.div_ceil(odd).next_power_of_two())
        .min()
        .unwrap_or(length)
}

/// All voices of a window, in octaves.
pub(super) struct Plan {
    octaves: Vec<Octave>,
}

/// Voices that share a circle: an octave of them, or less where the instants are halved within it.
struct Octave {
    /// How often the instants are halved.
    halvings: u32,
    /// Samples of margin on either side.
    margin: usize,
    samples: usize,
    instants: usize,
    /// Distance of two lines of the spectrum in Hz.
    line_hz: f64,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn Fft<f64>>,
    voices: Vec<Voice>,
}

/// The lines of the spectrum that a voice takes, and their weights: the wavelet, times all
/// constant factors.
struct Voice {
    first_line: usize,
    weights: Vec<f64>,
}

/// Buffers that outlive a call.
#[derive(Default)]
pub(super) struct Buffers {
    circle: Vec<f64>,
    spectrum: Vec<Complex64>,
    voices: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl Plan {
    /// The plan for the voices at these descending frequencies in Hz.
    pub(super) fn new(
        definition: &FeatureDefinition,
        voices_hz: &[f64],
        sample_rate_hz: f64,
        instants: Instants,
    ) -> Self {
        let octaves = voices_hz
            .chunk_by(|a, b| halvings(definition, *a) == halvings(definition, *b))
            .flat_map(|alike| alike.chunks(definition.voices_per_octave as usize))
            .map(|voices_hz| Octave::new(definition, voices_hz, sample_rate_hz, instants))
            .collect();
        Self { octaves }
    }

    /// Passes every voice to `take`, from the highest frequency to the lowest. The arguments are the
    /// number of halvings of the instants, the values at the instants (from the start of the window, and
    /// more of them than the window has), and the values with each frequency weighted by itself in Hz.
    ///
    /// The sum of the values over all voices is the analytic signal.
    pub(super) fn run(
        &self,
        stretch: &Stretch,
        buffers: &mut Buffers,
        mut take: impl FnMut(u32, &[Complex64], &[Complex64]),
    ) {
        for octave in &self.octaves {
            octave.transform(stretch, buffers);
            for voice in &octave.voices {
                octave.voice(voice, buffers);
                let (values, weighted) = buffers.voices.split_at(octave.instants);
                take(octave.halvings, values, weighted);
            }
        }
    }
}

/// Number of halvings of the instants of a voice: at most that of any bin to which the voice
/// contributes.
fn halvings(definition: &FeatureDefinition, voice_hz: f64) -> u32 {
    let centre = definition.wavelet_centre_rad;
    definition.halvings(voice_hz * (centre + VOICE_REACH) / centre)
}

impl Octave {
    fn new(
        definition: &FeatureDefinition,
        voices_hz: &[f64],
        sample_rate_hz: f64,
        instants: Instants,
    ) -> Self {
        let wavelet = definition.wavelet();
        let halvings = halvings(definition, voices_hz[0]);
        let lowest_hz = voices_hz.iter().copied().fold(f64::INFINITY, f64::min);
        let reach = in_samples(REACH * wavelet.scale(lowest_hz), sample_rate_hz);
        let margin = in_samples(definition.margin_s, sample_rate_hz).min(reach);
        // Going round the circle from the window, the other margin begins beyond the reach.
        let (instants, samples) = instants.halved(halvings).circle(margin + reach);
        let line_hz = sample_rate_hz / samples as f64;
        let factor = wavelet.share_of_a_voice(definition.voices_per_octave) / samples as f64;
        let voices = voices_hz
            .iter()
            .map(|&voice_hz| Voice::new(wavelet, voice_hz, line_hz, samples / 2, factor))
            .collect();
        Self {
            halvings,
            margin,
            samples,
            instants,
            line_hz,
            forward: tracktwin_fourier::real_forward(samples),
            inverse: tracktwin_fourier::inverse(instants),
            voices,
        }
    }

    /// The spectrum of the stretch on this circle.
    fn transform(&self, stretch: &Stretch, buffers: &mut Buffers) {
        let Buffers { circle, spectrum, voices, scratch } = buffers;
        circle.clear();
        circle.resize(self.samples, 0.0);
        stretch.unroll(self.margin, circle);
        spectrum.resize(self.samples / 2 + 1, Complex64::ZERO);
        voices.resize(2 * self.instants, Complex64::ZERO);
        let needed = self.forward.get_scratch_len().max(self.inverse.get_inplace_scratch_len());
        scratch.resize(needed, Complex64::ZERO);
        self.forward
            .process_with_scratch(circle, spectrum, scratch)
            .expect("the buffers have the lengths of the plan");
    }

    /// A voice and its weighted twin, one after the other.
    fn voice(&self, voice: &Voice, buffers: &mut Buffers) {
        let Buffers { spectrum, voices, scratch, .. } = buffers;
        voices.fill(Complex64::ZERO);
        let (values, weighted) = voices.split_at_mut(self.instants);
        let lines = spectrum[voice.first_line..].iter().zip(&voice.weights);
        for (line, (value, weight)) in (voice.first_line..).zip(lines) {
            let value = value * weight;
            let folded = line % self.instants;
            values[folded] += value;
            weighted[folded] += value * (line as f64 * self.line_hz);
        }
        self.inverse.process_with_scratch(voices, scratch);
    }
}

impl Voice {
    fn new(wavelet: Morlet, voice_hz: f64, line_hz: f64, nyquist_line: usize, factor: f64) -> Self {
        let scale = wavelet.scale(voice_hz);
        let rad_per_line = TAU * scale * line_hz;
        let lines = band(wavelet, rad_per_line, nyquist_line);
        Self {
            first_line: lines.start,
            weights: lines.map(|k| factor * wavelet.fourier(k as f64 * rad_per_line)).collect(),
        }
    }
}

/// Lines of the spectrum within a voice's band, the zero frequency left out.
fn band(wavelet: Morlet, rad_per_line: f64, nyquist_line: usize) -> Range<usize> {
    let line = |w: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let line = (w / rad_per_line).clamp(0.0, nyquist_line as f64) as usize;
        line + 1
    };
    let (first, last) =
        (line(wavelet.centre_rad() - HALF_BAND), line(wavelet.centre_rad() + HALF_BAND));
    first..last.min(nyquist_line + 1)
}

/// A positive duration in whole samples, rounded up.
pub(super) fn in_samples(seconds: f64, sample_rate_hz: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
    let samples = (seconds * sample_rate_hz - 1e-6).ceil() as usize;
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_length_is_made_of_twos_and_threes() {
        assert_eq!([1, 5, 7, 10, 17, 25, 65].map(quick_length), [1, 6, 8, 12, 18, 27, 72]);
    }

    #[test]
    fn instants_lie_a_quarter_of_100_khz_apart() {
        let instants = Instants::new(3462, 100_000.0, 25_000.0);
        assert_eq!(instants.count, 866);
        assert!((instants.interval_s(100_000.0) - 4e-5).abs() < 1e-18);
        let (count, samples) = instants.circle(6000);
        assert_eq!(samples, 4 * count);
        assert!(samples >= 9462);
    }

    #[test]
    fn instants_at_an_odd_rate_still_divide_the_circle_evenly() {
        let instants = Instants::new(1000, 44_100.0, 25_000.0);
        let (count, samples) = instants.circle(500);
        let interval = count as f64 * instants.interval_s(44_100.0);
        assert!((interval - samples as f64 / 44_100.0).abs() < 1e-12);
    }
}
