//! Mains hum: lines with the same frequency at all speeds, narrower than any structural resonance.
//!
//! Two passes of one speed share the surface and the track but not the phase of the mains. So a line is searched in
//! their difference, too, where less is beside it.

use crate::along::{LOBE, Line, Spectrum, bonferroni, by_speed, index_at, ln_gamma_tail};
use num_complex::Complex64;
use std::f64::consts::TAU;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording};

/// Mains frequencies in Hz and number of tested harmonics: railways of central Europe (the third harmonic
/// equals the next entry), mains of Europe, mains of America.
const MAINS_HZ: [(f64, usize); 3] = [(50.0 / 3.0, 2), (50.0, 6), (60.0, 6)];
/// Duration of a segment in s; over a longer time the mains frequency is not constant.
const SEGMENT_S: f64 = 4.0;
/// Largest deviation of the mains from the nominal frequency in Hz.
pub(super) const DRIFT_HZ: f64 = 0.1;
/// A line is detected at a speed if its probability by chance is below this.
const EACH_SPEED: f64 = 0.05;
/// Number of speeds at which a line must be detected, if there are that many; at other speeds it may be
/// hidden.
const SPEEDS_MIN: usize = 2;
/// Largest ratio of a line's amplitudes at two speeds: the mains do not depend on the speed of the train.
const APART_MAX: f64 = 2.0;
/// Smallest number of segments whose mean follows a gamma distribution well enough.
const SEGMENTS_MIN: usize = 4;
/// Duration in s of a segment below which the neighbours lie farther from a line than a resonance is wide.
const SHORT_S: f64 = 0.8;
/// Half width in Hz of the narrowest resonance: the wheel of V-Track on its ballast, of damping ratio 0.016 at 120 Hz.
const RESONANCE_HZ: f64 = 1.9;
/// Smallest number of waves in a segment; below it a line has no neighbours on its lower side.
const WAVES_MIN: f64 = 10.0;
/// Distance of the nearer neighbours in resolution cells, relative to which a line must be significant too.
/// The flanks of a lightly damped resonance are no background.
const NEAR: f64 = 8.0;
/// Another speed has a line of the same wavelength if its probability by chance is below this.
const SAME_LENGTH: f64 = 0.01;
/// Smallest share of a pass that another one must cover to be compared with it.
const COVERED: f64 = 0.8;
/// A line within this number of resolution cells of a sleeper or wheel harmonic may belong to it.
pub(super) const CELLS_APART: f64 = 1.5;

/// A line at a mains frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Hum {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Amplitude in m/s2 and its standard deviation: mean of all passes, weighted by the inverse power beside the
    /// line. It is too large where the line is hardly above its neighbours.
    pub amplitude_m_s2: (f64, f64),
    /// Power relative to the neighbours, as mean of all speeds; in the passes or in their differences.
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
    let groups = by_speed(&recording.passes);
    // At a single speed an order of the wheel, which the differences contain, may be at a frequency of the mains.
    let compare = groups.len() > 1;
    let speeds: Vec<Speed> =
        groups.iter().map(|group| Speed::of(recording, group, compare)).collect();
    let mut found = Vec::new();
    let mut tries = 0;
    for mains_hz in mains_hz() {
        let (line, bins) = line(&speeds, &lengths_m, mains_hz);
        tries += bins;
        found.extend(line);
    }
    for line in &mut found {
        line.ln_p = bonferroni(line.ln_p, tries);
    }
    found.retain(|line: &Hum| line.ln_p <= alpha.ln());
    found.sort_by(|a, b| a.ln_p.total_cmp(&b.ln_p));
    found
}

/// All tested frequencies in Hz.
pub(crate) fn mains_hz() -> impl Iterator<Item = f64> {
    MAINS_HZ.into_iter().flat_map(|(mains_hz, harmonics)| {
        (1..=harmonics).map(move |harmonic| mains_hz * harmonic as f64)
    })
}

/// Number of segments of this number of samples.
pub(super) fn segments(samples: usize, rate_hz: f64) -> usize {
    ((samples as f64 / rate_hz / SEGMENT_S) as usize).max(1)
}

