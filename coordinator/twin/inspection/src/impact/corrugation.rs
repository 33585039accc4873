//! Corrugation: a line with the same wavelength at every speed, on a stretch of rail.

use crate::along::{
    Background, Line, Ruler, Spectrum, Surface, amplitude, bonferroni, by_speed,
    combine_dependent_p_values, median, on_even_places, separate_wavelengths, whitened,
};
use num_complex::Complex64;
use tracktwin_signal::recording::{Pass, Recording};

/// Shortest and longest tested wavelength, in sleeper spacings: 2 mm to 62 mm for a spacing of 125 mm.
const WAVELENGTHS: [f64; 2] = [0.016, 0.5];
/// Lengths of the tested stretches, in sleeper spacings.
const STRETCHES: [f64; 3] = [4.0, 8.0, 16.0];
/// Lowest frequency in Hz, and highest frequency as a share of the sample rate.
const LOW_HZ: f64 = 60.0;
const HIGH_SHARE: f64 = 0.4;
/// Smallest ratio of power to noise floor at which a wave can be distinguished from sensor noise.
const AUDIBLE: f64 = 3.0;
/// Limit of the magnitude of a whitened signal, because a repeated impact has lines too.
const HOLD: f64 = 2.5;
/// A line is present at a speed if its probability by chance is below this.
const EACH_SPEED: f64 = 0.05;
/// Number of harmonics of the sleeper-passing frequency that do not count as corrugation, and the distance
/// from them in resolution cells.
const SLEEPER_HARMONICS: f64 = 16.0;
const CELLS_APART: f64 = 2.0;
/// Smallest number of waves on a stretch. With fewer waves the 18 cells of neighbours exceed two fifths of
/// the wave number, and resonances of the track affect the ratio.
const WAVES_MIN: f64 = 45.0;

/// Relative standard deviation of an odometer's scale.
const SCALE_DEVIATION: f64 = 2e-3;

/// A corrugated stretch of rail.
#[derive(Clone, Debug, PartialEq)]
pub struct Corrugation {
    /// Wavelength in m and its standard deviation.
    pub wavelength_m: (f64, f64),
    /// Amplitude in m and its standard deviation on the usual surface of the track; proportional to
    /// the square root of its irregularity level.
    pub amplitude_m: (f64, f64),
    /// First and last position in m.
    pub stretch_m: [f64; 2],
    /// Natural logarithm of the probability of such a line anywhere on a rail without corrugation.
    pub ln_p: f64,
    /// Power of the line relative to its neighbours, on its stretch.
    pub ratio: f64,
}

/// A candidate line with its stretch and probability.
struct Candidate {
    stretch_m: [f64; 2],
    wave_number: f64,
    ln_p: f64,
    ratio: f64,
    ruler: Ruler,
}

/// Detects corrugation with a false-alarm rate of `alpha`, and returns the most significant one.
///
/// `None` if the speeds are too similar ([`separate_wavelengths`]), because a resonance then looks like a
/// wave. `orders_m` is the circumference in m of a wheel whose orders do not count as corrugation.
pub fn corrugation(
    recording: &Recording,
    alpha: f64,
    orders_m: Option<f64>,
) -> Option<Corrugation> {
    if !separate_wavelengths(&recording.speeds_km_h()) {
        return None;
    }
    let [shortest, longest] = WAVELENGTHS.map(|share| share * recording.spacing_m);
    let whitened: Vec<(Vec<Complex64>, [f64; 2])> = recording
        .passes
        .iter()
        .map(|pass| held(pass, [1.0 / longest, 1.0 / shortest]))
        .collect::<Option<_>>()?;
    let search = CorrugationSearch {
        recording,
        whitened: &whitened,
        orders_m,
        lengths: [shortest, longest],
    };
    let mut candidates = Vec::new();
    let mut tries = 0;
    for ruler in Ruler::BOTH {
        for stretch_m in search.stretches() {
            let (best, bins) = search.best_line(stretch_m, ruler);
            tries += bins;
            candidates.extend(best);
        }
    }
    let best = candidates.into_iter().min_by(|a, b| a.ln_p.total_cmp(&b.ln_p))?;
    let ln_p = bonferroni(best.ln_p, tries);
    (ln_p <= alpha.ln()).then(|| search.describe(&best, ln_p))
}

