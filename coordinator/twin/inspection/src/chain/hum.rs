//! Mains hum: lines at a fixed frequency at all speeds, narrower than any structural resonance.

use crate::along::{Line, Spectrum, bonferroni, by_speed, ln_gamma_tail, speed_m_s};
use rustfft::num_complex::Complex64;
use tracktwin_signal::recording::{Pass, Recording};

/// Frequencies of electrical supplies in Hz and how many harmonics are looked for: railways of
/// central Europe (their third is the next one's first), the mains of Europe and of America.
const MAINS_HZ: [(f64, usize); 3] = [(50.0 / 3.0, 2), (50.0, 6), (60.0, 6)];
/// Duration in s of a segment: longer than this the mains' frequency is not steady.
const SEGMENT_S: f64 = 4.0;
/// How far in Hz the mains may be from their nominal frequency.
const DRIFT_HZ: f64 = 0.1;
/// Probability of one speed's line without hum above which it is not detected at that speed.
const EACH_SPEED: f64 = 0.05;
/// Number of speeds at which it must be detected, if there are that many; at others it may be
/// hidden.
const SPEEDS_MIN: usize = 2;
/// Greatest ratio of a line's amplitudes at two speeds: the mains do not know the train's.
const APART_MAX: f64 = 2.0;
/// Segments from which their mean follows a gamma distribution well enough.
const SEGMENTS_MIN: usize = 4;
/// Waves in a segment below which a line has no neighbours on its lower side.
const WAVES_MIN: f64 = 10.0;
/// Resolution cells on either side of a line up to which it must stand out as well: what a lightly
/// damped resonance has around its peak is no background.
const NEAR: f64 = 6.0;
/// Resolution cells within which a line may be the sleepers' or the blows'.
const CELLS_APART: f64 = 1.5;

/// A line of the mains.
#[derive(Clone, Debug, PartialEq)]
pub struct Hum {
    /// Its frequency in Hz.
    pub frequency_hz: f64,
    /// Its amplitude in m/s2, mean of all passes, and the standard deviation of that.
    pub amplitude_m_s2: (f64, f64),
    /// Power over its neighbours', mean of all speeds.
    pub ratio: f64,
    /// Probability of such a line at any mains frequency without hum, in logarithm.
    pub ln_p: f64,
}

/// The lines of the mains that are less likely than `alpha` without them, most certain first.
///
/// `turn_m` is the circumference in m of a wheel that strikes the rail once a turn, if it does: the
/// blows have lines of their own.
pub fn hum(recording: &Recording, turn_m: Option<f64>, alpha: f64) -> Vec<Hum> {
    let lengths_m: Vec<f64> = turn_m.into_iter().chain([recording.spacing_m]).collect();
    let spectra_of = |group: Vec<usize>| {
        group.into_iter().map(|index| PassSpectra::of(&recording.passes[index])).collect()
    };
    let speeds: Vec<Vec<PassSpectra>> =
        by_speed(&recording.passes).into_iter().map(spectra_of).collect();
    let mut found = Vec::new();
    let mut tries = 0;
    for (mains, harmonics) in MAINS_HZ {
        for harmonic in 1..=harmonics {
            let (line, bins) = line(&speeds, &lengths_m, mains * harmonic as f64);
            tries += bins;
            found.extend(line);
        }
    }
    for line in &mut found {
        line.ln_p = bonferroni(line.ln_p, tries);
    }
    found.retain(|line: &Hum| line.ln_p <= alpha.ln());
    found.sort_by(|a, b| a.ln_p.total_cmp(&b.ln_p));
    found
}

/// The line nearest to a mains frequency, and the number of bins examined.
fn line(speeds: &[Vec<PassSpectra>], lengths_m: &[f64], frequency: f64) -> (Option<Hum>, usize) {
    let mut tries = 0;
    let (mut each, mut ratios) = (Vec::new(), Vec::new());
    let (mut amplitudes, mut by_speed) = (Vec::new(), Vec::new());
    for passes in speeds {
        let lines: Option<Vec<Tone>> = passes.iter().map(|pass| pass.line(frequency)).collect();
        let Some(lines) = lines else { return (None, 0) };
        tries = lines.iter().map(|line| line.tries).fold(tries, usize::max);
        let mean = |of: fn(&Tone) -> f64| lines.iter().map(of).sum::<f64>() / lines.len() as f64;
        ratios.push(mean(|line| line.ratio));
        amplitudes.extend(lines.iter().map(|line| line.amplitude));
        // Where it may be the sleepers' or the blows' a line says nothing either way.
        let may_be_of =
            |&length_m: &f64| passes.iter().any(|pass| pass.may_be_of(frequency, length_m));
        if !lengths_m.iter().any(may_be_of) {
            each.push(mean(|line| line.ln_p));
            by_speed.push(mean(|line| line.amplitude));
        }
    }
    let detected = each.iter().filter(|ln_p| **ln_p <= EACH_SPEED.ln()).count();
    if each.is_empty() || detected < SPEEDS_MIN.min(each.len()) || !are_alike(&by_speed) {
        return (None, tries);
    }
    let count = amplitudes.len() as f64;
    let mean = amplitudes.iter().sum::<f64>() / count;
    let square = amplitudes.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / count;
    let hum = Hum {
        frequency_hz: frequency,
        amplitude_m_s2: (mean, square.sqrt().max(0.05 * mean)),
        ratio: ratios.iter().sum::<f64>() / ratios.len() as f64,
        ln_p: of_all(&each),
    };
    (Some(hum), tries)
}