/// The recording without these lines. In every pass, or every segment of a long one, the tone that fits best within
/// the drift of the mains is subtracted.
pub fn without_hum(recording: &Recording, lines: &[Hum]) -> Recording {
    let mut cleared = recording.clone();
    for pass in &mut cleared.passes {
        let rate_hz = pass.signal.sample_rate_hz();
        let mut samples = pass.signal.samples().to_vec();
        let length = samples.len().div_ceil(segments(samples.len(), rate_hz));
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
fn line(speeds: &[Speed], lengths_m: &[f64], frequency: f64) -> (Option<Hum>, usize) {
    let lines: Option<Vec<_>> = speeds.iter().map(|speed| speed.line(frequency)).collect();
    let Some(lines) = lines else { return (None, 0) };
    let tries = lines.iter().map(|line| line.tries).fold(0, usize::max);
    // Where it may be the sleepers', the blows' or an order's of the wheel a line says nothing either way.
    let may_be_of = |speed: &Speed| {
        lengths_m.iter().any(|&it| speed.may_be_of(frequency, it))
            || speeds.iter().any(|other| speed.shares_length(other, frequency))
    };
    let own = speeds.iter().zip(&lines).filter(|(speed, _)| !may_be_of(speed));
    let own: Vec<&SpeedLine> = own.map(|(_, line)| line).collect();
    let detected = own.iter().filter(|line| line.ln_p <= EACH_SPEED.ln()).count();
    if own.is_empty() || detected < SPEEDS_MIN.min(own.len()) || !are_alike(&own) {
        return (None, tries);
    }
    let passes: Vec<&Tone> = lines.iter().flat_map(|line| &line.passes).collect();
    let each: Vec<f64> = own.iter().map(|line| line.ln_p).collect();
    let hum = Hum {
        frequency_hz: frequency,
        amplitude_m_s2: amplitude(&passes),
        ratio: lines.iter().map(|line| line.ratio).sum::<f64>() / lines.len() as f64,
        ln_p: of_all(&each),
    };
    (Some(hum), tries)
}

/// Mean amplitude and its standard deviation. The background adds to the line in every pass; passes count
/// by the inverse power of theirs.
fn amplitude(passes: &[&Tone]) -> (f64, f64) {
    let weights = || passes.iter().map(|tone| tone.ratio / tone.amplitude.powi(2));
    let mean_of = |of: &dyn Fn(&Tone) -> f64| {
        passes.iter().zip(weights()).map(|(tone, weight)| weight * of(tone)).sum::<f64>()
            / weights().sum::<f64>()
    };
    let mean = mean_of(&|tone| tone.amplitude);
    let square = mean_of(&|tone| (tone.amplitude - mean).powi(2));
    (mean, square.sqrt().max(0.05 * mean))
}

/// Combines the probabilities of all speeds (Fisher). They are independent, because a fixed frequency
/// corresponds to a different wavelength at each speed.
fn of_all(ln_probabilities: &[f64]) -> f64 {
    let count = ln_probabilities.len() as f64;
    ln_gamma_tail(count, -ln_probabilities.iter().sum::<f64>() / count)
}

/// Whether the lines of all speeds may be one.
fn are_alike(lines: &[&SpeedLine]) -> bool {
    let least = lines.iter().map(|line| line.amplitude[1]).fold(f64::MAX, f64::min);
    lines.iter().all(|line| line.amplitude[0] <= APART_MAX * least)
}

/// All passes of one speed.
struct Speed {
    passes: Vec<PassSpectra>,
    /// What each pass has beside the mean of the others at the same positions: the surface and the track
    /// cancel, the mains do not. Empty for a single pass or a single speed.
    differences: Vec<PassSpectra>,
}

/// Line at one speed.
struct SpeedLine {
    passes: Vec<Tone>,
    /// Mean ratio in the passes or in the differences, where the line is more significant.
    ratio: f64,
    /// Least and largest amplitude of the mains in m/s2.
    amplitude: [f64; 2],
    ln_p: f64,
    tries: usize,
}

impl Speed {
    fn of(recording: &Recording, group: &[usize], compare: bool) -> Self {
        let pass = |index: usize| &recording.passes[index];
        let own = |&index: &usize| PassSpectra::new(pass(index).signal.samples(), pass(index));
        let beside_others = |&index: &usize| {
            let others = group.iter().filter(|&&other| other != index).map(|&other| pass(other));
            difference(pass(index), others)
        };
        let compared = if compare { group } else { &[] };
        Self {
            passes: group.iter().map(own).collect(),
            differences: compared.iter().filter_map(beside_others).collect(),
        }
    }

    fn may_be_of(&self, frequency: f64, length_m: f64) -> bool {
        self.passes.iter().any(|pass| pass.may_be_of(frequency, length_m))
    }

    /// Whether another speed has a line of the same wavelength, which is then one of the wheel or the surface. A
    /// line that may be hum itself tells nothing.
    fn shares_length(&self, other: &Self, frequency: f64) -> bool {
        let [own_m_s, other_m_s] = [self, other].map(|speed| speed.passes[0].speed_m_s);
        let there_hz = frequency * other_m_s / own_m_s;
        let width_hz = CELLS_APART / other.passes[0].duration_s + DRIFT_HZ * there_hz / 50.0;
        own_m_s != other_m_s
            && mains_hz().all(|mains_hz| (mains_hz - there_hz).abs() > width_hz)
            && other.line(there_hz).is_some_and(|line| line.ln_p <= SAME_LENGTH.ln())
    }

    fn line(&self, frequency: f64) -> Option<SpeedLine> {
        let tones = |passes: &[PassSpectra]| -> Option<Vec<Tone>> {
            passes.iter().map(|pass| pass.line(frequency)).collect()
        };
        let passes = tones(&self.passes)?;
        let differences = tones(&self.differences).unwrap_or_default();
        let mean = |tones: &[Tone], of: fn(&Tone) -> f64| {
            tones.iter().map(of).sum::<f64>() / tones.len() as f64
        };
        let all = passes.iter().chain(&differences);
        let tries = all.map(|tone| tone.tries).fold(0, usize::max);
        let test = |tones: &[Tone]| (mean(tones, |tone| tone.ln_p), mean(tones, |tone| tone.ratio));
        let (ln_p, ratio) = test(&passes);
        let amplitude = [mean(&passes, |tone| tone.amplitude); 2];
        let mut line = SpeedLine { passes, ratio, amplitude, ln_p, tries };
        if differences.is_empty() {
            return Some(line);
        }
        let (ln_p, ratio) = test(&differences);
        if ln_p < line.ln_p {
            // Two equal tones differ by twice their amplitude at most. What the passes share adds to it.
            let least = 0.5 * mean(&differences, Tone::amplitude_without_background);
            let largest = line.passes.iter().map(|tone| tone.amplitude).fold(0.0, f64::max);
            (line.ln_p, line.ratio, line.amplitude) = (ln_p, ratio, [least, largest]);
        }
        line.ln_p = bonferroni(line.ln_p, 2);
        Some(line)
    }
}

/// What a pass has beside the mean of other passes at the same positions. `None` without another pass that covers
/// most of this one.
fn difference<'a>(pass: &Pass, others: impl Iterator<Item = &'a Pass>) -> Option<PassSpectra> {
    let own = &pass.position_m;
    let covered = |other: &Pass| {
        let places = &other.position_m;
        let from = own.partition_point(|&x| x < places[0]);
        from..own.partition_point(|&x| x <= places[places.len() - 1]).max(from)
    };
    let is_whole = |other: &&Pass| {
        other.position_m.len() > 1 && covered(other).len() as f64 >= COVERED * own.len() as f64
    };
    let others: Vec<&Pass> = others.filter(is_whole).collect();
    let common = others
        .iter()
        .copied()
        .map(covered)
        .reduce(|one, other| one.start.max(other.start)..one.end.min(other.end))?;
    let beside = |index: usize| {
        let there = others.iter().map(|other| value_at(other, own[index]));
        pass.signal.samples()[index] - there.sum::<f64>() / others.len() as f64
    };
    let samples: Vec<f64> = common.map(beside).collect();
    (!samples.is_empty()).then(|| PassSpectra::new(&samples, pass))
}

/// Linear interpolation of the samples at a position between the ends of the pass.
fn value_at(pass: &Pass, x_m: f64) -> f64 {
    let (samples, index) = (pass.signal.samples(), index_at(&pass.position_m, x_m));
    let low = (index as usize).min(samples.len() - 2);
    samples[low] + (index - low as f64) * (samples[low + 1] - samples[low])
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

impl Tone {
    fn amplitude_without_background(&self) -> f64 {
        self.amplitude * (1.0 - self.ratio.recip()).max(0.0).sqrt()
    }
}

impl PassSpectra {
    /// Spectra of samples of a pass, or of what it has beside others.
    fn new(samples: &[f64], pass: &Pass) -> Self {
        let rate_hz = pass.signal.sample_rate_hz();
        let length = samples.len() / segments(samples.len(), rate_hz);
        let spectrum = |part: &[f64]| {
            let mean = part.iter().sum::<f64>() / length as f64;
            let values: Vec<_> = part.iter().map(|value| Complex64::from(value - mean)).collect();
            Spectrum::new(&values, 1.0 / rate_hz)
        };
        Self {
            spectra: samples.chunks_exact(length).map(spectrum).collect(),
            duration_s: length as f64 / rate_hz,
            speed_m_s: pass.mean_speed_m_s(),
            rate_hz,
        }
    }

    /// Whether the frequency may belong to an effect with this period in m.
    fn may_be_of(&self, frequency: f64, length_m: f64) -> bool {
        let order = frequency * length_m / self.speed_m_s;
        let cell = length_m / self.speed_m_s / self.duration_s;
        order > 0.5 && (order - order.round()).abs() < CELLS_APART * cell
    }

    /// How far the power of the narrowest resonance rises above its neighbours, which are not its flanks in a short
    /// segment; one in a long segment.
    fn rise_of_resonance(&self) -> f64 {
        if self.duration_s >= SHORT_S {
            return 1.0;
        }
        let apart_hz = 0.5 * (LOBE + NEAR) / self.duration_s;
        1.0 + (apart_hz / RESONANCE_HZ).powi(2)
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
        let rise = self.rise_of_resonance();
        let tail = |line: Line| {
            let line = Line { ratio: line.ratio / rise, ..line };
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