/// The whitened pass with limited magnitude, and its usable wave numbers `[lowest, highest]` in cycles/m.
fn held(pass: &Pass, [low, high]: [f64; 2]) -> Option<(Vec<Complex64>, [f64; 2])> {
    let background = Background::of(&pass.signal)?;
    let speed = pass.mean_speed_m_s();
    let audible = background.audible_hz(AUDIBLE);
    let top = (high * speed).min(HIGH_SHARE * pass.signal.sample_rate_hz()).min(audible);
    let band = [(low * speed).max(LOW_HZ), top];
    if band[1] < 2.0 * band[0] {
        return None;
    }
    // Lines at the ends of the band need neighbours beyond them.
    let mut values = whitened(&pass.signal, &background, [0.5 * band[0], 1.2 * band[1]]);
    for value in &mut values {
        let magnitude = value.norm();
        if magnitude > HOLD {
            *value *= HOLD / magnitude;
        }
    }
    Some((values, band.map(|frequency| frequency / speed)))
}

/// Data of a search for corrugation.
struct CorrugationSearch<'a> {
    recording: &'a Recording,
    whitened: &'a [(Vec<Complex64>, [f64; 2])],
    orders_m: Option<f64>,
    /// Shortest and longest wave in m.
    lengths: [f64; 2],
}

