//! The diagnosis as files and pages have it (`tracktwin-diagnosis/1`).

use crate::behaviour::Element;
use crate::estimate::Estimate;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use tracktwin_inspection::chain::LossOfContact;

/// Name and version of the format.
pub const FORMAT: &str = "tracktwin-diagnosis/1";

/// Physics that is not in the catalogue.
pub const UNKNOWN: &str = "unknown_physics";

/// Verdict of the comparison with the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The re-tuned baseline explains it.
    Consistent,
    /// Physics of a known kind was left out.
    LeftOutPhysics,
    /// Something was left out that no known kind explains.
    UnknownPhysics,
    /// The sensor, its mounting, the clock or the odometer did it.
    MeasurementChain,
}

impl Verdict {
    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::LeftOutPhysics => "left_out_physics",
            Self::UnknownPhysics => "unknown_physics",
            Self::MeasurementChain => "measurement_chain",
        }
    }
}

/// A diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// [`FORMAT`].
    pub format: String,
    /// Name of the recording.
    pub recording: String,
    /// What it is.
    pub verdict: Verdict,
    /// The verdict in a sentence that needs no further reading.
    pub sentence: String,
    /// Probability that nothing is left out; none where no model of the track was compared.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub nothing_left_out: Option<f64>,
    /// Where recording and re-tuned baseline differ.
    pub mismatches: Vec<Mismatch>,
    /// Hypotheses, most probable first.
    pub hypotheses: Vec<Hypothesis>,
    /// How well recording and model agree, before and after.
    pub fit: FitScores,
    /// Parameters without and with the accepted physics.
    pub bias_removed: BTreeMap<String, BeforeAfter<f64>>,
    /// The stiffness along the track.
    pub track: Vec<SleeperValues>,
    /// Measured and predicted levels.
    pub levels: Levels,
    /// Comparison of what was accepted with passes that were withheld from the search, in the time domain;
    /// none unless it was asked for and something accepted shows in a simulated pass.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub confirmation: Option<Confirmation>,
    /// Where the wheel loses contact with the rail; what was fitted there does not hold.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub loss_of_contact: Option<LossOfContact>,
    /// Notes.
    pub notes: Vec<String>,
}

/// A comparison with passes that were withheld from the search, by simulation in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confirmation {
    /// The files of the withheld passes.
    pub passes: Vec<String>,
    /// How far levels and simulations differ at each speed.
    pub speeds: Vec<ConfirmedSpeed>,
    /// Number of sleepers compared: where what was accepted is felt.
    pub sleepers: usize,
    /// By how much more probable the withheld passes are with what was accepted, in nats.
    pub gain_nats: f64,
    /// Whether that is enough to confirm it.
    pub is_confirmed: bool,
}

/// The withheld passes of one speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConfirmedSpeed {
    /// Speed in km/h.
    pub speed_km_h: f64,
    /// Root mean square difference of levels without what was accepted, in dB.
    #[serde(rename = "before_dB")]
    pub before_db: f64,
    /// The same with it.
    #[serde(rename = "after_dB")]
    pub after_db: f64,
}

/// A place in space and frequency where recording and baseline differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mismatch {
    /// From where to where along the track in m.
    pub x_m: [f64; 2],
    /// The sleepers there.
    pub sleepers: Vec<String>,
    /// From which frequency to which, in Hz.
    #[serde(rename = "frequency_Hz")]
    pub frequency_hz: [f64; 2],
    /// At which speeds.
    pub speeds_km_h: Vec<f64>,
    /// Root mean square difference of the levels there in dB.
    #[serde(rename = "level_dB")]
    pub level_db: f64,
    /// Probability to see as much anywhere if nothing is left out.
    pub p_value: f64,
}

