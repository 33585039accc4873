//! Estimates along the ring, read from the `evaluation.json` of any method.

use crate::RingError;
use serde_json::Value;
use std::collections::BTreeMap;
use tracktwin_evaluation::{Estimate, Estimates};
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;

/// Estimates of one sleeper.
#[derive(Clone, Debug, PartialEq)]
struct SleeperEstimates {
    /// Whether the method calls them valid.
    valid: bool,
    /// Mean and standard deviation.
    values: Estimates,
    /// Mean absolute percentage error of the ten best matches (0.05 is 5 %). `None` without a selector.
    mape: Option<f64>,
}

/// Estimates of one method from one set of passes, by the name of the sleeper.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimated {
    sleepers: BTreeMap<String, SleeperEstimates>,
}

impl Estimated {
    /// Reads the text of an `evaluation.json`.
    ///
    /// # Errors
    /// [`RingError`] if the text is not an evaluation.
    pub fn read(text: &str) -> Result<Self, RingError> {
        Self::from_sleepers(text, |sleeper| Some(sleeper))
    }

    /// Reads the estimates of the model selector. `None` if the method has no selector.
    ///
    /// # Errors
    /// [`RingError`] if the text is not an evaluation.
    pub fn read_selector(text: &str) -> Result<Option<Self>, RingError> {
        let estimated = Self::from_sleepers(text, |sleeper| sleeper.get("selector"))?;
        Ok((!estimated.sleepers.is_empty()).then_some(estimated))
    }

    fn from_sleepers(
        text: &str,
        part: impl Fn(&Value) -> Option<&Value>,
    ) -> Result<Self, RingError> {
        let document: Value = serde_json::from_str(text)?;
        let sleepers = document["sleepers"].as_array().ok_or(RingError::NoSleepers)?;
        let read = |sleeper: &Value| {
            let flags = sleeper["flags"].as_array();
            let outside = flags.is_some_and(|of| of.iter().any(|it| it == "outside_library"));
            let part = part(sleeper)?;
            let id = sleeper["id"].as_str()?.to_owned();
            let errors = part["mape"].as_array().into_iter().flatten().filter_map(Value::as_f64);
            let (values, mape) = (estimates(part), mean(errors));
            Some((id, SleeperEstimates { valid: !outside, values, mape }))
        };
        Ok(Self { sleepers: sleepers.iter().filter_map(read).collect() })
    }

    /// The estimates of a sleeper.
    fn sleeper(&self, id: &str) -> Option<&SleeperEstimates> {
        self.sleepers.get(id)
    }

    /// Mean absolute percentage error of the ten best matches of a sleeper.
    pub(crate) fn mape(&self, id: &str) -> Option<f64> {
        self.sleeper(id)?.mape
    }

    /// The estimate of a parameter at a sleeper, valid or not.
    pub(crate) fn any(&self, id: &str, parameter: Parameter) -> Option<Estimate> {
        self.sleeper(id)?.values.get(&parameter).copied()
    }

    /// The estimate of a parameter at a sleeper, if it is valid.
    pub(crate) fn valid(&self, id: &str, parameter: Parameter) -> Option<Estimate> {
        let sleeper = self.sleeper(id)?;
        sleeper.values.get(&parameter).copied().filter(|_| sleeper.valid)
    }
}

fn estimates(sleeper: &Value) -> Estimates {
    let of = |parameter: &Parameter| {
        let value = sleeper.get(parameter.name())?;
        let estimate = Estimate { mean: value["mean"].as_f64()?, sd: value["sd"].as_f64()? };
        Some((*parameter, estimate))
    };
    Parameter::ALL.iter().filter_map(of).collect()
}

/// Standard deviation of an estimate as a share of the parameter's range.
pub(crate) fn sd_share(estimate: Estimate, parameter: Parameter) -> f64 {
    let [low, high] = parameter.range();
    estimate.sd / (high - low)
}

