//! Ratio of the errors to the standard deviations of the process, along the range of a parameter.
//!
//! A Gaussian process gives nearly the same standard deviation everywhere, but the errors vary: a stiff
//! railpad is harder to estimate than a soft one (paper, 3.4). The errors of the folds determine a factor
//! that multiplies every standard deviation.

use serde::{Deserialize, Serialize};

/// Number of groups of equal size in which the errors are compared. Of 5000 entries each group holds 600,
/// enough for a factor within 3 %; eight groups still follow a trend along the range.
const GROUPS: usize = 8;

/// A factor on the standard deviation as a function of the predicted value, piecewise linear.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Predicted values, ascending.
    pub at: Vec<f64>,
    /// Factors at these values; constant below the first and above the last value.
    pub factors: Vec<f64>,
}

impl Spread {
    /// No correction: a factor of one.
    pub fn none() -> Self {
        Self { at: vec![0.0], factors: vec![1.0] }
    }

    /// Fits the factors: root mean square of the `standardised` errors over groups of entries with similar
    /// `predicted` values.
    pub fn fit(predicted: &[f64], standardised: &[f64]) -> Self {
        let mut order: Vec<usize> = (0..predicted.len()).collect();
        order.sort_by(|&i, &j| predicted[i].total_cmp(&predicted[j]));
        let size = order.len().div_ceil(GROUPS).max(1);
        let (at, factors) = order
            .chunks(size)
            .map(|group| {
                let n = group.len() as f64;
                let middle = group.iter().map(|&i| predicted[i]).sum::<f64>() / n;
                let square = group.iter().map(|&i| standardised[i].powi(2)).sum::<f64>() / n;
                (middle, square.sqrt())
            })
            .unzip();
        Self { at, factors }
    }

    /// The factor at a predicted `value`.
    pub fn factor(&self, value: f64) -> f64 {
        let above = self.at.partition_point(|&at| at <= value);
        if above == 0 || above == self.at.len() {
            return self.factors[above.min(self.at.len() - 1)];
        }
        let (x0, x1) = (self.at[above - 1], self.at[above]);
        let (y0, y1) = (self.factors[above - 1], self.factors[above]);
        y0 + (y1 - y0) * (value - x0) / (x1 - x0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_that_grow_along_the_range_get_growing_factors() {
        let predicted: Vec<f64> = (0..800).map(|i| f64::from(i) / 800.0).collect();
        let errors: Vec<f64> = predicted
            .iter()
            .enumerate()
            .map(|(i, p)| if i % 2 == 0 { 0.5 + p } else { -0.5 - p })
            .collect();
        let spread = Spread::fit(&predicted, &errors);
        // Eight groups, linear in between: the trend is met exactly but for the groups' widths.
        assert!((spread.factor(0.5) - 1.0).abs() < 0.01);
        assert!((spread.factor(0.25) - 0.75).abs() < 0.01);
        assert_eq!(spread.factor(-1.0), spread.factors[0]);
        assert_eq!(spread.factor(2.0), spread.factors[7]);
    }
}
