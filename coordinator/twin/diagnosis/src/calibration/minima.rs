//! Posterior over several minima of a fit's objective.

use super::Calibration;
use crate::search::EVIDENCE_TEMPERING;
use nalgebra::DVector;

/// Squared distance of two minima, in standard deviations of the narrower one, from which they are separate.
const APART: f64 = 9.0;

/// Another minimum of a fit's objective.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// Values, as those of the fit.
    values: DVector<f64>,
    /// Posterior standard deviations of the values at this minimum.
    deviations: DVector<f64>,
    /// Log evidence in nats, up to the constant of the fit.
    log_evidence: f64,
}

impl Minimum {
    fn of(calibration: &Calibration) -> Self {
        let covariance = calibration.precision.inverse();
        Self {
            values: calibration.values.clone(),
            deviations: covariance.diagonal().map(f64::sqrt),
            log_evidence: calibration.log_evidence,
        }
    }

    fn is_apart(&self, other: &Self) -> bool {
        let differences = self.values.iter().zip(&other.values).map(|(a, b)| a - b);
        let deviations = self.deviations.iter().zip(&other.deviations).map(|(a, b)| a.min(*b));
        differences.zip(deviations).any(|(difference, sd)| difference.powi(2) > APART * sd.powi(2))
    }
}

impl Calibration {
    /// This fit, with the minimum of another fit of the same model as a further one.
    pub(crate) fn beside(mut self, other: &Self) -> Self {
        let own = Minimum::of(&self);
        for minimum in other.others.iter().cloned().chain([Minimum::of(other)]) {
            let known = self.others.iter().chain([&own]);
            if known.into_iter().all(|known| known.is_apart(&minimum)) {
                self.others.push(minimum);
            }
        }
        self
    }

    /// Posterior mean and standard deviation of each value. Minima weigh as their evidence, tempered as
    /// that of hypotheses.
    pub fn moments(&self) -> [DVector<f64>; 2] {
        let own = Minimum::of(self);
        if self.others.is_empty() {
            return [own.values, own.deviations];
        }
        let all: Vec<&Minimum> = self.others.iter().chain([&own]).collect();
        let most = all.iter().map(|it| it.log_evidence).fold(f64::NEG_INFINITY, f64::max);
        let weight = |it: &Minimum| ((it.log_evidence - most) / EVIDENCE_TEMPERING).exp();
        let sum: f64 = all.iter().map(|it| weight(it)).sum();
        let mut mean = DVector::zeros(self.values.len());
        let mut square = mean.clone();
        for minimum in all {
            let share = weight(minimum) / sum;
            mean += share * &minimum.values;
            square += share
                * minimum
                    .values
                    .zip_map(&minimum.deviations, |value, sd| value.powi(2) + sd.powi(2));
        }
        let deviations = square.zip_map(&mean, |square, mean| (square - mean.powi(2)).sqrt());
        [mean, deviations]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Cholesky, DMatrix};

    fn fit(value: f64, deviation: f64, log_evidence: f64) -> Calibration {
        Calibration {
            values: DVector::from_element(1, value),
            residual: DVector::zeros(1),
            jacobian: DMatrix::zeros(1, 1),
            gradient: DVector::zeros(1),
            precision: Cholesky::new(DMatrix::from_element(1, 1, deviation.powi(-2))).unwrap(),
            objective: -log_evidence,
            log_evidence,
            others: Vec::new(),
        }
    }

    #[test]
    fn two_minima_that_are_equally_good_count_the_same() {
        let both = fit(1.0, 0.1, 7.0).beside(&fit(3.0, 0.1, 7.0));
        let [mean, deviation] = both.moments();
        assert!((mean[0] - 2.0).abs() < 1e-12);
        assert!((deviation[0] - 1.01_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_minimum_that_is_much_worse_or_the_same_one_changes_nothing() {
        let worse = fit(1.0, 0.1, 100.0).beside(&fit(3.0, 0.1, 0.0));
        assert!((worse.moments()[0][0] - 1.0).abs() < 1e-12);
        let same = fit(1.0, 0.1, 7.0).beside(&fit(1.2, 0.1, 7.0));
        assert!(same.others.is_empty());
        // Of three fits two end in one minimum.
        let three = fit(1.0, 0.1, 7.0).beside(&fit(3.0, 0.1, 7.0)).beside(&fit(3.1, 0.1, 7.0));
        assert_eq!(three.others.len(), 1);
    }
}
