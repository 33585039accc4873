//! Record of the estimates of a hammer test, from which files and pages are made.

use crate::fit::Fitted;
use crate::unknowns::{GAIN_DEVIATION, Quantity};
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;

/// Value of the field `format` in `estimates.json`.
pub const FORMAT: &str = "tracktwin-hammer/1";

/// A value is resolved if its posterior standard deviation is below this share of the prior one.
const RESOLVED: f64 = 0.5;
/// A sleeper's deviation from the mean is resolved if its posterior standard deviation is below this share
/// of the prior one.
const OWN: f64 = 0.8;

/// Limit of a sleeper's misfit (mean square of its residuals over its expectation); above it the track
/// model does not explain the receptances.
const MISFIT_MAX: f64 = 4.0;

/// The gain is far from one if the logarithm of its estimate exceeds this number of the standard deviations
/// that the prior predicts for it; by chance one record in 370 does.
const GAIN_FAR: f64 = 3.0;

/// The estimates of a hammer test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HammerRecord {
    /// Always [`FORMAT`].
    pub format: &'static str,
    /// Version of this program.
    pub code_version: &'static str,
    /// Name of the track description.
    pub track: String,
    /// Number of fitted receptances.
    pub receptances: usize,
    /// Lowest and highest fitted frequency in Hz.
    #[serde(rename = "range_Hz")]
    pub range_hz: [f64; 2],
    /// Gain of the measurement, estimated from the test.
    pub gain: Gain,
    /// Standard deviation of the model error in dB, estimated from the test.
    #[serde(rename = "model_error_dB")]
    pub model_error_db: f64,
    /// Standard deviation of the logarithm of a stiffness from sleeper to sleeper, estimated from the test.
    pub unevenness: BTreeMap<Parameter, f64>,
    /// Prior: median in SI units, and standard deviation of the logarithm.
    pub prior: BTreeMap<Parameter, [f64; 2]>,
    /// The sleepers along the track.
    pub sleepers: Vec<Sleeper>,
    /// Notes on the result, one sentence each.
    pub notes: Vec<String>,
}

/// Ratio of measured to true receptance, common to the whole test, with its 90 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gain {
    /// Median of the posterior.
    pub estimate: f64,
    /// Lower end of the 90 % interval.
    pub lower: f64,
    /// Upper end of the 90 % interval.
    pub upper: f64,
    /// Whether the gain is farther from one than the error of a calibration; the calibration or the rail of
    /// the track file is wrong then, and no estimate of the test is valid.
    pub is_far: bool,
}

/// Estimates of one sleeper.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sleeper {
    /// Id of the sleeper.
    pub id: String,
    /// Position along the track in m.
    pub x_m: f64,
    /// Estimates by parameter.
    #[serde(flatten)]
    pub estimates: BTreeMap<Parameter, Interval>,
    /// Mean square of the residuals of the sleeper's receptances, divided by its expectation for a model
    /// error of 0.4 dB; about one if the track model is valid. `None` if there was no hit near the sleeper.
    pub misfit: Option<f64>,
    /// Flags of the estimates.
    pub flags: Vec<SleeperFlag>,
}

/// Limitation of the estimates of a sleeper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SleeperFlag {
    /// No receptance was measured above the sleeper or at midspan beside it.
    NotStruck,
    /// The track model does not explain the receptances of the sleeper; the estimates are not valid.
    Unexplained,
    /// The gain of the test is far from one; the estimates of all sleepers are not valid.
    Calibration,
}

/// An estimate with its 90 % interval, in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Median of the posterior.
    pub estimate: f64,
    /// Lower end of the 90 % interval.
    pub lower: f64,
    /// Upper end of the 90 % interval.
    pub upper: f64,
    /// Whether the test resolves the value: the posterior standard deviation is less than half of the prior
    /// one.
    pub resolved: bool,
    /// Whether the test resolves the sleeper's deviation from the mean of all sleepers.
    pub own: bool,
}

impl Gain {
    /// Gain from the mean and the standard deviation of its logarithm.
    fn new(logarithm: f64, deviation: f64) -> Self {
        let Interval { estimate, lower, upper, .. } = Interval::new(logarithm, deviation);
        let posterior = deviation.powi(2);
        // A test that does not tell the gain cannot find it far from one.
        let predicted = (GAIN_DEVIATION.powi(2) - posterior).max(posterior);
        let is_far = logarithm.powi(2) > GAIN_FAR.powi(2) * predicted;
        Self { estimate, lower, upper, is_far }
    }

    /// The gain in a sentence.
    fn sentence(&self) -> String {
        let Self { estimate, lower, upper, is_far } = self;
        let numbers = format!(
            "By the fit the measured receptances are {estimate:.3} times the true ones (90 % interval \
             {lower:.3} to {upper:.3})"
        );
        if *is_far {
            format!(
                "{numbers}; that is far from 1: check the calibration of hammer and accelerometer, and the \
                 rail of the track file. The estimates are not valid."
            )
        } else {
            format!("{numbers}; the estimates allow for that.")
        }
    }
}

impl Interval {
    /// Interval from the mean and the standard deviation of the logarithm.
    fn new(logarithm: f64, deviation: f64) -> Self {
        let end = |way: f64| (logarithm + way * NORMAL_90 * deviation).exp();
        Self {
            estimate: logarithm.exp(),
            lower: end(-1.0),
            upper: end(1.0),
            resolved: false,
            own: false,
        }
    }

