//! One block of a pass: its periodogram, and the power that combs explain.

use crate::along::{hann, median};
use crate::chain::mains_hz;
use num_complex::Complex64;
use tracktwin_signal::recording::Pass;

/// Number of bins per resolution cell.
pub(super) const PADDING: usize = 8;
/// Distance from a tooth, in resolution cells, within which bins belong to the tooth.
pub(super) const TOOTH_CELLS: f64 = 1.5;
/// Largest relative error of a speed: half a step of 1 km/h at 67 km/h.
const SPEED_ERROR: f64 = 7.5e-3;

/// Comb of wheel orders in one block of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CombBlock {
    /// Start of the block in s from the first sample of the pass.
    pub start_s: f64,
    /// Fundamental in Hz.
    pub fundamental_hz: f64,
    /// Share of the band's variance that the comb explains, 0 to 1.
    pub explained: f64,
    /// Share that a comb between the teeth explains by chance; median of several combs.
    pub by_chance: f64,
    /// Whether the comb explains more than each of these combs.
    pub wins: bool,
}

/// Periodogram of a block.
pub(super) struct Block {
    pub start_s: f64,
    pub speed_m_s: f64,
    /// Distance of the bins in Hz.
    pub step_hz: f64,
    /// Power by bin; the first bin is at 0 Hz.
    pub power: Vec<f64>,
}

impl Block {
    pub(super) fn of(pass: &Pass, start: usize, length: usize, top_hz: f64) -> Self {
        let rate = pass.signal.sample_rate_hz();
        let samples = &pass.signal.samples()[start..start + length];
        // Averages of neighbours: nothing above a few times the band is needed.
        let every = ((rate / (8.0 * top_hz)) as usize).max(1);
        let averages: Vec<f64> = samples
            .chunks_exact(every)
            .map(|part| part.iter().sum::<f64>() / every as f64)
            .collect();
        let count = averages.len();
        let mean = averages.iter().sum::<f64>() / count as f64;
        let mut lines: Vec<Complex64> = averages
            .iter()
            .enumerate()
            .map(|(i, value)| Complex64::from((value - mean) * hann(i, count)))
            .collect();
        lines.resize(count * PADDING, Complex64::ZERO);
        tracktwin_fourier::forward(lines.len()).process(&mut lines);
        let positions = &pass.position_m[start..start + length];
        Self {
            start_s: start as f64 / rate,
            speed_m_s: (positions[length - 1] - positions[0]) / (length - 1) as f64 * rate,
            step_hz: rate / every as f64 / lines.len() as f64,
            power: lines[..lines.len() / 2].iter().map(Complex64::norm_sqr).collect(),
        }
    }

    /// Share of the band's power that tones at the frequencies `(n + shift) f` explain.
    pub(super) fn explained(&self, fundamental: f64, shift: f64, band_hz: [f64; 2]) -> f64 {
        let bins = self.bins(band_hz);
        let total: f64 = self.power[bins].iter().sum();
        // A tone's power under Hann, summed over padded bins, is 1.5 cells of its peak.
        let cell = 1.5 * PADDING as f64;
        let first = (band_hz[0] / fundamental - shift).ceil() as i64;
        let last = (band_hz[1] / fundamental - shift).floor() as i64;
        let tooth = |n: i64| {
            let place = (n as f64 + shift) * fundamental / self.step_hz;
            self.power.get(place.round() as usize).copied().unwrap_or(0.0)
        };
        cell * (first..=last).map(tooth).sum::<f64>() / total.max(f64::MIN_POSITIVE)
    }

    /// Replaces lines that are known to be none of the wheel's by the level beside them: harmonics of the
    /// sleeper-passing frequency, and the mains.
    pub(super) fn without_known_lines(mut self, spacing_m: f64, [low, high]: [f64; 2]) -> Self {
        let passing_hz = self.speed_m_s / spacing_m;
        let harmonics = (low / passing_hz) as usize..=(high / passing_hz) as usize + 1;
        let sleepers = harmonics.map(|harmonic| {
            let frequency_hz = harmonic as f64 * passing_hz;
            (frequency_hz, SPEED_ERROR * frequency_hz)
        });
        for (frequency_hz, error_hz) in sleepers.chain(mains_hz().map(|mains_hz| (mains_hz, 0.0))) {
            let bin = |cells: f64| {
                let away_hz = cells * PADDING as f64 * self.step_hz + cells.signum() * error_hz;
                let bin = ((frequency_hz + away_hz) / self.step_hz).round();
                (bin.max(0.0) as usize).min(self.power.len())
            };
            let [from, first, last, to] =
                [-3.0, -1.0, 1.0, 3.0].map(|side| bin(side * TOOTH_CELLS));
            let beside = [&self.power[from..first], &self.power[last..to]].concat();
            // The mean of a periodogram value is its median over ln 2.
            self.power[first..last].fill(median(beside) / 2f64.ln());
        }
        self
    }

    /// Range of bins of a band in Hz.
    pub(super) fn bins(&self, [low, high]: [f64; 2]) -> std::ops::Range<usize> {
        let bin = |frequency: f64| (frequency / self.step_hz).round() as usize;
        bin(low)..bin(high).min(self.power.len())
    }
}

/// Shifts of the combs between the teeth, as shares of the fundamental: with the comb itself `sets` at equal distances.
pub(super) fn shifts(sets: usize) -> impl Iterator<Item = f64> {
    (1..sets).map(move |index| index as f64 / sets as f64)
}
