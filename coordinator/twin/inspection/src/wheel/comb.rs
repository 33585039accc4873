//! Comb of wheel orders in a long pass, for a wheel of unknown circumference.

use super::block::{Block, CombBlock, SHIFTS, shifts};
use super::order_model::{HeldOut, held_out};
use crate::along::{ln_binomial_tail, median};
use tracktwin_number::NORMAL_QUARTILE;
use tracktwin_signal::recording::Pass;

/// Smallest and largest circumference of railway wheels in m, from trams to locomotives.
pub const CIRCUMFERENCES_M: [f64; 2] = [1.9, 4.0];

/// Shortest and longest wavelength in m of the tested orders. Longer waves are masked by the motion of the
/// vehicle; orders of shorter waves are closer together than the uncertainty of the speed.
const WAVELENGTHS_M: [f64; 2] = [0.12, 0.42];
/// Duration of a block in s: about twelve turns, with nearly constant speed.
const BLOCK_S: f64 = 2.0;
/// Smallest number of blocks of a pass; half of them are fitted.
const BLOCKS_MIN: usize = 6;
/// Relative step of the tested fundamentals: a tenth of a cell at the twentieth order.
const STEP: f64 = 3e-4;

/// Lines at integer multiples of the wheel's rotation frequency, in one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Comb {
    /// Circumference in m and its standard deviation.
    pub circumference_m: (f64, f64),
    /// Fundamental in Hz, as median of the blocks.
    pub fundamental_hz: f64,
    /// Tested band in Hz.
    pub band_hz: [f64; 2],
    /// The blocks, in the order of time.
    pub blocks: Vec<CombBlock>,
    /// Natural logarithm of the probability of such a comb by chance.
    pub ln_p: f64,
    /// Quality of the prediction of every other block by a comb fitted to the remaining blocks.
    pub held_out: HeldOut,
}

/// Detects the comb of wheel orders in a pass, with a false-alarm rate of `alpha`.
///
/// In each block of two seconds the function determines the fundamental whose orders explain most of the
/// band's variance. `None` for a pass shorter than twelve seconds.
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
    let deviation = 0.5 * (turns[3 * count / 4] - turns[count / 4]) / NORMAL_QUARTILE;
    let held_out = held_out(&blocks, &fitted, band_hz);
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
    /// The fundamental that explains most of the band's power, among the circumferences of all railway
    /// wheels.
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
}
