//! Means with their standard errors, and the significance of their sign.

use crate::ClaimVerdict;
use tracktwin_evaluation::Estimate;

/// Standard deviations beyond which chance is no longer taken for the reason: it reaches further
/// once in twenty times.
pub(crate) const DEVIATIONS: f64 = 2.0;

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Average {
    /// The mean.
    pub(crate) mean: f64,
    /// Its standard error.
    pub(crate) error: f64,
}

impl Average {
    /// Of values that vary by chance.
    pub(crate) fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Self { mean, error: (squares / (n - 1.0) / n).sqrt() }
    }

    /// Mean of estimates from one recording. Most of their error is the same at all sleepers, so the
    /// error of the mean is the mean standard deviation of one estimate.
    pub(crate) fn of_estimates(estimates: &[Estimate]) -> Self {
        let n = estimates.len() as f64;
        let mean = estimates.iter().map(|estimate| estimate.mean).sum::<f64>() / n;
        let error = estimates.iter().map(|estimate| estimate.sd).sum::<f64>() / n;
        Self { mean, error }
    }

    /// Sum of averages that are independent of each other.
    pub(crate) fn sum(averages: impl IntoIterator<Item = Self>) -> Self {
        let zero = Self { mean: 0.0, error: 0.0 };
        averages.into_iter().fold(zero, |sum, next| Self {
            mean: sum.mean + next.mean,
            error: sum.error.hypot(next.error),
        })
    }

    /// This less another that is independent of it. If both share a part of their error, the error of
    /// the difference is smaller than stated.
    pub(crate) fn less(self, other: Self) -> Self {
        Self { mean: self.mean - other.mean, error: self.error.hypot(other.error) }
    }

    /// The same in another unit.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self { mean: self.mean * factor, error: self.error * factor.abs() }
    }

    /// The same from another zero.
    pub(crate) fn plus(self, offset: f64) -> Self {
        Self { mean: self.mean + offset, ..self }
    }

    /// Whether it differs significantly from zero.
    pub(crate) fn differs_from_zero(self) -> bool {
        self.mean.abs() > DEVIATIONS * self.error
    }

    /// Verdict on the claim that it is zero within chance, where `matters` is a relevant size: a
    /// larger uncertainty gives no verdict.
    pub(crate) fn is_nothing(self, matters: f64) -> ClaimVerdict {
        if self.differs_from_zero() {
            ClaimVerdict::Differs
        } else if DEVIATIONS * self.error < matters {
            ClaimVerdict::Reproduced
        } else {
            ClaimVerdict::CannotTell
        }
    }

    /// Verdict on the claim that it is above zero.
    pub(crate) fn is_positive(self) -> ClaimVerdict {
        if self.differs_from_zero() {
            ClaimVerdict::of(self.mean > 0.0)
        } else {
            ClaimVerdict::CannotTell
        }
    }
}

/// The verdict on several claims of which all must hold.
pub(crate) fn all(verdicts: impl IntoIterator<Item = ClaimVerdict>) -> ClaimVerdict {
    verdicts.into_iter().fold(ClaimVerdict::Reproduced, |all, verdict| match (all, verdict) {
        (ClaimVerdict::Differs, _) | (_, ClaimVerdict::Differs) => ClaimVerdict::Differs,
        (ClaimVerdict::CannotTell, _) | (_, ClaimVerdict::CannotTell) => ClaimVerdict::CannotTell,
        _ => ClaimVerdict::Reproduced,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_has_its_error_and_a_difference_both() {
        let average = Average::of(&[1.0, 3.0]);
        // Standard deviation sqrt(2) over sqrt(2) values.
        assert!((average.mean - 2.0).abs() < 1e-12 && (average.error - 1.0).abs() < 1e-12);
        let other = Average { mean: -3.0, error: 1.0 };
        let difference = average.less(other);
        assert!((difference.error - 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(difference.is_positive(), ClaimVerdict::Reproduced);
        assert_eq!(other.is_positive(), ClaimVerdict::Differs);
        let unsure = Average { mean: 1.0, error: 1.0 };
        assert_eq!(unsure.is_positive(), ClaimVerdict::CannotTell);
        assert_eq!(unsure.is_nothing(3.0), ClaimVerdict::Reproduced);
        assert_eq!(unsure.is_nothing(1.0), ClaimVerdict::CannotTell);
        assert_eq!(other.is_nothing(9.0), ClaimVerdict::Differs);
    }

    #[test]
    fn sleepers_share_their_error_and_examples_do_not() {
        let estimates =
            [(1.0, 0.2), (2.0, 0.2), (3.0, 0.5)].map(|(mean, sd)| Estimate { mean, sd });
        let mean = Average::of_estimates(&estimates);
        assert!((mean.mean - 2.0).abs() < 1e-12 && (mean.error - 0.3).abs() < 1e-12);
        let sum = Average::sum([mean; 4]);
        assert!((sum.mean - 8.0).abs() < 1e-12 && (sum.error - 0.6).abs() < 1e-12);
    }

    #[test]
    fn one_that_differs_spoils_all() {
        use ClaimVerdict::{CannotTell, Differs, Reproduced};
        assert_eq!(all([Reproduced, CannotTell, Differs]), Differs);
        assert_eq!(all([Reproduced, CannotTell]), CannotTell);
        assert_eq!(all([Reproduced, Reproduced]), Reproduced);
    }
}
