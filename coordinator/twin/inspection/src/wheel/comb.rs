//! Comb of wheel orders in a long pass at one speed.

use super::block::{Block, CombBlock, shifts};
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
/// Smallest number of blocks of a pass: of five that are not fitted all must be predicted better.
const BLOCKS_MIN: usize = 11;
/// Distance of the sets of teeth in resolution cells, at which their powers are nearly independent, and the largest
/// number of sets.
const SET_CELLS: f64 = 2.0;
const SETS_MAX: usize = 8;
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

/// Detects the comb of wheel orders in a pass, with a false-alarm rate of `alpha`, for a wheel of a circumference
/// between these.
///
/// In each block of two seconds the function determines the fundamental whose orders explain most of the
/// band's variance. Sleepers that are `spacing_m` apart, and the mains, have lines of their own, which do not count. The
/// comb must also predict withheld blocks. `None` for a pass shorter than 22 seconds.
pub fn comb(pass: &Pass, spacing_m: f64, circumferences_m: [f64; 2], alpha: f64) -> Option<Comb> {
    let rate = pass.signal.sample_rate_hz();
    let length = (BLOCK_S * rate) as usize;
    let count = pass.signal.len() / length;
    let speed = pass.mean_speed_m_s();
    let band_hz = [speed / WAVELENGTHS_M[1], (speed / WAVELENGTHS_M[0]).min(0.4 * rate)];
    let sets = ((speed / circumferences_m[1] * BLOCK_S / SET_CELLS) as usize).min(SETS_MAX);
    if count < BLOCKS_MIN || band_hz[1] < 2.0 * band_hz[0] || sets < 2 {
        return None;
    }
    let block = |index: usize| {
        let block = Block::of(pass, index * length, length, band_hz[1]);
        block.without_known_lines(spacing_m, band_hz)
    };
    let blocks: Vec<Block> = (0..count).map(block).collect();
    let fit = |block: &Block| block.fit(circumferences_m, band_hz, sets);
    let fitted: Vec<CombBlock> = blocks.iter().map(fit).collect();
    // Without a comb each set of teeth is the best as often as any other: the wheel's in 23 to 26 % of 400 blocks of
    // white and coloured noise with four sets, in 9 to 12 % with eight.
    let wins = fitted.iter().filter(|block| block.wins).count();
    let ln_p = ln_binomial_tail(wins, count, 1.0 / sets as f64);
    let held_out = held_out(&blocks, &fitted, band_hz, sets);
    if ln_p > alpha.ln() || !held_out.is_better() {
        return None;
    }
    let mut turns: Vec<f64> =
        blocks.iter().zip(&fitted).map(|(b, fit)| b.speed_m_s / fit.fundamental_hz).collect();
    turns.sort_by(f64::total_cmp);
    let middle = turns[count / 2];
    // Half of the middle half: unmoved by blocks where something louder passes.
    let deviation = 0.5 * (turns[3 * count / 4] - turns[count / 4]) / NORMAL_QUARTILE;
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
    /// The fundamental that explains most of the band's power, among the circumferences between these, beside `sets`
    /// of teeth.
    fn fit(&self, [shortest, longest]: [f64; 2], band_hz: [f64; 2], sets: usize) -> CombBlock {
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
        let others: Vec<f64> = shifts(sets).map(|shift| best(shift).0).collect();
        let wins = others.iter().all(|&other| other < explained);
        let by_chance = median(others);
        CombBlock { start_s: self.start_s, fundamental_hz, explained, by_chance, wins }
    }
}
