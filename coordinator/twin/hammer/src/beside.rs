//! Stiffness without load, from a hammer test, beside that under a wheel, from an evaluation.

use crate::record::HammerRecord;
use serde::Deserialize;
use std::collections::BTreeMap;
use tracktwin_parameters::Parameter;

/// Compared in the order of pages.
const COMPARED: [Parameter; 2] = [Parameter::RailpadStiffness, Parameter::BallastStiffness];

/// Standard deviations of their difference beyond which two estimates differ beyond chance: by
/// chance one in 370 does.
const BEYOND_CHANCE: f64 = 3.0;

/// Distance in m up to which two sleepers are one, as a share of the spacing.
const SAME_PLACE: f64 = 0.25;

/// Ends of a 90 % interval in standard deviations.
const NINETY_PER_CENT: f64 = 1.645;

/// The estimates of an evaluation, read from `evaluation.json`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Loaded {
    /// Name of the recording.
    pub recording: String,
    /// Its sleepers.
    pub sleepers: Vec<LoadedSleeper>,
}

/// A sleeper of an evaluation.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct LoadedSleeper {
    /// Its name.
    pub id: String,
    /// Its place along the track in m.
    pub x_m: f64,
    #[serde(default)]
    flags: Vec<String>,
    /// Mean and standard deviation by parameter, among other fields.
    #[serde(flatten)]
    fields: BTreeMap<String, serde_json::Value>,
}

/// Why an evaluation cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum BesideError {
    /// The file is not one of `evaluate`.
    #[error("not a file of `tracktwin evaluate`: {0}")]
    Format(#[from] serde_json::Error),
}

/// One parameter without load beside itself under load.
#[derive(Clone, Debug, PartialEq)]
pub struct Beside {
    /// The parameter.
    pub parameter: Parameter,
    /// Sleepers that both say something valid about.
    pub sleepers: usize,
    /// Those at which both differ beyond chance.
    pub differ: Vec<String>,
    /// Value under load over that without load, mean of the logarithms over the sleepers, and the
    /// ends of its 90 % interval; the errors of neighbouring sleepers count as one.
    pub ratio: [f64; 3],
}

impl Loaded {
    /// Reads the text of an `evaluation.json`.
    ///
    /// # Errors
    /// [`BesideError`] with the error of the parser.
    pub fn parse(text: &str) -> Result<Self, BesideError> {
        Ok(serde_json::from_str(text)?)
    }

    /// The sleeper at a place in m, on a track of this spacing in m.
    pub fn at(&self, x_m: f64, spacing_m: f64) -> Option<&LoadedSleeper> {
        let distance_m = |sleeper: &&LoadedSleeper| (sleeper.x_m - x_m).abs();
        let nearest = self.sleepers.iter().min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        nearest.filter(|sleeper| distance_m(sleeper) <= SAME_PLACE * spacing_m)
    }
}

impl LoadedSleeper {
    /// Mean and standard deviation of a parameter; none where the evaluation is not valid.
    pub fn estimate(&self, parameter: Parameter) -> Option<[f64; 2]> {
        if self.flags.iter().any(|flag| flag == "outside_library") {
            return None;
        }
        let field = self.fields.get(&parameter.to_string())?;
        let number = |name: &str| field.get(name)?.as_f64().filter(|value| *value > 0.0);
        Some([number("mean")?, number("sd")?])
    }

    /// Logarithm's median and standard deviation of the log-normal estimate.
    fn logarithm(&self, parameter: Parameter) -> Option<[f64; 2]> {
        let [mean, sd] = self.estimate(parameter)?;
        let variance = (sd / mean).powi(2).ln_1p();
        Some([mean.ln() - 0.5 * variance, variance.sqrt()])
    }
}

/// Compares both at every sleeper that both say something about; `spacing_m` is that of the track.
pub fn beside(record: &HammerRecord, loaded: &Loaded, spacing_m: f64) -> Vec<Beside> {
    let of = |parameter: Parameter| {
        let mut differ = Vec::new();
        let (mut difference, mut variance, mut sleepers) = (0.0, 0.0, 0_usize);
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
            }
        }
        (sleepers > 0).then(|| {
            let count = sleepers as f64;
            let (mean, deviation) = (difference / count, (variance / count).sqrt());
            let end = |way: f64| (mean + way * NINETY_PER_CENT * deviation).exp();
            let ratio = [mean.exp(), end(-1.0), end(1.0)];
            Beside { parameter, sleepers, differ, ratio }
        })
    };
    COMPARED.into_iter().filter_map(of).collect()
}

impl Beside {
    /// Whether both differ at more sleepers than chance allows, or in the mean.
    pub fn differs(&self) -> bool {
        let [_, low, high] = self.ratio;
        self.differ.len() > 1 + self.sleepers / 50 || low > 1.0 || high < 1.0
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
        let places = match self.differ.as_slice() {
            [] => "in the mean".to_owned(),
            all => format!("at {}", all.join(", ")),
        };
        let reason = if ratio > 1.0 {
            "railpads stiffen with load, and the load of the wheel closes gaps that the hammer leaves \
             open"
        } else {
            "load does not soften railpads or ballast: check both measurements and the track file"
        };
        format!("{numbers}; beyond chance {places}: {reason}.")
    }
}
