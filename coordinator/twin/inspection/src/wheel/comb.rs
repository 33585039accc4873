//! The comb of a wheel whose circumference isn't known, in a long pass.

use crate::along::{hann, ln_binomial_tail, median};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;
use tracktwin_signal::recording::Pass;

/// Circumferences in m of railway wheels, from trams to locomotives.
pub const CIRCUMFERENCES_M: [f64; 2] = [1.9, 4.0];

/// Wavelengths in m of the orders that are listened to: longer ones are lost in the vehicle's own
/// motion, shorter ones lie closer together than the speed is known.
const WAVELENGTHS_M: [f64; 2] = [0.12, 0.42];
/// Duration in s of a block: a dozen turns, and a speed that hardly changes.
const BLOCK_S: f64 = 2.0;
/// Blocks that a pass must have to fit on half of them.
const BLOCKS_MIN: usize = 6;
/// Bins to a resolution cell.
const PADDING: usize = 8;
/// Combs whose teeth stand between those of the wheel: what chance explains.
const SHIFTS: usize = 15;
/// Relative step of the fundamentals tried: a tenth of a cell at the twentieth order.
const STEP: f64 = 3e-4;

/// Lines at whole multiples of the wheel's turning, in one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Comb {
    /// Circumference in m and its standard deviation.
    pub circumference_m: (f64, f64),
    /// Fundamental in Hz, mean of the blocks.
    pub fundamental_hz: f64,
    /// Band in Hz that was listened to.
    pub band_hz: [f64; 2],
    /// The blocks, in the order of time.
    pub blocks: Vec<CombBlock>,
    /// Probability of a comb this clear without one, in logarithm.
    pub ln_p: f64,
    /// What a comb fitted on every other block says of those between.
    pub held_out: HeldOut,
}

/// One block of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CombBlock {
    /// Begin in s from the pass's first sample.
    pub start_s: f64,
    /// Fundamental in Hz.
    pub fundamental_hz: f64,
    /// Share of the band's variance that the comb explains.
    pub explained: f64,
    /// The same of a comb between the teeth, the median of several.
    pub by_chance: f64,
    /// Whether none of those explains as much.
    pub wins: bool,
}

/// Scores on blocks that nothing was fitted on: odd ones, with the fundamental between those of
/// the even blocks on either side and the even blocks' powers of order and background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut {
    /// Blocks that were held out.
    pub blocks: usize,
    /// Share of their variance explained, mean.
    pub explained: f64,
    /// The same of combs between the teeth.
    pub by_chance: f64,
    /// Mean gain in log predictive density over a smooth spectrum, in nats a block.
    pub gain_nats: f64,
    /// Blocks that are predicted better with the comb.
    pub better: usize,
}

/// A block's periodogram in the band.
pub(super) struct Block {
    pub start_s: f64,
    speed_m_s: f64,
    /// Distance of bins in Hz.
    pub step_hz: f64,
    /// Power by bin, the first at 0 Hz.
    pub power: Vec<f64>,
}

/// The comb of a wheel in a pass, if less likely than `alpha` without one.
///
/// Each block of two seconds is searched for the fundamental whose orders explain most of the
/// band's variance. None for a pass shorter than twelve seconds.
pub fn comb(pass: &Pass, alpha: f64) -> Option<Comb> {
    let rate = pass.signal.sample_rate_hz();
    let length = (BLOCK_S * rate) as usize;
    let count = pass.signal.len() / length;
    if count < BLOCKS_MIN {
        return None;
    }
    let speed = crate::along::speed_m_s(pass);
    let band_hz = [speed / WAVELENGTHS_M[1], (speed / WAVELENGTHS_M[0]).min(0.4 * rate)];
    if band_hz[1] < 2.0 * band_hz[0] {
        return None;
    }
    let blocks: Vec<Block> =
        (0..count).map(|index| Block::of(pass, index * length, length, band_hz[1])).collect();
    let fitted: Vec<CombBlock> = blocks.iter().map(|block| block.fit(band_hz)).collect();
    // Without a comb each of the sixteen sets of teeth is the best as often as any other.
    let wins = fitted.iter().filter(|block| block.wins).count();
    let ln_p = ln_binomial_tail(wins, count, 1.0 / (1.0 + SHIFTS as f64));
    if ln_p > alpha.ln() {
        return None;
    }
    let mut turns: Vec<f64> =
        blocks.iter().zip(&fitted).map(|(b, fit)| b.speed_m_s / fit.fundamental_hz).collect();
    turns.sort_by(f64::total_cmp);
    let middle = turns[count / 2];
    // Half of the middle half: unmoved by blocks where something louder passes.
    let deviation = 0.5 * (turns[3 * count / 4] - turns[count / 4]) / 0.6745;
    let held_out = super::order_model::held_out(&blocks, &fitted, band_hz);
    Some(Comb {
        circumference_m: (middle, deviation.max(STEP * middle)),
        fundamental_hz: median(fitted.iter().map(|block| block.fundamental_hz).collect()),
        band_hz,
        blocks: fitted,
        ln_p,
        held_out,
    })
}

impl Block {
    fn of(pass: &Pass, start: usize, length: usize, top_hz: f64) -> Self {
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
        FftPlanner::new().plan_fft_forward(lines.len()).process(&mut lines);
        let positions = &pass.position_m[start..start + length];
        Self {
            start_s: start as f64 / rate,
            speed_m_s: (positions[length - 1] - positions[0]) / (length - 1) as f64 * rate,
            step_hz: rate / every as f64 / lines.len() as f64,
            power: lines[..lines.len() / 2].iter().map(Complex64::norm_sqr).collect(),
        }
    }

    /// The fundamental that explains most, among those of all wheels.
    fn fit(&self, band_hz: [f64; 2]) -> CombBlock {
        let [shortest, longest] = CIRCUMFERENCES_M;
        let (low, high) = (self.speed_m_s / longest, self.speed_m_s / shortest);
        let steps = ((high / low).ln() / STEP) as usize;
        let trial = |step: usize| low * (STEP * step as f64).exp();
        let best = |shift: f64| {
            (0..steps)
                .map(|step| (self.explained(trial(step), shift, band_hz), trial(step)))
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((0.0, low))
        };
        let (explained, fundamental_hz) = best(0.0);
        let others: Vec<f64> = shifts().map(|shift| best(shift).0).collect();
        let wins = others.iter().all(|&other| other < explained);
        let by_chance = median(others);
        CombBlock { start_s: self.start_s, fundamental_hz, explained, by_chance, wins }
    }

    /// Share of the band's power that tones at the teeth `(n + shift) f` explain.
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

    /// Bins of a band.
    pub(super) fn bins(&self, [low, high]: [f64; 2]) -> std::ops::Range<usize> {
        let bin = |frequency: f64| (frequency / self.step_hz).round() as usize;
        bin(low)..bin(high).min(self.power.len())
    }
}

/// Shifts of combs that stand between the teeth, as parts of the fundamental.
pub(super) fn shifts() -> impl Iterator<Item = f64> {
    (0..SHIFTS).map(|index| 0.2 + 0.6 * index as f64 / (SHIFTS - 1) as f64)
}

/// Bins to a resolution cell of a block's periodogram.
pub(super) const fn padding() -> usize {
    PADDING
}
