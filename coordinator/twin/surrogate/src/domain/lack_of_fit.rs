//! Lack of fit of the expected coordinates: the part of the residuals that a more flexible regression would
//! explain.

use faer::Mat;

/// Largest number of entries whose neighbours are searched.
const PROBES_MAX: usize = 2000;
/// Number of neighbours per entry.
const NEIGHBOURS: usize = 2;

/// Variances of the error of the expected coordinates (d values), from the residuals of the regression
/// (`residuals`, n x d, of variance one) and the mapped parameters (`unit`, n x p) of the same entries.
///
/// The random deviations of two entries are independent, but their lack of fit is nearly the same if their
/// parameters are close. The mean product of their residuals is therefore the variance of the lack of fit.
/// The fit of `coefficients` numbers to the same entries reduces this variance. The function therefore adds
/// the ratio of `coefficients` to entries in every coordinate; this is more than enough where nothing was
/// fitted.
pub(super) fn lack_of_fit(residuals: &Mat<f64>, unit: &Mat<f64>, coefficients: usize) -> Vec<f64> {
    let (n, d) = (residuals.nrows(), residuals.ncols());
    let step = n.div_ceil(PROBES_MAX).max(1);
    let mut sums = vec![0.0; d];
    let mut pairs = 0.0;
    for probe in (0..n).step_by(step) {
        for other in neighbours(unit, probe) {
            pairs += 1.0;
            let products = (0..d).map(|k| residuals[(probe, k)] * residuals[(other, k)]);
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
    }
    let fitted = coefficients as f64 / n as f64;
    sums.iter().map(|sum| (sum / f64::max(pairs, 1.0) + fitted).max(0.0)).collect()
}

/// The entries whose parameters are nearest to those of `probe`.
fn neighbours(unit: &Mat<f64>, probe: usize) -> Vec<usize> {
    let apart = |entry: usize| -> f64 {
        (0..unit.ncols()).map(|j| (unit[(entry, j)] - unit[(probe, j)]).powi(2)).sum()
    };
    let mut near: Vec<(f64, usize)> = (0..unit.nrows())
        .filter(|&entry| entry != probe)
        .map(|entry| (apart(entry), entry))
        .collect();
    let count = NEIGHBOURS.min(near.len());
    if count < near.len() {
        near.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0));
        near.truncate(count);
    }
    near.into_iter().map(|(_, entry)| entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    #[test]
    fn what_neighbours_share_is_told_from_what_each_has_alone() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let n = 3000;
        let unit = Mat::from_fn(n, 2, |i, j| {
            let place = if j == 0 { 0.754_877_666 } else { 0.569_840_291 };
            2.0 * ((i as f64 + 1.0) * place).fract() - 1.0
        });
        let missed = |i: usize| 0.5 * (std::f64::consts::TAU * unit[(i, 0)]).sin();
        let residuals = Mat::from_fn(n, 2, |i, k| {
            // Evenly distributed, with variance one.
            let scatter = (random.next_u64() as f64 / u64::MAX as f64 - 0.5) * 12.0_f64.sqrt();
            scatter + if k == 0 { missed(i) } else { 0.0 }
        });
        let [shared, none] = lack_of_fit(&residuals, &unit, 0)[..] else { panic!("two columns") };
        assert!((shared - 0.125).abs() < 0.04, "{shared}");
        assert!(none < 0.04, "{none}");
    }
}