/// One probability of all speeds' (Fisher): at one frequency each speed has another wavelength, so
/// they are independent.
fn of_all(ln_probabilities: &[f64]) -> f64 {
    let count = ln_probabilities.len() as f64;
    ln_gamma_tail(count, -ln_probabilities.iter().sum::<f64>() / count)
}

/// Whether amplitudes may be those of one line.
fn are_alike(amplitudes: &[f64]) -> bool {
    let [least, most] =
        amplitudes.iter().fold([f64::MAX, 0.0], |[l, m]: [f64; 2], &a| [l.min(a), m.max(a)]);
    most <= APART_MAX * least
}

/// The spectra of a pass's segments.
struct PassSpectra {
    spectra: Vec<Spectrum>,
    duration_s: f64,
    speed_m_s: f64,
    rate_hz: f64,
}

/// A line in one pass.
struct Tone {
    ratio: f64,
    amplitude: f64,
    ln_p: f64,
    tries: usize,
}

impl PassSpectra {
    fn of(pass: &Pass) -> Self {
        let (samples, rate_hz) = (pass.signal.samples(), pass.signal.sample_rate_hz());
        let segments = ((pass.signal.duration_s() / SEGMENT_S) as usize).max(1);
        let length = samples.len() / segments;
        let spectrum = |part: &[f64]| {
            let mean = part.iter().sum::<f64>() / length as f64;
            let values: Vec<_> = part.iter().map(|value| Complex64::from(value - mean)).collect();
            Spectrum::new(&values, 1.0 / rate_hz)
        };
        Self {
            spectra: samples.chunks_exact(length).map(spectrum).collect(),
            duration_s: length as f64 / rate_hz,
            speed_m_s: speed_m_s(pass),
            rate_hz,
        }
    }

    /// Whether it may be a line of what comes back after every such length.
    fn may_be_of(&self, frequency: f64, length_m: f64) -> bool {
        let order = frequency * length_m / self.speed_m_s;
        let cell = length_m / self.speed_m_s / self.duration_s;
        order > 0.5 && (order - order.round()).abs() < CELLS_APART * cell
    }

    /// None where the segments are too short for the frequency, or not sampled fast enough.
    fn line(&self, frequency: f64) -> Option<Tone> {
        if frequency > 0.4 * self.rate_hz || frequency * self.duration_s < WAVES_MIN {
            return None;
        }
        let reach = DRIFT_HZ * frequency / 50.0;
        let first = &self.spectra[0];
        let bins = first.bin(frequency - reach)..=first.bin(frequency + reach);
        let tries = bins.clone().count();
        let mean = |spectra: &[Spectrum], bin: usize| -> Option<Line> {
            let lines: Option<Vec<Line>> =
                spectra.iter().map(|spectrum| spectrum.line(bin, |_| false)).collect();
            Line::mean(&lines?)
        };
        let far = bins.filter_map(|bin| Some((bin, mean(&self.spectra, bin)?)));
        let (bin, best) = far.max_by(|a, b| a.1.ratio.total_cmp(&b.1.ratio))?;
        let segments = self.spectra.len();
        let tail = |line: Line| {
            if segments < SEGMENTS_MIN {
                line.ln_tail()
            } else {
                ln_gamma_tail(segments as f64, line.ratio)
            }
        };
        let near: Vec<Spectrum> =
            self.spectra.iter().map(|spectrum| spectrum.clone().reaching(NEAR)).collect();
        let ln_p = tail(best).max(tail(mean(&near, bin)?));
        let square = |spectrum: &Spectrum| spectrum.amplitude(bin).powi(2);
        let amplitude = (self.spectra.iter().map(square).sum::<f64>() / segments as f64).sqrt();
        Some(Tone { ratio: best.ratio, amplitude, ln_p, tries })
    }
}
