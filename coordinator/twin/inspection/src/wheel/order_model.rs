//! Prediction of withheld data by a model of wheel orders.

use super::block::{Block, CombBlock, PADDING, TOOTH_CELLS, shifts};
use crate::along::{ln_binomial_tail, median};

/// Width in Hz of the bands of the smooth spectrum.
const SMOOTH_HZ: f64 = 10.0;
/// Largest probability of the number of better predicted blocks if the comb predicts no better than the smooth spectrum.
const BETTER_BY_CHANCE: f64 = 0.05;
/// Largest relative deviation of the held-out fundamental from the mean of its neighbours. It corresponds
/// to the share of a resolution cell by which the orders drift in a block.
const FOLLOW: f64 = 1.5e-3;

/// Scores on the odd blocks, which are not fitted. Their fundamental is the mean of those of the even
/// blocks on either side; the powers of orders and background come from the even blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut {
    /// Number of held-out blocks.
    pub blocks: usize,
    /// Mean share of the variance explained in the held-out blocks, 0 to 1.
    pub explained: f64,
    /// Mean share of the variance explained by combs between the teeth.
    pub by_chance: f64,
    /// Mean gain in log predictive density relative to a smooth spectrum, in nats per block.
    pub gain_nats: f64,
    /// The same without the quarter of the orders that gain most: sleepers and mains may have lines at some orders.
    pub weaker_gain_nats: f64,
    /// Number of blocks that the comb predicts better.
    pub better: usize,
}

impl HeldOut {
    /// Whether the comb predicts the withheld blocks better: in the mean, also without its strongest orders, and in more
    /// blocks than by chance.
    pub(super) fn is_better(&self) -> bool {
        let ln_p = ln_binomial_tail(self.better, self.blocks, 0.5);
        self.gain_nats > 0.0 && self.weaker_gain_nats > 0.0 && ln_p <= BETTER_BY_CHANCE.ln()
    }
}

/// Expected spectrum: a smooth spectrum plus wheel orders.
struct OrderModel {
    /// Mean power by band of [`SMOOTH_HZ`], between the teeth.
    smooth: Vec<f64>,
    /// Mean power by band including the teeth, for a model without wheel orders.
    plain: Vec<f64>,
    /// Mean power at the tooth of every order.
    teeth: Vec<f64>,
}

/// Scores of the odd blocks for a model fitted to the even ones, beside `sets` of teeth.
pub(super) fn held_out(
    blocks: &[Block],
    fitted: &[CombBlock],
    band_hz: [f64; 2],
    sets: usize,
) -> HeldOut {
    let model = OrderModel::fit(blocks, fitted, band_hz);
    let odd: Vec<usize> = (1..blocks.len()).step_by(2).filter(|i| i + 1 < blocks.len()).collect();
    let count = odd.len().max(1) as f64;
    let (mut explained, mut by_chance, mut better) = (0.0, 0.0, 0);
    let mut gains = vec![0.0; model.teeth.len()];
    for &index in &odd {
        let block = &blocks[index];
        let between = 0.5 * (fitted[index - 1].fundamental_hz + fitted[index + 1].fundamental_hz);
        explained += block.near(between, 0.0, band_hz) / count;
        let others = shifts(sets).map(|shift| block.near(between, shift, band_hz)).collect();
        by_chance += median(others) / count;
        let of_block = model.gains(block, between, band_hz);
        better += usize::from(of_block.iter().sum::<f64>() > 0.0);
        for (sum, gain) in gains.iter_mut().zip(of_block) {
            *sum += gain / count;
        }
    }
    let gain_nats = gains.iter().sum();
    let weaker_gain_nats = without_strongest(gains);
    HeldOut { blocks: odd.len(), explained, by_chance, gain_nats, weaker_gain_nats, better }
}

/// Sum of the gains of all orders but the quarter that gains most; orders outside the band have none.
fn without_strongest(mut gains: Vec<f64>) -> f64 {
    gains.retain(|gain| *gain != 0.0);
    gains.sort_by(|a, b| b.total_cmp(a));
    gains[gains.len().div_ceil(4)..].iter().sum()
}