/// A piece of physics that may be left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Its name in the catalogue.
    pub physics: String,
    /// The family of effects that it belongs to, by the part of track, vehicle or measurement that differs;
    /// `unknown_…` of what is unknown.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub family: Option<String>,
    /// Probability that something of this family is present at the place.
    #[serde(default)]
    pub family_probability: f64,
    /// Probability that it is present.
    pub probability: f64,
    /// Whether it was accepted: its name is in the sentence.
    pub accepted: bool,
    /// Where it is.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub location: Option<Location>,
    /// Of something unknown, where in the model it acts: `rail_seat`, `between_rail_seats`, `wheel`,
    /// `rail_surface` or `wheel_surface`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub port: Option<String>,
    /// Of something unknown, the element that it behaves like, with its parameters below.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub behaviour: Option<Element>,
    /// Its parameters.
    pub parameters: BTreeMap<String, Estimate>,
    /// Values of further parameters that were tried as they are, not fitted.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub assumed: BTreeMap<String, f64>,
    /// What looks alike.
    pub look_alikes: Vec<String>,
    /// Measurement that separates it from them.
    pub would_separate: String,
    /// Length of its trace over the scatter, after re-tuning.
    pub detectability: f64,
    /// Logarithm of the evidence for it against the model without it, in nats.
    pub log_evidence: f64,
}

/// A place on the track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Location {
    /// From where to where in m.
    pub x_m: [f64; 2],
    /// The sleepers there.
    pub sleepers: Vec<String>,
}

/// Whether two places have a sleeper in common; none is everywhere.
pub(crate) fn meet(one: Option<&Location>, other: Option<&Location>) -> bool {
    let (Some(one), Some(other)) = (one, other) else { return true };
    one.sleepers.iter().any(|sleeper| other.sleepers.contains(sleeper))
}

/// Without and with what was named.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeforeAfter<T> {
    /// The re-tuned baseline alone.
    pub before: T,
    /// With what was named.
    pub after: T,
}

/// Mean log predictive densities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitScores {
    /// What the scores are.
    pub score: String,
    /// The re-tuned baseline.
    pub before: Scores,
    /// With what was named.
    pub after: Scores,
    /// Gain on each speed held out in nats, over all its log powers.
    pub held_out_gain_nats: BTreeMap<String, f64>,
}

/// Scores of one model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// On what it was fitted to.
    pub in_sample: Score,
    /// On speeds that it was not fitted to; none with a single speed.
    pub held_out: Option<Score>,
}

/// A score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Mean log density per band and sleeper in nats; higher is better.
    pub score: f64,
}

/// Parameters of a sleeper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SleeperValues {
    /// Name of the sleeper.
    pub id: String,
    /// Its place in m.
    pub x_m: f64,
    /// Railpad stiffness in N/m.
    #[serde(rename = "railpad_stiffness_N_m")]
    pub railpad_stiffness: BeforeAfter<Estimate>,
    /// Ballast stiffness in N/m.
    #[serde(rename = "ballast_stiffness_N_m")]
    pub ballast_stiffness: BeforeAfter<Estimate>,
    /// Irregularity level.
    pub irregularity_level: BeforeAfter<Estimate>,
    /// Flags: `loss_of_contact` where the wheel loses contact.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub flags: Vec<String>,
}

/// Levels in dB re 1 (m/s2)2: `[speed][sleeper][band]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Levels {
    /// Centres of the bands.
    #[serde(rename = "frequency_Hz")]
    pub frequency_hz: Vec<f64>,
    /// Speeds.
    pub speeds_km_h: Vec<f64>,
    /// Recorded.
    #[serde(rename = "measured_dB")]
    pub measured_db: Vec<Vec<Vec<f64>>>,
    /// Predicted by the re-tuned baseline.
    #[serde(rename = "before_dB")]
    pub before_db: Vec<Vec<Vec<f64>>>,
    /// Predicted with what was named.
    #[serde(rename = "after_dB")]
    pub after_db: Vec<Vec<Vec<f64>>>,
    /// Scatter to expect of one log power, `[speed][band]`; none where it is not compared.
    #[serde(rename = "scatter_dB")]
    pub scatter_db: Vec<Vec<Option<f64>>>,
}
