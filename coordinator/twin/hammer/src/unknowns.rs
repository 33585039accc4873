//! Unknown logarithms: means of a track, the deviation of each sleeper from the means, and the gain of the
//! measurement.

use nalgebra::DVector;
use tracktwin_parameters::{Parameter, Prior};
use tracktwin_track::model::Support;

/// Prior standard deviation of the logarithm from sleeper to sleeper. A test determines those of the
/// stiffnesses and hardly affects the others.
const UNEVENNESS: [f64; Quantity::COUNT] = [0.15, 0.15, 0.05, 0.15, 0.15];

/// Weight of the prior unevenness, as a number of sleepers.
const UNEVENNESS_WEIGHT: f64 = 4.0;

/// Lower and upper limit of the estimated unevenness.
const UNEVENNESS_ENDS: [f64; 2] = [0.01, 1.0];

/// Prior standard deviation of the logarithm of the gain: 5 %.
///
/// The gain is the ratio of measured to true receptance, common to the whole record. It is the error of
/// the calibration of hammer and accelerometer. Each is calibrated to a few per cent; ISO 7626-5 measures
/// the ratio of both on a known mass.
pub(crate) const GAIN_DEVIATION: f64 = 0.05;

/// Estimated quantity of a sleeper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Railpad stiffness `k_p`.
    RailpadStiffness,
    /// Ballast stiffness `k_b`.
    BallastStiffness,
    /// Sleeper bending stiffness `EI_s`.
    SleeperBendingStiffness,
    /// Railpad damping `c_p`.
    RailpadDamping,
    /// Ballast damping `c_b`.
    BallastDamping,
}

impl Quantity {
    /// Number of quantities.
    pub(crate) const COUNT: usize = 5;

    /// All quantities, in the order of the unknowns.
    pub const ALL: [Self; Self::COUNT] = [
        Self::RailpadStiffness,
        Self::BallastStiffness,
        Self::SleeperBendingStiffness,
        Self::RailpadDamping,
        Self::BallastDamping,
    ];

    /// Quantities whose unevenness is estimated.
    pub(crate) const LEARNED: [Self; 2] = [Self::RailpadStiffness, Self::BallastStiffness];

    /// The parameter in the catalogue.
    pub const fn parameter(self) -> Parameter {
        match self {
            Self::RailpadStiffness => Parameter::RailpadStiffness,
            Self::BallastStiffness => Parameter::BallastStiffness,
            Self::SleeperBendingStiffness => Parameter::SleeperBendingStiffness,
            Self::RailpadDamping => Parameter::RailpadDamping,
            Self::BallastDamping => Parameter::BallastDamping,
        }
    }

    /// Value of the quantity in a support.
    pub(crate) const fn of(self, support: &mut Support) -> &mut f64 {
        match self {
            Self::RailpadStiffness => &mut support.railpad_stiffness,
            Self::BallastStiffness => &mut support.ballast_stiffness,
            Self::SleeperBendingStiffness => &mut support.sleeper_bending_stiffness,
            Self::RailpadDamping => &mut support.railpad_damping,
            Self::BallastDamping => &mut support.ballast_damping,
        }
    }
}

/// Indices of the unknowns, and their priors.
///
/// The vector begins with the logarithms of the means and of the gain. For every quantity, the logarithm of
/// the ratio of each sleeper's value to the mean follows.
#[derive(Clone, Debug)]
pub(crate) struct Unknowns {
    /// Number of sleepers with their own values.
    pub(crate) own: usize,
    medians: [f64; Quantity::COUNT],
    deviations: [f64; Quantity::COUNT],
    /// Standard deviation from sleeper to sleeper.
    pub(crate) unevenness: [f64; Quantity::COUNT],
}

impl Unknowns {
    /// Index of the gain.
    pub(crate) const GAIN: usize = Quantity::COUNT;

    /// Number of unknowns that all sleepers share: means and gain. They have the first indices.
    pub(crate) const SHARED: usize = Quantity::COUNT + 1;

    pub(crate) fn new(prior: &Prior, own: usize) -> Self {
        Self {
            own,
            medians: Quantity::ALL.map(|of| prior.median[of.parameter()].ln()),
            deviations: Quantity::ALL.map(|of| prior.log_deviation(of.parameter())),
            unevenness: UNEVENNESS,
        }
    }

    pub(crate) const fn count(&self) -> usize {
        Self::SHARED + Quantity::COUNT * self.own
    }

    /// Index of the mean of a quantity.
    pub(crate) const fn mean(of: Quantity) -> usize {
        of as usize
    }

