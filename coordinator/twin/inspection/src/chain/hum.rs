//! Mains hum: lines with the same frequency at all speeds, narrower than any structural resonance.

use crate::along::{Line, Spectrum, bonferroni, by_speed, ln_gamma_tail, speed_m_s};
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording};

/// Mains frequencies in Hz and number of tested harmonics: railways of central Europe (the third harmonic
/// equals the next entry), mains of Europe, mains of America.
const MAINS_HZ: [(f64, usize); 3] = [(50.0 / 3.0, 2), (50.0, 6), (60.0, 6)];
/// Duration of a segment in s; over a longer time the mains frequency is not constant.
const SEGMENT_S: f64 = 4.0;
/// Largest deviation of the mains from the nominal frequency in Hz.
const DRIFT_HZ: f64 = 0.1;
/// A line is detected at a speed if its probability by chance is below this.
const EACH_SPEED: f64 = 0.05;
/// Number of speeds at which a line must be detected, if there are that many; at other speeds it may be
/// hidden.
const SPEEDS_MIN: usize = 2;
/// Largest ratio of a line's amplitudes at two speeds: the mains do not depend on the speed of the train.
const APART_MAX: f64 = 2.0;
/// Smallest number of segments whose mean follows a gamma distribution well enough.
const SEGMENTS_MIN: usize = 4;
/// Smallest number of waves in a segment; below it a line has no neighbours on its lower side.
const WAVES_MIN: f64 = 10.0;
/// Distance of the nearer neighbours in resolution cells, relative to which a line must be significant too.
/// The flanks of a lightly damped resonance are no background.
const NEAR: f64 = 6.0;
/// A line within this number of resolution cells of a sleeper or wheel harmonic may belong to it.
const CELLS_APART: f64 = 1.5;

/// A line at a mains frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Hum {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Amplitude in m/s2, as mean of all passes, and its standard deviation.
    pub amplitude_m_s2: (f64, f64),
    /// Power relative to the neighbours, as mean of all speeds.
    pub ratio: f64,
    /// Natural logarithm of the probability of such a line at any mains frequency without hum.
    pub ln_p: f64,
}

/// Detects lines at mains frequencies, with a false-alarm rate of `alpha`; the most significant line comes
/// first.
///
/// `turn_m` is the circumference in m of a wheel with a flat, if there is one: its blows have their own
/// lines.
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

/// The recording without these lines. In every pass, or every segment of a long one, the tone that fits best within
/// the drift of the mains is subtracted.
pub fn without_hum(recording: &Recording, lines: &[Hum]) -> Recording {
    let mut cleared = recording.clone();
    for pass in &mut cleared.passes {
        let rate_hz = pass.signal.sample_rate_hz();
        let segments = ((pass.signal.duration_s() / SEGMENT_S) as usize).max(1);
        let mut samples = pass.signal.samples().to_vec();
        let length = samples.len().div_ceil(segments);
        for part in samples.chunks_mut(length) {
            for line in lines {
                subtract_tone(part, line.frequency_hz, rate_hz);
            }
        }
        if let Ok(signal) = Signal::new(rate_hz, samples) {
            pass.signal = signal;
        }
    }
    cleared
}

/// Subtracts the strongest tone within the drift of the mains from `samples`.
fn subtract_tone(samples: &mut [f64], frequency_hz: f64, rate_hz: f64) {
    let turns = |frequency: f64| {
        let step = Complex64::from_polar(1.0, TAU * frequency / rate_hz);
        std::iter::successors(Some(Complex64::ONE), move |turn| Some(turn * step))
    };
    let fitted = |frequency: f64| {
        let pairs = samples.iter().zip(turns(frequency));
        let sum: Complex64 = pairs.map(|(sample, turn)| turn.conj() * sample).sum();
        (frequency, 2.0 * sum / samples.len() as f64)
    };
    // A quarter of the resolution.
    let step_hz = 0.25 * rate_hz / samples.len() as f64;
    let reach = (DRIFT_HZ * frequency_hz / 50.0 / step_hz) as i32;
    let tones = (-reach..=reach).map(|step| fitted(frequency_hz + f64::from(step) * step_hz));
    let best = tones.max_by(|a, b| a.1.norm_sqr().total_cmp(&b.1.norm_sqr()));
    let Some((frequency, tone)) = best else { return };
    for (sample, turn) in samples.iter_mut().zip(turns(frequency)) {
        *sample -= (tone * turn).re;
    }
}

/// The line nearest to a mains frequency, and the number of tested bins.
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

/// Combines the probabilities of all speeds (Fisher). They are independent, because a fixed frequency
/// corresponds to a different wavelength at each speed.
fn of_all(ln_probabilities: &[f64]) -> f64 {
    let count = ln_probabilities.len() as f64;
    ln_gamma_tail(count, -ln_probabilities.iter().sum::<f64>() / count)
}

/// Whether the amplitudes may belong to one line.
fn are_alike(amplitudes: &[f64]) -> bool {
    let [least, most] =
        amplitudes.iter().fold([f64::MAX, 0.0], |[l, m]: [f64; 2], &a| [l.min(a), m.max(a)]);
    most <= APART_MAX * least
}

/// Spectra of the segments of a pass.
struct PassSpectra {
    spectra: Vec<Spectrum>,
    duration_s: f64,
    speed_m_s: f64,
    rate_hz: f64,
}

/// Line in one pass.
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

    /// Whether the frequency may belong to an effect with this period in m.
    fn may_be_of(&self, frequency: f64, length_m: f64) -> bool {
        let order = frequency * length_m / self.speed_m_s;
        let cell = length_m / self.speed_m_s / self.duration_s;
        order > 0.5 && (order - order.round()).abs() < CELLS_APART * cell
    }

    /// `None` if the segments are too short for the frequency or the sample rate is too low.
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
