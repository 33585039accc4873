//! Comparison of the stiffness without load (hammer test) with the stiffness under a wheel (evaluation).

use crate::record::HammerRecord;
use serde::Deserialize;
use std::collections::BTreeMap;
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;

/// Compared parameters, in the order of the report pages.
const COMPARED: [Parameter; 2] = [Parameter::RailpadStiffness, Parameter::BallastStiffness];

/// Two estimates differ beyond chance if they differ by more than this number of standard deviations of
/// their difference; by chance one pair in 370 does.
const BEYOND_CHANCE: f64 = 3.0;

/// Largest distance of two positions of the same sleeper, as a share of the spacing.
const SAME_PLACE: f64 = 0.25;

/// Required value of the field `format` in the file of an evaluation.
const FORMAT: &str = "tracktwin-evaluation/1";

/// Flags of sleepers that are not compared: the estimates are not valid, or the wheel lost contact.
const NOT_COMPARED: [&str; 2] = ["outside_library", "loss_of_contact"];
/// Flag of sleepers whose railpad is too stiff to be resolved.
const NOT_RESOLVED: &str = "railpad_not_resolved";

/// The estimates of an evaluation, read from `evaluation.json`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Loaded {
    format: String,
    /// Name of the recording.
    pub recording: String,
    /// Sleepers of the recording.
    pub sleepers: Vec<LoadedSleeper>,
}

/// A sleeper of an evaluation.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct LoadedSleeper {
    /// Id of the sleeper.
    pub id: String,
    /// Position along the track in m.
    pub x_m: f64,
    #[serde(default)]
    flags: Vec<String>,
    /// Mean and standard deviation by parameter, among other fields.
    #[serde(flatten)]
    fields: BTreeMap<String, serde_json::Value>,
}

/// Reason why an evaluation cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum BesideError {
    /// The text is not the JSON of an evaluation.
    #[error("not a file of `tracktwin evaluate`: {0}")]
    Format(#[from] serde_json::Error),
    /// The file has another format.
    #[error("the format is `{found}`, not `{FORMAT}`; evaluate the recording again")]
    OtherFormat {
        /// Format found in the file.
        found: String,
    },
}

/// Comparison of one parameter without and under load.
#[derive(Clone, Debug, PartialEq)]
pub struct Beside {
    /// The parameter.
    pub parameter: Parameter,
    /// Number of sleepers with valid estimates in both.
    pub sleepers: usize,
    /// Ids of the sleepers at which the two estimates differ beyond chance.
    pub differ: Vec<String>,
    /// Ratio of the value under load to the value without load (geometric mean over the sleepers), and the
    /// lower and upper end of its 90 % interval. The errors of neighbouring sleepers count as one error.
    pub ratio: [f64; 3],
    /// Whether the mean ratio differs from one beyond chance.
    pub mean_differs: bool,
    /// Whether the stiffness is higher under load: in the mean if `mean_differs`, otherwise on average over
    /// the sleepers in `differ`.
    pub is_stiffer: bool,
}

impl Loaded {
    /// Parses the text of an `evaluation.json`.
    ///
    /// # Errors
    /// [`BesideError::Format`] with the error of the parser, or [`BesideError::OtherFormat`].
    pub fn parse(text: &str) -> Result<Self, BesideError> {
        let loaded: Self = serde_json::from_str(text)?;
        if loaded.format == FORMAT {
            Ok(loaded)
        } else {
            Err(BesideError::OtherFormat { found: loaded.format })
        }
    }

    /// The sleeper at the position `x_m` in m, within a quarter of `spacing_m` (spacing of the track in m).
    pub fn at(&self, x_m: f64, spacing_m: f64) -> Option<&LoadedSleeper> {
        let distance_m = |sleeper: &&LoadedSleeper| (sleeper.x_m - x_m).abs();
        let nearest = self.sleepers.iter().min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        nearest.filter(|sleeper| distance_m(sleeper) <= SAME_PLACE * spacing_m)
    }
}

impl LoadedSleeper {
    /// Mean and standard deviation of a parameter, in its unit. `None` if the estimates are not valid, if
    /// the wheel lost contact, or if a railpad is too stiff to be resolved.
    pub fn estimate(&self, parameter: Parameter) -> Option<[f64; 2]> {
        let is_railpad = parameter == Parameter::RailpadStiffness;
        let is_left_out = |flag: &String| {
            NOT_COMPARED.contains(&flag.as_str()) || (is_railpad && flag == NOT_RESOLVED)
        };
        if self.flags.iter().any(is_left_out) {
            return None;
        }
        let field = self.fields.get(&parameter.to_string())?;
        let number = |name: &str| field.get(name)?.as_f64().filter(|value| *value > 0.0);
        Some([number("mean")?, number("sd")?])
    }

    /// Mean and standard deviation of the logarithm, for a log-normal estimate.
    fn logarithm(&self, parameter: Parameter) -> Option<[f64; 2]> {
        let [mean, sd] = self.estimate(parameter)?;
        let variance = (sd / mean).powi(2).ln_1p();
        Some([mean.ln() - 0.5 * variance, variance.sqrt()])
    }
}