    /// Index of the deviation of a sleeper from the mean.
    pub(crate) const fn at(&self, of: Quantity, own: usize) -> usize {
        Self::SHARED + of as usize * self.own + own
    }

    /// Prior median of every unknown.
    pub(crate) fn start(&self) -> DVector<f64> {
        let mut start = DVector::zeros(self.count());
        for of in Quantity::ALL {
            start[Self::mean(of)] = self.medians[of as usize];
        }
        start
    }

    /// Prior reciprocal variance of every unknown.
    pub(crate) fn precision(&self) -> DVector<f64> {
        let mut precision = DVector::zeros(self.count());
        precision[Self::GAIN] = GAIN_DEVIATION.powi(-2);
        for of in Quantity::ALL {
            precision[Self::mean(of)] = self.deviations[of as usize].powi(-2);
            for own in 0..self.own {
                precision[self.at(of, own)] = self.unevenness[of as usize].powi(-2);
            }
        }
        precision
    }

    /// Prior standard deviation of a sleeper's logarithm.
    pub(crate) fn prior_deviation(&self, of: Quantity) -> f64 {
        self.deviations[of as usize].hypot(self.unevenness[of as usize])
    }

    /// Prior median of a quantity, in SI units.
    pub(crate) fn median(&self, of: Quantity) -> f64 {
        self.medians[of as usize].exp()
    }

    /// Supports of `sleepers` sleepers; those from index `first_own` on have their own values.
    pub(crate) fn supports(
        &self,
        values: &DVector<f64>,
        sleepers: usize,
        first_own: usize,
    ) -> Vec<Support> {
        let value = |of: Quantity, sleeper: usize| {
            let own = sleeper.checked_sub(first_own).filter(|own| *own < self.own);
            (values[Self::mean(of)] + own.map_or(0.0, |own| values[self.at(of, own)])).exp()
        };
        let support = |sleeper| Support {
            railpad_stiffness: value(Quantity::RailpadStiffness, sleeper),
            railpad_damping: value(Quantity::RailpadDamping, sleeper),
            ballast_stiffness: value(Quantity::BallastStiffness, sleeper),
            ballast_damping: value(Quantity::BallastDamping, sleeper),
            sleeper_bending_stiffness: value(Quantity::SleeperBendingStiffness, sleeper),
        };
        (0..sleepers).map(support).collect()
    }

    /// Estimates the unevenness of the stiffnesses from the sleepers: one step of the
    /// expectation-maximisation algorithm for the variance, in which the prior value counts as four further
    /// sleepers.
    ///
    /// Source: A. P. Dempster, N. M. Laird and D. B. Rubin, *J. R. Stat. Soc. B* 39 (1977), 4.
    pub(crate) fn learn(&mut self, values: &DVector<f64>, variances: &DVector<f64>) {
        for of in Quantity::LEARNED {
            let places = (0..self.own).map(|own| self.at(of, own));
            let sum: f64 = places.map(|at| values[at] * values[at] + variances[at]).sum();
            let before = UNEVENNESS_WEIGHT * UNEVENNESS[of as usize].powi(2);
            let variance = (sum + before) / (self.own as f64 + UNEVENNESS_WEIGHT);
            let [low, high] = UNEVENNESS_ENDS;
            self.unevenness[of as usize] = variance.sqrt().clamp(low, high);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleepers_outside_have_the_mean_and_those_inside_their_own() {
        let unknowns = Unknowns::new(&Prior::v_track(), 3);
        let mut values = unknowns.start();
        values[unknowns.at(Quantity::BallastStiffness, 1)] = 2f64.ln();
        let supports = unknowns.supports(&values, 7, 2);
        let ballast: Vec<f64> = supports.iter().map(|it| it.ballast_stiffness / 1e7).collect();
        for (index, value) in ballast.iter().enumerate() {
            let expected = if index == 3 { 2.0 } else { 1.0 };
            assert!((value - expected).abs() < 1e-9, "{index}: {value}");
        }
    }

    #[test]
    fn the_unevenness_follows_the_sleepers() {
        let mut unknowns = Unknowns::new(&Prior::v_track(), 40);
        let mut values = unknowns.start();
        for own in 0..40 {
            let at = unknowns.at(Quantity::RailpadStiffness, own);
            values[at] = if own % 2 == 0 { 0.4 } else { -0.4 };
        }
        let none = DVector::zeros(unknowns.count());
        unknowns.learn(&values, &none);
        let [railpad, ballast, ..] = unknowns.unevenness;
        assert!((railpad - 0.384).abs() < 0.002 && ballast < 0.06, "{railpad} {ballast}");
    }
}