/// Whether a value lies in the 90 % interval of an estimate.
pub(crate) fn holds(estimate: Estimate, value: f64) -> bool {
    (estimate.mean - value).abs() <= NORMAL_90 * estimate.sd
}

/// Whether two estimates agree: their difference lies in its own 90 % interval.
pub(crate) fn agree(one: Estimate, other: Estimate) -> bool {
    (one.mean - other.mean).abs() <= NORMAL_90 * one.sd.hypot(other.sd)
}

/// Median of the values. `None` without values.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let count = values.len();
    match count {
        0 => None,
        _ if count % 2 == 1 => Some(values[count / 2]),
        _ => Some(0.5 * (values[count / 2 - 1] + values[count / 2])),
    }
}

/// Mean of the values. `None` without values.
pub(crate) fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.into_iter().fold((0.0, 0), |(sum, count), it| (sum + it, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Correlation coefficient of pairs. `None` if one of the variables is constant.
pub fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        pairs.iter().map(|pair| of(pair.0 - x, pair.1 - y)).sum()
    };
    let correlation = sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt();
    correlation.is_finite().then_some(correlation)
}

/// Difference from zero, or of two correlation coefficients of so many pairs, that may be chance: two
/// standard errors of `1 / sqrt(count)`.
pub(crate) fn correlation_by_chance(count: usize) -> f64 {
    const STANDARD_ERRORS: f64 = 2.0;
    STANDARD_ERRORS / (count as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"{"sleepers": [
        {"id": "SN1", "x_m": 0.0, "railpad_stiffness_N_m": {"mean": 8e7, "sd": 1e7}, "flags": []},
        {"id": "SN2", "x_m": 0.1, "railpad_stiffness_N_m": {"mean": 9e7, "sd": 1e7},
         "flags": ["outside_library"],
         "selector": {"railpad_stiffness_N_m": {"mean": 7e7, "sd": 2e7}, "mape": [0.1, 0.3]}}]}"#;

    #[test]
    fn an_evaluation_is_read_with_what_is_not_valid() {
        let estimated = Estimated::read(TEXT).unwrap();
        let railpad = Parameter::RailpadStiffness;
        assert_eq!(estimated.valid("SN1", railpad).unwrap().mean, 8e7);
        assert_eq!(estimated.valid("SN2", railpad), None);
        assert_eq!(estimated.any("SN2", railpad).unwrap().sd, 1e7);
        assert_eq!(estimated.any("SN3", railpad), None);
        let selector = Estimated::read_selector(TEXT).unwrap().unwrap();
        assert_eq!(selector.any("SN2", railpad).unwrap().mean, 7e7);
        assert_eq!((selector.mape("SN2"), estimated.mape("SN2")), (Some(0.2), None));
        assert!(Estimated::read("{}").is_err() && Estimated::read("[").is_err());
    }

    #[test]
    fn two_estimates_agree_within_the_interval_of_their_difference() {
        let estimate = |mean| Estimate { mean, sd: 3.0 };
        assert!(agree(estimate(10.0), estimate(16.9)) && !agree(estimate(10.0), estimate(17.1)));
        assert!(holds(estimate(10.0), 14.9) && !holds(estimate(10.0), 15.0));
        assert_eq!(median([3.0, 1.0, 2.0, 9.0]), Some(2.5));
        assert_eq!((median([]), mean([]), mean([1.0, 2.0])), (None, None, Some(1.5)));
    }

    #[test]
    fn values_in_proportion_correlate_and_opposite_ones_do_the_contrary() {
        let pairs = [(1.0, 2.0), (2.0, 4.0), (4.0, 8.0)];
        assert!((correlation(&pairs).unwrap() - 1.0).abs() < 1e-12);
        let opposite = pairs.map(|(x, y)| (x, -y));
        assert!((correlation(&opposite).unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&[(1.0, 2.0), (1.0, 3.0)]), None);
    }
}