/// Compares the estimates at every sleeper that is valid in both; `spacing_m` is the sleeper spacing in m.
pub fn beside(record: &HammerRecord, loaded: &Loaded, spacing_m: f64) -> Vec<Beside> {
    let of = |parameter: Parameter| {
        let mut differ = Vec::new();
        let (mut difference, mut variance, mut sleepers) = (0.0, 0.0, 0_usize);
        let mut of_differing = 0.0;
        for sleeper in record.sleepers.iter().filter(|sleeper| sleeper.is_valid()) {
            let other = loaded.at(sleeper.x_m, spacing_m).and_then(|it| it.logarithm(parameter));
            let (Some([under_load, sd]), Some(without)) =
                (other, sleeper.estimates.get(&parameter))
            else {
                continue;
            };
            let change = under_load - without.estimate.ln();
            let both = sd.hypot(without.log_deviation());
            difference += change;
            variance += both * both;
            sleepers += 1;
            if change.abs() > BEYOND_CHANCE * both {
                differ.push(sleeper.id.clone());
                of_differing += change;
            }
        }
        (sleepers > 0).then(|| {
            let count = sleepers as f64;
            let (mean, deviation) = (difference / count, (variance / count).sqrt());
            let end = |way: f64| (mean + way * NORMAL_90 * deviation).exp();
            let ratio = [mean.exp(), end(-1.0), end(1.0)];
            let mean_differs = mean.abs() > BEYOND_CHANCE * deviation;
            let is_stiffer = if mean_differs { mean > 0.0 } else { of_differing > 0.0 };
            Beside { parameter, sleepers, differ, ratio, mean_differs, is_stiffer }
        })
    };
    COMPARED.into_iter().filter_map(of).collect()
}

impl Beside {
    /// Whether the estimates differ at more sleepers than chance allows, or in the mean.
    pub fn differs(&self) -> bool {
        self.sleepers_differ() || self.mean_differs
    }

    /// Whether the estimates differ at more sleepers than chance allows.
    fn sleepers_differ(&self) -> bool {
        self.differ.len() > 1 + self.sleepers / 50
    }

    /// The comparison in a sentence.
    pub fn sentence(&self) -> String {
        let label = self.parameter.label();
        let [ratio, low, high] = self.ratio;
        let numbers = format!(
            "{label}: under the wheel {ratio:.2} times that under the hammer (90 % interval {low:.2} \
             to {high:.2}, {} sleepers)",
            self.sleepers
        );
        if !self.differs() {
            return format!("{numbers}; the difference may be chance.");
        }
        let at = || format!("at {}", self.differ.join(", "));
        let places = match (self.mean_differs, self.sleepers_differ()) {
            (true, true) => format!("in the mean and {}", at()),
            (true, false) => "in the mean".to_owned(),
            (false, _) => at(),
        };
        format!("{numbers}; beyond chance {places}; possible reason: {}.", self.reason())
    }

    /// Possible reason for the difference.
    const fn reason(&self) -> &'static str {
        let is_railpad = matches!(self.parameter, Parameter::RailpadStiffness);
        match (is_railpad, self.is_stiffer) {
            (true, true) => "railpads stiffen with load",
            (false, true) => "the load of the wheel closes gaps below sleepers",
            (true, false) => {
                "an error in one of the measurements or in the track file, for load does not soften \
                 railpads"
            }
            (false, false) => {
                "an error in one of the measurements or in the track file, for load does not soften \
                 ballast"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded(format: &str, flags: &str) -> Result<Loaded, BesideError> {
        let stiffness = r#"{"mean": 1e8, "sd": 1e7}"#;
        Loaded::parse(&format!(
            r#"{{"format": "{format}", "recording": "ride", "sleepers": [{{"id": "A", "x_m": 1.0,
            "railpad_stiffness_N_m": {stiffness}, "ballast_stiffness_N_m": {stiffness},
            "flags": [{flags}]}}]}}"#
        ))
    }

    #[test]
    fn flags_say_which_estimates_are_compared() {
        for (flags, railpad, ballast) in [
            ("", true, true),
            (r#""at_edge_of_range""#, true, true),
            (r#""railpad_not_resolved""#, false, true),
            (r#""loss_of_contact""#, false, false),
            (r#""outside_library""#, false, false),
        ] {
            let loaded = loaded(FORMAT, flags).unwrap();
            let sleeper = loaded.at(1.01, 0.125).unwrap();
            let is_there = |parameter| sleeper.estimate(parameter).is_some();
            assert_eq!(is_there(Parameter::RailpadStiffness), railpad, "{flags}");
            assert_eq!(is_there(Parameter::BallastStiffness), ballast, "{flags}");
        }
    }

    #[test]
    fn another_format_is_refused() {
        let refused = loaded("tracktwin-evaluation/9", "").unwrap_err().to_string();
        assert!(refused.contains("evaluation/9"), "{refused}");
    }

    #[test]
    fn a_sentence_says_where_both_differ_and_a_reason_of_the_parameter() {
        let ballast = Beside {
            parameter: Parameter::BallastStiffness,
            sleepers: 20,
            differ: vec!["A".into(), "B".into()],
            ratio: [1.1, 0.9, 1.3],
            mean_differs: false,
            is_stiffer: true,
        };
        let sentence = ballast.sentence();
        assert!(ballast.differs() && sentence.contains("chance at A, B;"), "{sentence}");
        assert!(sentence.ends_with("gaps below sleepers."), "{sentence}");
        let mean = Beside { differ: vec!["A".into()], mean_differs: true, ..ballast };
        assert!(mean.sentence().contains("beyond chance in the mean;"), "{}", mean.sentence());
        let chance = Beside { differ: vec!["A".into()], ..ballast };
        assert!(chance.sentence().ends_with("may be chance."), "{}", chance.sentence());
    }
}