impl Block {
    /// Largest power explained by a comb within the neighbouring bins.
    fn near(&self, fundamental: f64, shift: f64, band_hz: [f64; 2]) -> f64 {
        let trials = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|part| fundamental * (1.0 + part * FOLLOW));
        trials.into_iter().map(|f| self.explained(f, shift, band_hz)).fold(0.0, f64::max)
    }
}

impl OrderModel {
    /// Fits means over the even blocks, each scaled to a mean power of one in the band.
    fn fit(blocks: &[Block], fitted: &[CombBlock], band_hz: [f64; 2]) -> Self {
        let bands = ((band_hz[1] - band_hz[0]) / SMOOTH_HZ).ceil() as usize;
        let even: Vec<usize> = (0..blocks.len()).step_by(2).collect();
        let lowest = even.iter().map(|&i| fitted[i].fundamental_hz).fold(f64::MAX, f64::min);
        let orders = (band_hz[1] / lowest) as usize + 2;
        let mut smooth = vec![(0.0, 0.0); bands];
        let mut plain = vec![(0.0, 0.0); bands];
        let mut teeth = vec![(0.0, 0.0); orders];
        for &index in &even {
            let (block, fundamental) = (&blocks[index], fitted[index].fundamental_hz);
            let bins = block.bins(band_hz);
            let scale = 1.0 / block.mean_power(band_hz);
            for bin in bins {
                let (band, order, at_tooth) = block.place(bin, fundamental, band_hz);
                let power = scale * block.power[bin];
                add(&mut plain[band.min(bands - 1)], power);
                if at_tooth {
                    add(&mut teeth[order.min(orders - 1)], power);
                } else {
                    add(&mut smooth[band.min(bands - 1)], power);
                }
            }
        }
        let mean = |sums: Vec<(f64, f64)>| -> Vec<f64> {
            sums.into_iter()
                .map(|(sum, count)| if count > 0.0 { sum / count } else { 1.0 })
                .collect()
        };
        Self { smooth: mean(smooth), plain: mean(plain), teeth: mean(teeth) }
    }

    /// Log ratio of the predictive density of a block with teeth to that without teeth (Whittle's
    /// likelihood), in nats for the bins nearest to each order.
    fn gains(&self, block: &Block, fundamental: f64, band_hz: [f64; 2]) -> Vec<f64> {
        let mean = block.mean_power(band_hz);
        let mut gains = vec![0.0; self.teeth.len()];
        for bin in block.bins(band_hz) {
            let (band, order, at_tooth) = block.place(bin, fundamental, band_hz);
            let power = block.power[bin] / mean;
            let plain = self.plain[band.min(self.plain.len() - 1)];
            let order = order.min(self.teeth.len() - 1);
            let comb = if at_tooth {
                self.teeth[order]
            } else {
                self.smooth[band.min(self.smooth.len() - 1)]
            };
            // Padded bins repeat one another, and Hann leaves two of three cells independent.
            let independent = 1.5 * PADDING as f64;
            gains[order] +=
                ((plain.ln() + power / plain) - (comb.ln() + power / comb)) / independent;
        }
        gains
    }
}

impl Block {
    fn mean_power(&self, band_hz: [f64; 2]) -> f64 {
        let bins = self.bins(band_hz);
        let count = bins.len().max(1) as f64;
        self.power[bins].iter().sum::<f64>() / count
    }

    /// Band of the smooth spectrum, nearest order, and whether the bin belongs to the tooth of this order.
    fn place(&self, bin: usize, fundamental: f64, band_hz: [f64; 2]) -> (usize, usize, bool) {
        let frequency = bin as f64 * self.step_hz;
        let order = (frequency / fundamental).round();
        let away = (frequency - order * fundamental).abs() / self.step_hz;
        let band = ((frequency - band_hz[0]).max(0.0) / SMOOTH_HZ) as usize;
        (band, order as usize, away < TOOTH_CELLS * PADDING as f64)
    }
}

fn add(sum: &mut (f64, f64), value: f64) {
    sum.0 += value;
    sum.1 += 1.0;
}
