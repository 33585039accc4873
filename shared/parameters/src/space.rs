//! The parameter space that a campaign samples: one axis per varied parameter.

use crate::{Parameter, ParameterSet};
use serde::{Deserialize, Serialize};

/// How the unit interval maps onto an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Uniform in the value.
    #[default]
    Linear,
    /// Uniform in the logarithm of the value.
    Logarithmic,
}

impl Scale {
    /// The value at the relative position `x` in a range, from 0 (lowest) to 1 (highest).
    pub fn at(self, [low, high]: [f64; 2], x: f64) -> f64 {
        match self {
            Self::Linear => low + x * (high - low),
            Self::Logarithmic => low * (high / low).powf(x),
        }
    }

    /// Relative position of a value in a range, from 0 (lowest) to 1 (highest).
    pub fn share(self, [low, high]: [f64; 2], value: f64) -> f64 {
        match self {
            Self::Linear => (value - low) / (high - low),
            Self::Logarithmic => (value / low).ln() / (high / low).ln(),
        }
    }

    /// Derivative of the value by its relative position in a range, at a value.
    pub fn slope(self, [low, high]: [f64; 2], value: f64) -> f64 {
        match self {
            Self::Linear => high - low,
            Self::Logarithmic => value * (high / low).ln(),
        }
    }
}

/// One varied parameter and its range, in the parameter's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// The parameter.
    pub parameter: Parameter,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Scale on which the values are uniform.
    #[serde(default)]
    pub scale: Scale,
}

/// Why a space is invalid.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum SpaceError {
    /// A bound is NaN or infinite.
    #[error("{0}: both ends of the range must be finite numbers")]
    NotFinite(Parameter),
    /// The range is empty or reversed.
    #[error(
        "{parameter}: the range [{low}, {high}] is reversed or empty; write the lower end first"
    )]
    Reversed {
        /// The parameter.
        parameter: Parameter,
        /// Its lower end.
        low: f64,
        /// Its upper end.
        high: f64,
    },
    /// A physical quantity would be zero or negative.
    #[error("{0}: values must be positive")]
    NotPositive(Parameter),
    /// A parameter has two axes.
    #[error("{0}: duplicate axis")]
    Twice(Parameter),
}

/// Axes in catalogue order; parameters without an axis keep a fixed value.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct ParameterSpace {
    axes: Vec<Axis>,
}

impl ParameterSpace {
    /// The space of these axes, put in catalogue order.
    ///
    /// # Errors
    /// [`SpaceError`] names the parameter that occurs twice, or whose range is not finite, not positive,
    /// or not ascending.
    pub fn new(mut axes: Vec<Axis>) -> Result<Self, SpaceError> {
        axes.sort_by_key(|axis| axis.parameter);
        for pair in axes.windows(2) {
            if pair[0].parameter == pair[1].parameter {
                return Err(SpaceError::Twice(pair[0].parameter));
            }
        }
        for &Axis { parameter, low, high, .. } in &axes {
            if !(low.is_finite() && high.is_finite()) {
                return Err(SpaceError::NotFinite(parameter));
            }
            if low >= high {
                return Err(SpaceError::Reversed { parameter, low, high });
            }
            if low <= 0.0 {
                return Err(SpaceError::NotPositive(parameter));
            }
        }
        Ok(Self { axes })
    }

    /// The axes, in catalogue order.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The parameter set at a point of the unit cube, with one coordinate per axis. Parameters without
    /// an axis have the value of `fixed`.
    ///
    /// # Panics
    /// If the number of coordinates of the point differs from the number of axes.
    pub fn values(&self, point: &[f64], fixed: &ParameterSet) -> ParameterSet {
        assert_eq!(point.len(), self.axes.len(), "a coordinate an axis");
        self.axes.iter().zip(point).fold(*fixed, |set, (axis, &x)| {
            set.with(axis.parameter, axis.scale.at([axis.low, axis.high], x))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn axis(parameter: Parameter, low: f64, high: f64) -> Axis {
        Axis { parameter, low, high, scale: Scale::Linear }
    }

    #[test]
    fn a_reversed_range_is_refused_by_name() {
        let error = ParameterSpace::new(vec![axis(Parameter::BallastStiffness, 2e7, 1e7)]);
        assert!(error.unwrap_err().to_string().starts_with("ballast_stiffness_N_m: the range"));
    }

    #[test]
    fn nonsense_ranges_are_refused() {
        let p = Parameter::RailpadStiffness;
        let refused = |axes| ParameterSpace::new(axes).unwrap_err();
        assert_eq!(refused(vec![axis(p, f64::NAN, 1.0)]), SpaceError::NotFinite(p));
        assert_eq!(refused(vec![axis(p, -1.0, 1.0)]), SpaceError::NotPositive(p));
        assert_eq!(refused(vec![axis(p, 1.0, 2.0), axis(p, 1.0, 2.0)]), SpaceError::Twice(p));
    }

    #[test]
    fn a_relative_position_leads_back_to_its_value() {
        let range = [2.0, 50.0];
        for scale in [Scale::Linear, Scale::Logarithmic] {
            for x in [0.0, 0.3, 1.0] {
                let value = scale.at(range, x);
                assert!((scale.share(range, value) - x).abs() < 1e-14);
                let step = 1e-6;
                let slope = (scale.at(range, x + step) - scale.at(range, x - step)) / (2.0 * step);
                assert!((scale.slope(range, value) / slope - 1.0).abs() < 1e-8);
            }
        }
    }

    proptest! {
        #[test]
        fn every_point_of_the_cube_lands_inside_the_ranges(
            point in proptest::collection::vec(0.0..1.0_f64, Parameter::COUNT)
        ) {
            let space = crate::Preset::VTrack.space();
            let set = space.values(&point, &ParameterSet::nominal());
            for axis in space.axes() {
                prop_assert!((axis.low..=axis.high).contains(&set[axis.parameter]));
            }
        }
    }
}
