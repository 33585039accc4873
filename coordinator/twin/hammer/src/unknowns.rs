//! The unknown logarithms of a track: means, and what each sleeper differs from them by.

use nalgebra::DVector;
use tracktwin_parameters::{Parameter, Prior};
use tracktwin_track::model::Support;

/// Standard deviation of the logarithm from sleeper to sleeper before a test: of the stiffnesses,
/// which the test tells, and of the others, which it hardly does.
const UNEVENNESS: [f64; Quantity::COUNT] = [0.15, 0.15, 0.05, 0.15, 0.15];

/// Sleepers whose weight the unevenness before the test has.
const UNEVENNESS_WEIGHT: f64 = 4.0;

/// Ends of what is learned of the unevenness.
const UNEVENNESS_ENDS: [f64; 2] = [0.01, 1.0];

/// A quantity that every sleeper has.
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
    /// How many there are.
    pub(crate) const COUNT: usize = 5;

    /// All, in the order of the unknowns.
    pub const ALL: [Self; Self::COUNT] = [
        Self::RailpadStiffness,
        Self::BallastStiffness,
        Self::SleeperBendingStiffness,
        Self::RailpadDamping,
        Self::BallastDamping,
    ];

    /// Those whose unevenness is learned.
    pub(crate) const LEARNED: [Self; 2] = [Self::RailpadStiffness, Self::BallastStiffness];

    /// Its row of the catalogue.
    pub const fn parameter(self) -> Parameter {
        match self {
            Self::RailpadStiffness => Parameter::RailpadStiffness,
            Self::BallastStiffness => Parameter::BallastStiffness,
            Self::SleeperBendingStiffness => Parameter::SleeperBendingStiffness,
            Self::RailpadDamping => Parameter::RailpadDamping,
            Self::BallastDamping => Parameter::BallastDamping,
        }
    }

    /// Its value in a support.
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

/// Where each unknown stands, and what is known of it before the test.
///
/// First the logarithms of the means, then, quantity by quantity, the logarithm of each sleeper's
/// value over the mean.
#[derive(Clone, Debug)]
pub(crate) struct Unknowns {
    /// Sleepers with values of their own.
    pub(crate) own: usize,
    medians: [f64; Quantity::COUNT],
    deviations: [f64; Quantity::COUNT],
    /// Standard deviation from sleeper to sleeper.
    pub(crate) unevenness: [f64; Quantity::COUNT],
}

impl Unknowns {
    pub(crate) fn new(prior: &Prior, own: usize) -> Self {
        Self {
            own,
            medians: Quantity::ALL.map(|of| prior.median[of.parameter()].ln()),
            deviations: Quantity::ALL.map(|of| prior.log_deviation(of.parameter())),
            unevenness: UNEVENNESS,
        }
    }

    pub(crate) const fn count(&self) -> usize {
        Quantity::COUNT * (1 + self.own)
    }

    /// Place of a mean.
    pub(crate) const fn mean(of: Quantity) -> usize {
        of as usize
    }

    /// Place of what a sleeper differs by.
    pub(crate) const fn at(&self, of: Quantity, own: usize) -> usize {
        Quantity::COUNT + of as usize * self.own + own
    }

    /// Median of every unknown before the test.
    pub(crate) fn start(&self) -> DVector<f64> {
        let mut start = DVector::zeros(self.count());
        for of in Quantity::ALL {
            start[Self::mean(of)] = self.medians[of as usize];
        }
        start
    }

    /// Reciprocal variance of every unknown before the test.
    pub(crate) fn precision(&self) -> DVector<f64> {
        let mut precision = DVector::zeros(self.count());
        for of in Quantity::ALL {
            precision[Self::mean(of)] = self.deviations[of as usize].powi(-2);
            for own in 0..self.own {
                precision[self.at(of, own)] = self.unevenness[of as usize].powi(-2);
            }
        }
        precision
    }

    /// Standard deviation of a sleeper's logarithm before the test.
    pub(crate) fn prior_deviation(&self, of: Quantity) -> f64 {
        self.deviations[of as usize].hypot(self.unevenness[of as usize])
    }

    /// Median of a quantity before the test.
    pub(crate) fn median(&self, of: Quantity) -> f64 {
        self.medians[of as usize].exp()
    }

    /// Supports of `sleepers` sleepers, of which those from `first_own` on have values of their own.
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

    /// Sets the unevenness of the stiffnesses to what the sleepers tell: one step of the
    /// expectation-maximisation algorithm for the variance, with the value before the test as
    /// four further sleepers.
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
