//! Record of an inversion, from which files and pages are made.

use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_diagnosis::{FoundSupportChange, SleeperPattern, Variation, separate_wavelengths};
use tracktwin_evaluation::{Estimate, Estimates, FORMAT, Flag, Unevaluated};
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;

/// Value of the field `method` in `evaluation.json`.
pub const METHOD: &str = "inversion";

/// Parameters that differ from sleeper to sleeper, in the order of the report pages.
pub const PER_SLEEPER: [Parameter; 3] =
    [Parameter::RailpadStiffness, Parameter::BallastStiffness, Parameter::IrregularityLevel];

/// Parameters that all sleepers of a section share, in the order of the report pages.
pub const COMMON: [Parameter; 3] =
    [Parameter::SleeperBendingStiffness, Parameter::RailpadDamping, Parameter::BallastDamping];

/// The track's parameters along a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inversion {
    /// Always [`FORMAT`].
    pub format: &'static str,
    /// Name of the recording.
    pub recording: String,
    /// Always [`METHOD`].
    pub method: &'static str,
    /// Data and priors of the estimates.
    pub provenance: Provenance,
    /// The sleepers, along the track.
    pub sleepers: Vec<Sleeper>,
    /// Sleepers without estimates: at some speed no pass covers their window with a margin.
    pub unevaluated: Vec<Unevaluated>,
    /// Transitions and soft or stiff spots of the support, along the track.
    pub support_changes: Vec<FoundSupportChange>,
    /// Part of the recording that the track model does not explain.
    pub outside_library: Unexplained,
    /// The value of the measurement or of all sleepers that is farthest from what was expected.
    pub unusual: Option<Unusual>,
    /// Where the sleepers lie by the levels within a span, if these show it.
    pub sleeper_pattern: Option<SleeperPattern>,
    /// Notes on the result, one sentence each.
    pub notes: Vec<String>,
}

/// Data and priors of the estimates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Version of this program.
    pub code_version: &'static str,
    /// Speeds of the passes in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Number of passes at each of `speeds_km_h`.
    pub passes: Vec<usize>,
    /// Prior of the mean of every parameter, in the middle section.
    pub prior: BTreeMap<Parameter, Prior>,
    /// Variation between sleepers, estimated from the recording, in the middle section.
    pub variation: BTreeMap<Parameter, Along>,
}

/// A log-normal prior.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Prior {
    /// Median in the parameter's unit.
    pub median: f64,
    /// Standard deviation of the natural logarithm.
    pub log_sd: f64,
}

/// Variation of the natural logarithm of a parameter along the track.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Along {
    /// Standard deviation of the smooth part.
    pub smooth: f64,
    /// Correlation length of the smooth part, in sleepers.
    pub length_sleepers: f64,
    /// Standard deviation of the part that is independent from sleeper to sleeper.
    pub independent: f64,
}

impl From<Variation> for Along {
    fn from(Variation { smooth, length, independent }: Variation) -> Self {
        Self { smooth, length_sleepers: length, independent }
    }
}

/// A sleeper that was evaluated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sleeper {
    /// Id of the sleeper.
    pub id: String,
    /// Position along the track in m.
    pub x_m: f64,
    /// Posterior mean and standard deviation of every parameter. Bending stiffness and damping are common
    /// to the sleepers of a section.
    #[serde(flatten)]
    pub estimates: Estimates,
    /// Mean square of the whitened residual between measured and predicted levels; about 0.7 if the track model is
    /// valid.
    pub misfit: f64,
    /// Flags of the estimates.
    pub flags: Vec<Flag>,
}

/// A value of the measurement, or one that all sleepers share, that is far from what was expected. The
/// description of track, vehicle or sensor may be wrong.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unusual {
    /// Name of the quantity, with article.
    pub quantity: String,
    /// Fitted value divided by the expected one.
    pub ratio: f64,
    /// Distance of the logarithms in standard deviations of the prior.
    pub deviations: f64,
}

