//! Priors of the parameters of a track, before a recording is evaluated.

use crate::{Parameter, ParameterSet};

/// Width of the usual range of a parameter in standard deviations of its log-normal prior.
const DEVIATIONS_IN_RANGE: f64 = 2.6;

/// Log-normal priors of the parameters of a track, for the mean over its sleepers.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Median of each parameter.
    pub median: ParameterSet,
    /// Standard deviation of each parameter's natural logarithm, in catalogue order.
    pub log_deviation: [f64; Parameter::COUNT],
    /// Standard deviation of the exponent of the irregularity spectrum, about the exponent of eq. B.6.
    pub slope_deviation: f64,
}

impl Prior {
    /// Prior of V-Track (paper, Table D1). The irregularity has the spectrum of eq. B.6.
    pub fn v_track() -> Self {
        let mut prior = Self {
            median: ParameterSet::nominal(),
            log_deviation: [0.0; Parameter::COUNT],
            slope_deviation: 0.0,
        };
        for (parameter, median, log_deviation) in [
            (Parameter::RailpadStiffness, 9.0e7, 0.9),
            (Parameter::RailpadDamping, 6.0e3, 0.4),
            (Parameter::BallastStiffness, 1.0e7, 0.7),
            (Parameter::BallastDamping, 8.0e2, 0.6),
            (Parameter::SleeperBendingStiffness, 5.0e3, 0.3),
            (Parameter::IrregularityLevel, 2.5, 1.2),
        ] {
            prior.median[parameter] = median;
            prior.log_deviation[parameter.index()] = log_deviation;
        }
        prior
    }

    /// The prior of a track whose lengths are `ratio` times as large (paper, Table D1).
    #[must_use]
    pub fn enlarged(mut self, ratio: f64) -> Self {
        for &parameter in Parameter::ALL {
            self.median[parameter] = parameter.enlarged(self.median[parameter], ratio);
        }
        self
    }

    /// Prior of a track with these usual values and ranges. Each range spans 2.6 standard deviations.
    pub fn of_ranges(
        median: ParameterSet,
        ranges: &[[f64; 2]; Parameter::COUNT],
        slope_deviation: f64,
    ) -> Self {
        let log_deviation = ranges.map(|[low, high]| (high / low).ln() / DEVIATIONS_IN_RANGE);
        Self { median, log_deviation, slope_deviation }
    }

    /// Standard deviation of the natural logarithm of a parameter.
    pub const fn log_deviation(&self, parameter: Parameter) -> f64 {
        self.log_deviation[parameter.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enlarged_track_is_as_uncertain_about_other_medians() {
        let (small, large) = (Prior::v_track(), Prior::v_track().enlarged(5.0));
        assert_eq!(small.log_deviation, large.log_deviation);
        let ratio = |parameter| large.median[parameter] / small.median[parameter];
        assert!((ratio(Parameter::BallastStiffness) - 5.0).abs() < 1e-12);
        assert!((ratio(Parameter::BallastDamping) - 25.0).abs() < 1e-12);
        assert_eq!(small.clone().enlarged(1.0), small);
    }

    #[test]
    fn a_range_is_as_many_standard_deviations_wide_as_stated() {
        let ranges = [[1.0, 1.3_f64.exp()]; Parameter::COUNT];
        let prior = Prior::of_ranges(ParameterSet::nominal(), &ranges, 0.0);
        assert!((prior.log_deviation(Parameter::RailpadDamping) - 0.5).abs() < 1e-12);
    }
}