impl CorrugationSearch<'_> {
    /// Stretches of all lengths that overlap by half, inside every pass.
    fn stretches(&self) -> Vec<[f64; 2]> {
        let passes = &self.recording.passes;
        let from = passes.iter().map(|pass| pass.position_m[0]).fold(f64::MIN, f64::max);
        let ends = passes.iter().map(|pass| pass.position_m[pass.position_m.len() - 1]);
        let to = ends.fold(f64::MAX, f64::min);
        let mut all = Vec::new();
        for length in STRETCHES.map(|spans| spans * self.recording.spacing_m) {
            let mut start = from;
            while start + length <= to {
                all.push([start, start + length]);
                start += 0.5 * length;
            }
        }
        all
    }

    /// Lowest and highest wave number in cycles/m that is usable in every pass.
    fn band(&self) -> [f64; 2] {
        let ends = self.whitened.iter().map(|(_, band)| *band);
        ends.fold([1.0 / self.lengths[1], 1.0 / self.lengths[0]], |all, one| {
            [all[0].max(one[0]), all[1].min(one[1])]
        })
    }

    fn spectrum(&self, pass: usize, stretch_m: [f64; 2], ruler: Ruler) -> Spectrum {
        let length = stretch_m[1] - stretch_m[0];
        // Four points on the shortest wave.
        let points = (4.0 * length / self.lengths[0]).ceil() as usize;
        let pass_values = &self.whitened[pass].0;
        let pass = &self.recording.passes[pass];
        let values = on_even_places(pass, pass_values, stretch_m, points, ruler);
        Spectrum::new(&values, length / points as f64)
    }

    /// Whether the wave number is a harmonic of the sleeper spacing or of the wheel.
    fn is_known(&self, wave_number: f64, cell: f64) -> bool {
        let near = |period: f64, harmonics: f64| {
            let order = wave_number * period;
            let nearest = order.round();
            nearest >= 1.0
                && nearest <= harmonics
                && (order - nearest).abs() < CELLS_APART * cell * period
        };
        near(self.recording.spacing_m, SLEEPER_HARMONICS)
            || self.orders_m.is_some_and(|circumference| near(circumference, f64::INFINITY))
    }

    /// The least probable line of a stretch, and the number of tested bins.
    fn best_line(&self, stretch_m: [f64; 2], ruler: Ruler) -> (Option<Candidate>, usize) {
        let cell = 1.0 / (stretch_m[1] - stretch_m[0]);
        let speeds: Vec<Vec<Spectrum>> = by_speed(&self.recording.passes)
            .into_iter()
            .map(|group| group.into_iter().map(|p| self.spectrum(p, stretch_m, ruler)).collect())
            .collect();
        let [low, high] = self.band();
        let low = low.max(WAVES_MIN * cell);
        let mut best: Option<Candidate> = None;
        let mut looked_at = 0;
        for bin in speeds[0][0].bin(low) + 1..speeds[0][0].bin(high) {
            let wave_number = bin as f64 * speeds[0][0].bin_width();
            if self.is_known(wave_number, cell) {
                continue;
            }
            let skip = |other: f64| self.is_known(other, cell);
            let lines: Option<Vec<Line>> = speeds
                .iter()
                .map(|passes| {
                    let each: Option<Vec<Line>> =
                        passes.iter().map(|spectrum| spectrum.line(bin, skip)).collect();
                    Line::mean(&each?)
                })
                .collect();
            let Some(lines) = lines else { continue };
            looked_at += 1;
            let each: Vec<f64> = lines.iter().map(|line| line.ln_tail()).collect();
            if each.iter().any(|&ln_p| ln_p > EACH_SPEED.ln()) {
                continue;
            }
            let ln_p = combine_dependent_p_values(&each);
            if best.as_ref().is_none_or(|best| ln_p < best.ln_p) {
                let ratio = lines.iter().map(|line| line.ratio).sum::<f64>() / lines.len() as f64;
                best = Some(Candidate { stretch_m, wave_number, ln_p, ratio, ruler });
            }
        }
        (best, looked_at)
    }

    fn describe(&self, best: &Candidate, ln_p: f64) -> Corrugation {
        let extent = self.extent(best);
        // The amplitude is that of the stretch itself, not of one that reaches beyond it.
        let length = extent[1] - extent[0];
        let surface = Surface::of(self.recording);
        let density = surface.density_m3(best.wave_number);
        let amplitude = amplitude(self.ratio(extent, best), density, length);
        let wavelength = 1.0 / best.wave_number;
        // A strong line's place is known to a fraction of a cell; the bins are half a cell apart.
        let deviation = 0.25 / (best.stretch_m[1] - best.stretch_m[0]) * wavelength * wavelength;
        let relative = surface.height_deviation.hypot(0.15);
        Corrugation {
            wavelength_m: (wavelength, deviation.hypot(SCALE_DEVIATION * wavelength)),
            amplitude_m: (amplitude, relative * amplitude),
            stretch_m: extent,
            ln_p,
            ratio: best.ratio,
        }
    }

    /// Power of the candidate's line relative to its neighbours on a stretch, as mean of all passes.
    fn ratio(&self, stretch_m: [f64; 2], best: &Candidate) -> f64 {
        let at = |pass| {
            let spectrum = self.spectrum(pass, stretch_m, best.ruler);
            let line = spectrum.line(spectrum.bin(best.wave_number), |_| false);
            line.map_or(0.0, |line| line.ratio)
        };
        let passes = 0..self.recording.passes.len();
        let count = passes.len() as f64;
        passes.map(at).sum::<f64>() / count
    }

    /// Stretch `[from, to]` in m on which the line has at least half of its greatest amplitude.
    fn extent(&self, best: &Candidate) -> [f64; 2] {
        let half = 0.5 * STRETCHES[0] * self.recording.spacing_m;
        let [from, to] =
            self.stretches().into_iter().fold([f64::MAX, f64::MIN], |ends, stretch| {
                [ends[0].min(stretch[0]), ends[1].max(stretch[1])]
            });
        let step = 0.25 * self.recording.spacing_m;
        let count = ((to - from - 2.0 * half) / step).max(0.0) as usize + 1;
        let middles: Vec<f64> = (0..count).map(|i| from + half + i as f64 * step).collect();
        let level = |&middle: &f64| self.ratio([middle - half, middle + half], best);
        let levels: Vec<f64> = middles.iter().map(level).collect();
        let greatest = levels.iter().copied().fold(0.0, f64::max);
        let inside = levels.iter().copied().filter(|level| *level >= 0.25 * greatest);
        // Half the amplitude under a window that is half inside: the stretch's end is its middle.
        let full = median(inside.collect());
        let loud = |level: &f64| *level >= 0.25 * full;
        let first = levels.iter().position(loud).unwrap_or(0);
        let last = levels.iter().rposition(loud).unwrap_or(count - 1);
        let extent = [middles[first], middles[last]];
        // A single loud window does not show the length.
        if extent[1] - extent[0] < half { best.stretch_m } else { extent }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::{Rolled, noise};
    use std::f64::consts::TAU;

    #[test]
    fn waves_in_a_single_loud_window_have_the_stretch_that_was_looked_at() {
        let recording = Rolled::faultless(1).recording();
        let wave_number = 100.0;
        // Blows at both ends of the window around 1.5 m drown the waves in all the others.
        let value = |(x, noise): (&f64, f64)| {
            let blow = (x - 1.25).abs().min((x - 1.75).abs()) < 1e-4;
            let waves = if (1.25..1.75).contains(x) { (TAU * wave_number * x).cos() } else { 0.0 };
            Complex64::from(0.1 * noise + waves + if blow { 1e4 } else { 0.0 })
        };
        let of_pass = |pass: &Pass| {
            let noise = noise(2, pass.position_m.len());
            (pass.position_m.iter().zip(noise).map(value).collect(), [16.0, 500.0])
        };
        let whitened: Vec<_> = recording.passes.iter().map(of_pass).collect();
        let search = CorrugationSearch {
            recording: &recording,
            whitened: &whitened,
            orders_m: None,
            lengths: [2e-3, 62e-3],
        };
        let (stretch_m, ruler) = ([1.0, 2.0], Ruler::Odometer);
        let found = Candidate { stretch_m, wave_number, ln_p: -20.0, ratio: 10.0, ruler };
        assert_eq!(search.describe(&found, -20.0).stretch_m, stretch_m);
    }
}