    /// Standard deviation of the logarithm.
    pub fn log_deviation(&self) -> f64 {
        (self.upper / self.lower).ln() / (2.0 * NORMAL_90)
    }
}

impl Sleeper {
    /// Whether the estimates are valid.
    pub fn is_valid(&self) -> bool {
        let is_invalid =
            |flag| matches!(flag, &SleeperFlag::Unexplained | &SleeperFlag::Calibration);
        !self.flags.iter().any(is_invalid)
    }
}

impl SleeperFlag {
    /// Name of the flag in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotStruck => "not_struck",
            Self::Unexplained => "unexplained",
            Self::Calibration => "calibration",
        }
    }
}

impl HammerRecord {
    /// Makes the record of a fitted track. `names` maps the number and the position in m of a sleeper to
    /// its id.
    pub fn new(
        fitted: &Fitted,
        track: &str,
        range_hz: [f64; 2],
        receptances: usize,
        names: impl Fn(i64, f64) -> String,
    ) -> Self {
        let unknowns = &fitted.unknowns;
        let (logarithm, deviation) = fitted.gain();
        let gain = Gain::new(logarithm, deviation);
        let numbers = (0..fitted.layout.reported).zip(fitted.layout.first..);
        let sleepers = numbers.map(|(index, number)| {
            let x_m = fitted.layout.place_m(number);
            Sleeper { id: names(number, x_m), x_m, ..fitted.sleeper(index, gain.is_far) }
        });
        let sleepers: Vec<Sleeper> = sleepers.collect();
        let unevenness = Quantity::LEARNED
            .map(|of| (of.parameter(), unknowns.unevenness[of as usize]))
            .into_iter()
            .collect();
        let prior =
            |of: Quantity| (of.parameter(), [unknowns.median(of), unknowns.prior_deviation(of)]);
        let mut record = Self {
            format: FORMAT,
            code_version: env!("CARGO_PKG_VERSION"),
            track: track.to_owned(),
            receptances,
            range_hz,
            gain,
            model_error_db: 20.0 / std::f64::consts::LN_10 * fitted.model_error,
            unevenness,
            prior: Quantity::ALL.map(prior).into_iter().collect(),
            sleepers,
            notes: Vec::new(),
        };
        record.notes = record.sentences();
        record
    }

    /// Sentences on the gain, on receptances that the model does not explain and on values that the test
    /// does not resolve.
    fn sentences(&self) -> Vec<String> {
        let flagged = |flag: SleeperFlag| -> Vec<&str> {
            let all = self.sleepers.iter().filter(|sleeper| sleeper.flags.contains(&flag));
            all.map(|sleeper| sleeper.id.as_str()).collect()
        };
        let mut sentences = vec![self.gain.sentence()];
        let unexplained = flagged(SleeperFlag::Unexplained);
        if !unexplained.is_empty() {
            sentences.push(format!(
                "The track model does not explain the receptances at {}: the estimates there are \
                 not valid.",
                unexplained.join(", ")
            ));
        }
        let not_struck = flagged(SleeperFlag::NotStruck);
        if !not_struck.is_empty() {
            sentences.push(format!(
                "No receptance was measured at {}: the estimates there rest on the neighbours.",
                not_struck.join(", ")
            ));
        }
        for of in Quantity::ALL.map(Quantity::parameter) {
            let all = self.sleepers.iter().filter_map(|sleeper| sleeper.estimates.get(&of));
            let (told, count) =
                all.fold((0, 0), |(told, count), it| (told + usize::from(it.resolved), count + 1));
            if told < count {
                sentences.push(format!(
                    "The test does not tell the {} of {} of {count} sleepers: the interval is more than \
                     half as wide as before the test.",
                    of.label(),
                    count - told
                ));
            }
        }
        sentences
    }
}

impl Fitted {
    /// A reported sleeper without id and position; `is_far` states whether the gain is far from one.
    fn sleeper(&self, index: usize, is_far: bool) -> Sleeper {
        let estimate = |of: Quantity| {
            let (logarithm, deviation) = self.logarithm(of, index);
            let interval = Interval {
                resolved: deviation < RESOLVED * self.unknowns.prior_deviation(of),
                own: self.own_share(of, index) < OWN,
                ..Interval::new(logarithm, deviation)
            };
            (of.parameter(), interval)
        };
        let misfit = self.misfit(index);
        let mut flags = match misfit {
            None => vec![SleeperFlag::NotStruck],
            Some(misfit) if misfit > MISFIT_MAX => vec![SleeperFlag::Unexplained],
            Some(_) => Vec::new(),
        };
        flags.extend(is_far.then_some(SleeperFlag::Calibration));
        Sleeper {
            id: String::new(),
            x_m: 0.0,
            estimates: Quantity::ALL.map(estimate).into_iter().collect(),
            misfit,
            flags,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_gain_that_the_test_tells_is_far() {
        // The third is drawn to one by the prior, the last is the prior itself.
        for (logarithm, deviation, is_far) in
            [(0.10, 0.01, false), (-0.20, 0.01, true), (0.13, 0.03, true), (0.05, 0.05, false)]
        {
            let gain = Gain::new(logarithm, deviation);
            assert_eq!(gain.is_far, is_far, "{gain:?}");
            assert_eq!(gain.sentence().contains("check the calibration"), is_far, "{gain:?}");
        }
    }
}
