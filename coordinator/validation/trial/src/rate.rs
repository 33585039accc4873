//! Rates with their confidence intervals, and medians.

use serde::{Deserialize, Serialize};
use statrs::distribution::{Beta, ContinuousCDF};
use statrs::statistics::{Data, Median};

/// The middle value, the mean of the middle two of an even number; none of none.
pub(crate) fn median(values: Vec<f64>) -> Option<f64> {
    (!values.is_empty()).then(|| Data::new(values).median())
}

/// Relative frequency of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rate {
    /// Number of events.
    pub hits: u64,
    /// Number of observations.
    pub of: u64,
}

impl Rate {
    /// Counts the true values.
    pub fn of(answers: impl IntoIterator<Item = bool>) -> Self {
        answers.into_iter().fold(Self::default(), |rate, hit| Self {
            hits: rate.hits + u64::from(hit),
            of: rate.of + 1,
        })
    }

    /// The share, 0 to 1. `None` without observations.
    pub fn share(self) -> Option<f64> {
        (self.of > 0).then(|| self.hits as f64 / self.of as f64)
    }

    /// The 95 % confidence interval of the share (Clopper and Pearson, 1934), exact for a binomial
    /// count.
    #[expect(clippy::missing_panics_doc, reason = "a count and a count plus one are shapes")]
    pub fn interval_95(self) -> [f64; 2] {
        let (hits, misses) = (self.hits as f64, (self.of - self.hits) as f64);
        let quantile = |a: f64, b: f64, p: f64| {
            Beta::new(a, b).expect("both shapes are positive").inverse_cdf(p)
        };
        let low = if self.hits == 0 { 0.0 } else { quantile(hits, misses + 1.0, 0.025) };
        let high = if self.hits == self.of { 1.0 } else { quantile(hits + 1.0, misses, 0.975) };
        [low, high]
    }

    /// The rate as text, such as `38 of 40: 95 % (83 to 99)`.
    pub fn to_text(self) -> String {
        let Some(share) = self.share() else { return "none".to_owned() };
        let [low, high] = self.interval_95().map(|limit| 100.0 * limit);
        format!("{} of {}: {:.0} % ({low:.0} to {high:.0})", self.hits, self.of, 100.0 * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_published_tables() {
        // 0 of 10: 1 - 0.025^(1/10); 5 of 10: Clopper and Pearson's chart, 0.187 to 0.813.
        let [low, high] = Rate { hits: 0, of: 10 }.interval_95();
        assert_eq!(low, 0.0);
        assert!((high - (1.0 - 0.025_f64.powf(0.1))).abs() < 1e-6, "{high}");
        let [low, high] = Rate { hits: 5, of: 10 }.interval_95();
        assert!((low - 0.1871).abs() < 1e-3 && (high - 0.8129).abs() < 1e-3, "{low} {high}");
        assert_eq!(Rate { hits: 7, of: 7 }.interval_95()[1], 1.0);
    }

    #[test]
    fn of_nothing_there_is_no_share() {
        assert_eq!(Rate::of([]).share(), None);
        assert_eq!(Rate::of([true, false, true, true]).share(), Some(0.75));
        assert_eq!(Rate::of([]).to_text(), "none");
    }
}
