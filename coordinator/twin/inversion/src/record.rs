//! What an evaluation by the physics says: the record that files and pages are made of.

use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_diagnosis::Variation;
use tracktwin_evaluation::{Estimate, Estimates, FORMAT, Flag, Unevaluated};
use tracktwin_parameters::Parameter;

/// How the estimates were made, as `evaluation.json` has it.
pub const METHOD: &str = "inversion";

/// What differs from sleeper to sleeper, in the order of pages.
pub const PER_SLEEPER: [Parameter; 3] =
    [Parameter::RailpadStiffness, Parameter::BallastStiffness, Parameter::IrregularityLevel];

/// What the sleepers of a section have in common, in the order of pages.
pub const COMMON: [Parameter; 3] =
    [Parameter::SleeperBendingStiffness, Parameter::RailpadDamping, Parameter::BallastDamping];

/// The track's parameters along a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inversion {
    /// [`FORMAT`].
    pub format: &'static str,
    /// The recording's name.
    pub recording: String,
    /// [`METHOD`].
    pub method: &'static str,
    /// What the estimates rest on.
    pub provenance: Provenance,
    /// The sleepers, along the track.
    pub sleepers: Vec<Sleeper>,
    /// The sleepers that not every pass covers with a margin.
    pub unevaluated: Vec<Unevaluated>,
    /// What of the recording the track model does not explain.
    pub outside_library: Unexplained,
    /// What to keep in mind, in sentences.
    pub notes: Vec<String>,
}

/// What the estimates rest on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Version of this program.
    pub code_version: &'static str,
    /// Speeds of the passes in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Passes at each of them.
    pub passes: Vec<usize>,
    /// What was known of each parameter's mean before the recording.
    pub prior: BTreeMap<Parameter, Prior>,
    /// How much sleepers differ, as the recording tells.
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

/// Variation of the natural logarithm along the track.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Along {
    /// Standard deviation of the smooth part.
    pub smooth: f64,
    /// Its correlation length in sleepers.
    pub length_sleepers: f64,
    /// Standard deviation of what differs from sleeper to sleeper.
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
    /// Its name.
    pub id: String,
    /// Its place along the track in m.
    pub x_m: f64,
    /// Posterior mean and standard deviation. Bending stiffness and dampings are common to the
    /// sleepers of a section.
    #[serde(flatten)]
    pub estimates: Estimates,
    /// Mean square of the residual between measured and predicted levels over what it is expected to
    /// be: about one where the track model holds.
    pub misfit: f64,
    /// What to keep in mind about it.
    pub flags: Vec<Flag>,
}

/// What of a recording the track model does not explain; the name of the fields is that of an
/// evaluation by a library's models.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Unexplained {
    /// Share of the evaluated sleepers, 0 to 1.
    pub share: f64,
    /// Parameters whose range must be wider: none, for the prior has no ends.
    pub widen: Vec<Parameter>,
}

impl Unexplained {
    /// Share of the sleepers from which the answer as a whole is negative.
    const MOST: f64 = 0.5;

    /// Whether most of the track is not explained.
    pub fn is_most(&self) -> bool {
        self.share >= Self::MOST
    }
}

impl Sleeper {
    /// Whether the estimates mean anything.
    pub fn is_valid(&self) -> bool {
        !self.flags.contains(&Flag::OutsideLibrary)
    }
}

impl Inversion {
    /// The record of these parts.
    pub(crate) fn new(
        recording: String,
        provenance: Provenance,
        sleepers: Vec<Sleeper>,
        unevaluated: Vec<Unevaluated>,
    ) -> Self {
        let invalid = sleepers.iter().filter(|sleeper| !sleeper.is_valid()).count();
        let share = invalid as f64 / sleepers.len().max(1) as f64;
        let mut inversion = Self {
            format: FORMAT,
            recording,
            method: METHOD,
            provenance,
            sleepers,
            unevaluated,
            outside_library: Unexplained { share, widen: Vec::new() },
            notes: Vec::new(),
        };
        inversion.notes = inversion.sentences();
        inversion
    }

    /// What the track model does not explain, and what lies apart from its neighbours, in sentences.
    pub fn sentences(&self) -> Vec<String> {
        let unexplained = self.with(Flag::OutsideLibrary);
        let apart = self.with(Flag::UnlikeNeighbours);
        let mut sentences = Vec::new();
        if !unexplained.is_empty() {
            sentences.push(format!(
                "The track model does not explain what was measured at {} of {} sleepers ({}): the \
                 estimates there are not valid. `tracktwin diagnose` says what may be missing.",
                unexplained.len(),
                self.sleepers.len(),
                listed(&unexplained)
            ));
        }
        if !apart.is_empty() {
            sentences.push(format!(
                "{} differ{} from the neighbouring sleepers by more than the track varies elsewhere.",
                listed(&apart),
                if apart.len() == 1 { "s" } else { "" }
            ));
        }
        let stiff = self.with(Flag::RailpadAtLeast);
        if !stiff.is_empty() {
            sentences.push(format!(
                "The railpad stiffness of {} is a lower bound: stiffer railpads hardly change the recording.",
                listed(&stiff)
            ));
        }
        sentences
    }

    fn with(&self, flag: Flag) -> Vec<&str> {
        let flagged = self.sleepers.iter().filter(|sleeper| sleeper.flags.contains(&flag));
        flagged.map(|sleeper| sleeper.id.as_str()).collect()
    }
}

/// The first names, and how many more.
fn listed(ids: &[&str]) -> String {
    const SHOWN: usize = 6;
    let first = ids[..ids.len().min(SHOWN)].join(", ");
    if ids.len() > SHOWN { format!("{first} and {} more", ids.len() - SHOWN) } else { first }
}

/// A log-normal value in its unit: mean and standard deviation.
pub(crate) fn log_normal(logarithm: f64, deviation: f64) -> Estimate {
    let variance = deviation * deviation;
    let mean = (logarithm + 0.5 * variance).exp();
    Estimate { mean, sd: mean * variance.exp_m1().sqrt() }
}
