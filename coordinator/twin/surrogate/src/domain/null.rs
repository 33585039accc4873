//! Residuals of the library's own cases, for single windows and for means of windows.

use super::coordinates::Coordinates;
use crate::{Error, Split, TrainingSet};
use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use statrs::distribution::{ContinuousCDF, Gamma};

/// Number of means that are drawn for one limit.
const DRAWS: usize = 2000;
/// Random seed of the split into halves and of the draws.
const SEED: u64 = 0x0d0a_1417;

/// Residual coordinates of cases that were not used to fit the coordinates.
pub(super) struct Null {
    /// Cases x d.
    residuals: Mat<f64>,
    /// Variance of the expected coordinates of every case.
    variances: Vec<f64>,
    discrepancy: Vec<f64>,
}

impl Null {
    /// Fits coordinates to one half of the entries and stores the residuals of the other half.
    ///
    /// # Errors
    /// Those of [`Coordinates::of`].
    pub(super) fn of(set: &TrainingSet, speeds: &[usize]) -> Result<Self, Error> {
        let Split { train, test } = Split::halves(set.entries(), SEED);
        let coordinates = Coordinates::of(set, speeds, &train)?;
        let bins = set.frequencies_hz.len();
        let observed = coordinates.apply(set.features(&test, speeds, &(0..bins)).as_ref());
        let unit = coordinates.polynomial.unit(set.values(&test).as_ref());
        let mut residuals = observed;
        let mut variances = Vec::with_capacity(test.len());
        for case in 0..test.len() {
            let at: Vec<f64> = unit.row(case).iter().copied().collect();
            let expected = coordinates.expected(&at);
            expected.iter().enumerate().for_each(|(k, mean)| residuals[(case, k)] -= mean);
            variances.push(coordinates.variance(&at));
        }
        Ok(Self { residuals, variances, discrepancy: coordinates.discrepancy })
    }

    /// Limit of chi-square of a mean over this number of windows; a mean exceeds it with this
    /// `probability`.
    ///
    /// Residuals of randomly drawn cases, plus a randomly drawn discrepancy, give the mean and variance of
    /// chi-square. A gamma distribution with this mean and variance gives the tail.
    pub(super) fn limit(&self, windows: usize, probability: f64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let draws: Vec<f64> = (0..DRAWS).map(|_| self.draw(windows, &mut random)).collect();
        let mean = draws.iter().sum::<f64>() / DRAWS as f64;
        let variance =
            draws.iter().map(|draw| (draw - mean).powi(2)).sum::<f64>() / (DRAWS - 1) as f64;
        Gamma::new(mean * mean / variance, mean / variance)
            .map_or(f64::INFINITY, |gamma| gamma.inverse_cdf(1.0 - probability))
    }

    fn draw(&self, windows: usize, random: &mut impl Rng) -> f64 {
        let (cases, d) = (self.residuals.nrows(), self.residuals.ncols());
        let share = 1.0 / windows as f64;
        let (mut mean, mut variance) = (vec![0.0; d], share);
        for _ in 0..windows {
            let case = (random.next_u64() % cases as u64) as usize;
            variance += share * self.variances[case];
            mean.iter_mut()
                .enumerate()
                .for_each(|(k, sum)| *sum += share * self.residuals[(case, k)]);
        }
        let pairs = mean.iter().zip(&self.discrepancy);
        pairs
            .map(|(mean, between)| {
                let other = between.sqrt() * standard_normal(random);
                (mean + other).powi(2) / (variance + between)
            })
            .sum()
    }
}

/// A standard normal number (Box & Muller 1958).
fn standard_normal(random: &mut impl Rng) -> f64 {
    let unit = |bits: u64| ((bits >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
    let radius = (-2.0 * unit(random.next_u64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * unit(random.next_u64())).cos()
}