/// Parts of a record that sections give.
pub(crate) struct Parts {
    pub(crate) sleepers: Vec<Sleeper>,
    pub(crate) unevaluated: Vec<Unevaluated>,
    pub(crate) support_changes: Vec<FoundSupportChange>,
    pub(crate) unusual: Option<Unusual>,
    pub(crate) sleeper_pattern: Option<SleeperPattern>,
}

/// Part of a recording that the track model does not explain. The field names are those of an evaluation by
/// Gaussian processes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Unexplained {
    /// Share of the evaluated sleepers, 0 to 1.
    pub share: f64,
    /// Parameters whose range must be wider: always empty, because the prior has no limits.
    pub widen: Vec<Parameter>,
}

impl Unexplained {
    /// Share of unexplained sleepers from which the result as a whole is invalid.
    const MOST: f64 = 0.5;

    /// Whether the model does not explain half of the sleepers or more.
    pub fn is_most(&self) -> bool {
        self.share >= Self::MOST
    }
}

impl Sleeper {
    /// Whether the estimates are valid.
    pub fn is_valid(&self) -> bool {
        !self.flags.contains(&Flag::OutsideLibrary)
    }
}

impl Inversion {
    /// Makes the record from its parts.
    pub(crate) fn new(recording: String, provenance: Provenance, parts: Parts) -> Self {
        let Parts { sleepers, unevaluated, support_changes, unusual, sleeper_pattern } = parts;
        let invalid = sleepers.iter().filter(|sleeper| !sleeper.is_valid()).count();
        let share = invalid as f64 / sleepers.len().max(1) as f64;
        let mut inversion = Self {
            format: FORMAT,
            recording,
            method: METHOD,
            provenance,
            sleepers,
            unevaluated,
            support_changes,
            outside_library: Unexplained { share, widen: Vec::new() },
            unusual,
            sleeper_pattern,
            notes: Vec::new(),
        };
        inversion.notes = inversion.sentences();
        inversion
    }

    /// Sentence on the sleepers that the track model does not explain, as it stands in the notes. `None` if
    /// the estimates of all sleepers are valid.
    pub fn unexplained_sentence(&self) -> Option<String> {
        let unexplained = self.with(Flag::OutsideLibrary);
        (!unexplained.is_empty()).then(|| {
            format!(
                "The track model does not explain what was measured at {} of {} sleepers ({}): the \
                 estimates there are not valid. `tracktwin diagnose` says what may be missing.",
                unexplained.len(),
                self.sleepers.len(),
                listed(&unexplained)
            )
        })
    }

    /// Sentence on a value far from what was expected, as it stands in the notes.
    pub fn unusual_sentence(&self) -> Option<String> {
        let Unusual { quantity, ratio, deviations } = self.unusual.as_ref()?;
        Some(format!(
            "By the fit, {quantity} is {ratio:.2} times the expected value ({deviations:.1} standard deviations of \
             what is usual): the description of sensor, vehicle or track may be wrong, and with it all \
             estimates. Check unit and gain of the acceleration, unsprung mass, rail and sleepers."
        ))
    }

    /// Sentence on sleepers that do not lie at their stated positions, as it stands in the notes.
    pub fn misplaced_sentence(&self) -> Option<String> {
        self.sleeper_pattern.as_ref().and_then(SleeperPattern::doubt)
    }

    /// Sentences on a single speed, on an unusual value, on misplaced sleepers, on sleepers that the track model does not explain, on support changes,
    /// on sleepers that differ from their neighbours, and on those whose railpad is too stiff to be resolved.
    pub fn sentences(&self) -> Vec<String> {
        let apart = self.with(Flag::UnlikeNeighbours);
        let mut sentences = Vec::new();
        let speeds_km_h = &self.provenance.speeds_km_h;
        if let Some(speed_km_h) = speeds_km_h.first()
            && !separate_wavelengths(speeds_km_h)
        {
            sentences.push(format!(
                "One speed only ({speed_km_h:.0} km/h): stiffness and irregularity have similar effects, so that \
                 estimates and support changes may be wrong. Speeds whose ratio is below 1.2 count as one. Add a pass at \
                 another speed."
            ));
        }
        sentences.extend(self.unusual_sentence());
        sentences.extend(self.misplaced_sentence());
        sentences.extend(self.unexplained_sentence());
        sentences.extend(self.support_changes.iter().map(FoundSupportChange::sentence));
        if !apart.is_empty() {
            sentences.push(format!(
                "{} differ{} from the neighbouring sleepers by more than the track varies elsewhere.",
                listed(&apart),
                if apart.len() == 1 { "s" } else { "" }
            ));
        }
        let stiff = self.with(Flag::RailpadNotResolved);
        if !stiff.is_empty() {
            sentences.push(format!(
                "The railpad stiffness of {} is not resolved: stiffer railpads hardly change the recording. The true \
                 values exceed {:.0} MN/m with 95 % probability.",
                listed(&stiff),
                1e-6 * self.railpads_exceed()
            ));
        }
        sentences
    }

    /// Smallest 5 % quantile of the railpad stiffnesses that are not resolved, in N/m.
    fn railpads_exceed(&self) -> f64 {
        let flagged =
            self.sleepers.iter().filter(|it| it.flags.contains(&Flag::RailpadNotResolved));
        let quantile = |sleeper: &Sleeper| {
            let Estimate { mean, sd } = sleeper.estimates[&Parameter::RailpadStiffness];
            let variance = (sd / mean).powi(2).ln_1p();
            (mean.ln() - 0.5 * variance - NORMAL_90 * variance.sqrt()).exp()
        };
        flagged.map(quantile).fold(f64::INFINITY, f64::min)
    }

    fn with(&self, flag: Flag) -> Vec<&str> {
        let flagged = self.sleepers.iter().filter(|sleeper| sleeper.flags.contains(&flag));
        flagged.map(|sleeper| sleeper.id.as_str()).collect()
    }
}

/// The first ids, and the number of further ids.
fn listed(ids: &[&str]) -> String {
    const SHOWN: usize = 6;
    let first = ids[..ids.len().min(SHOWN)].join(", ");
    if ids.len() > SHOWN { format!("{first} and {} more", ids.len() - SHOWN) } else { first }
}

/// Mean and standard deviation of a log-normal variable, from mean and standard deviation of its logarithm.
pub(crate) fn log_normal(logarithm: f64, deviation: f64) -> Estimate {
    let variance = deviation * deviation;
    let mean = (logarithm + 0.5 * variance).exp();
    Estimate { mean, sd: mean * variance.exp_m1().sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_speed_and_an_unusual_gain_are_doubts() {
        let of = |speeds_km_h: &[f64], unusual: Option<Unusual>| {
            let provenance = Provenance {
                code_version: "1",
                speeds_km_h: speeds_km_h.to_vec(),
                passes: vec![1; speeds_km_h.len()],
                prior: BTreeMap::new(),
                variation: BTreeMap::new(),
            };
            let parts = Parts {
                sleepers: Vec::new(),
                unevaluated: Vec::new(),
                support_changes: Vec::new(),
                unusual,
                sleeper_pattern: None,
            };
            Inversion::new("ride".to_owned(), provenance, parts).notes
        };
        assert_eq!(of(&[10.0, 13.0], None), [""; 0]);
        assert_eq!(of(&[12.6, 13.0], None).len(), 1);
        let doubt = of(&[13.0], None);
        assert!(doubt[0].starts_with("One speed only (13 km/h): stiffness and"), "{doubt:?}");
        let quantity = "the power of the passes at 10 km/h".to_owned();
        let doubt = of(&[10.0, 13.0], Some(Unusual { quantity, ratio: 1.4, deviations: 6.7 }));
        assert!(doubt[0].contains("at 10 km/h is 1.40 times the expected value"), "{doubt:?}");
    }
}
