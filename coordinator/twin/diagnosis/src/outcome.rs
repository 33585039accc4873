//! Record of a diagnosis, from which files and pages are made (`tracktwin-diagnosis/1`).

use crate::behaviour::Element;
use crate::estimate::Estimate;
use crate::variation::FoundSupportChange;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use tracktwin_inspection::chain::LossOfContact;
use tracktwin_parameters::Parameter;
use tracktwin_track::extension::Kind;

/// Value of the field `format` in `diagnosis.json`.
pub const FORMAT: &str = "tracktwin-diagnosis/1";

/// Name of a hypothesis for physics that is not in the catalogue.
pub const UNKNOWN: &str = "unknown_physics";

/// Verdict of the comparison with the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The calibrated baseline explains the recording.
    Consistent,
    /// An extension of a known kind was accepted.
    LeftOutPhysics,
    /// Physics is left out that no known kind explains.
    UnknownPhysics,
    /// A fault of the sensor, its mounting, the clock or the odometer explains the difference.
    MeasurementChain,
}

impl Verdict {
    /// Name of the verdict in files.
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
    /// Always [`FORMAT`].
    pub format: String,
    /// Name of the recording.
    pub recording: String,
    /// Verdict on the recording.
    pub verdict: Verdict,
    /// The verdict as a self-contained sentence, and what is stated beside it: support changes and contact loss.
    pub sentence: String,
    /// Probability that nothing is left out; `None` if no track model was compared.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub nothing_left_out: Option<f64>,
    /// Significant differences between recording and calibrated baseline.
    pub mismatches: Vec<Mismatch>,
    /// Hypotheses, the most probable first.
    pub hypotheses: Vec<Hypothesis>,
    /// Agreement of recording and model without and with the accepted physics.
    pub fit: FitScores,
    /// Parameters (by name, in SI units) without and with the accepted physics.
    pub bias_removed: BTreeMap<String, BeforeAfter<f64>>,
    /// Parameters of every sleeper along the track.
    pub track: Vec<SleeperValues>,
    /// Measured and predicted levels.
    pub levels: Levels,
    /// Comparison with withheld passes in the time domain. `None` if it was not requested, or if no
    /// accepted extension is visible in a simulated pass.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub confirmation: Option<Confirmation>,
    /// Transitions and soft or stiff spots of the support, along the track. They are part of the baseline, so that they
    /// are no left-out physics.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub support_changes: Vec<FoundSupportChange>,
    /// Contact loss between wheel and rail; the fit is not valid on these stretches.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub loss_of_contact: Option<LossOfContact>,
    /// Notes.
    pub notes: Vec<String>,
    /// Verdicts on the sections of a long track; empty if it was diagnosed as a whole.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub sections: Vec<SectionVerdict>,
}

/// Verdict on a section of a long track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SectionVerdict {
    /// Number of the section along the track, from 1.
    pub number: usize,
    /// Ids of the first and the last sleeper.
    pub sleepers: [String; 2],
    /// Verdict on the section.
    pub verdict: Verdict,
    /// The verdict as a sentence.
    pub sentence: String,
    /// Probability that nothing is left out; `None` if no track model was compared.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub nothing_left_out: Option<f64>,
}

/// Folder of a section's own diagnosis and page, beside those of the whole track.
pub fn section_folder(number: usize) -> String {
    format!("sections/{number:02}")
}

/// Comparison of time-domain simulations with passes that were withheld from the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confirmation {
    /// File names of the withheld passes.
    pub passes: Vec<String>,
    /// Differences between measured and simulated levels at each speed.
    pub speeds: Vec<ConfirmedSpeed>,
    /// Number of compared sleepers: those that the accepted physics affects.
    pub sleepers: usize,
    /// Gain in log probability of the withheld passes from the accepted physics, in nats.
    pub gain_nats: f64,
    /// Whether the gain is large enough for a confirmation.
    pub is_confirmed: bool,
}

/// Level differences in the withheld passes of one speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConfirmedSpeed {
    /// Speed in km/h.
    pub speed_km_h: f64,
    /// Root mean square difference of levels without the accepted physics, in dB.
    #[serde(rename = "before_dB")]
    pub before_db: f64,
    /// Root mean square difference of levels with the accepted physics, in dB.
    #[serde(rename = "after_dB")]
    pub after_db: f64,
}

/// A patch in position and frequency where recording and baseline differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mismatch {
    /// First and last position along the track in m.
    pub x_m: [f64; 2],
    /// Ids of the sleepers in this stretch.
    pub sleepers: Vec<String>,
    /// Lowest and highest frequency in Hz.
    #[serde(rename = "frequency_Hz")]
    pub frequency_hz: [f64; 2],
    /// Speeds of the difference in km/h.
    pub speeds_km_h: Vec<f64>,
    /// Root mean square difference of the levels in the patch, in dB.
    #[serde(rename = "level_dB")]
    pub level_db: f64,
    /// Probability of such a patch anywhere if nothing is left out.
    pub p_value: f64,
}

/// Hypothesis of left-out physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Name of the kind in the catalogue.
    pub physics: String,
    /// Family of the kind: the part of track, vehicle or measurement that differs. For unknown physics it
    /// begins with `unknown_`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub family: Option<String>,
    /// Probability that physics of this family is present at the location.
    #[serde(default)]
    pub family_probability: f64,
    /// Probability that this kind is present.
    pub probability: f64,
    /// Whether it was accepted and appears in the sentence.
    pub accepted: bool,
    /// Location on the track; `None` if it is everywhere.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub location: Option<Location>,
    /// Port of unknown physics in the model: `rail_seat`, `between_rail_seats`, `wheel`, `rail_surface` or
    /// `wheel_surface`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub port: Option<String>,
    /// Element that unknown physics resembles; `parameters` holds its parameters.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub behaviour: Option<Element>,
    /// Fitted parameters by name, with unit in the name.
    pub parameters: BTreeMap<String, Estimate>,
    /// Further parameters with fixed values, which were not fitted.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub assumed: BTreeMap<String, f64>,
    /// Names of look-alikes.
    pub look_alikes: Vec<String>,
    /// Measurement that would separate the hypothesis from its look-alikes.
    pub would_separate: String,
    /// Detectability d': norm of the whitened signature after the baseline was fitted again.
    pub detectability: f64,
    /// Log ratio of the evidence to the model without the hypothesis, in nats. For what only the passes show, minus
    /// the logarithm of its p-value.
    pub log_evidence: f64,
}

impl Hypothesis {
    /// The parameter of an accepted extension that replaces a parameter of the track at the sleeper with this id, such
    /// as what is left of the stiffness of a missing railpad.
    pub fn in_place_of(&self, replaced: Parameter, id: &str) -> Option<Estimate> {
        let location = self.location.as_ref().filter(|_| self.accepted)?;
        let is_there = location.sleepers.iter().any(|sleeper| sleeper == id);
        let kind = Kind::from_name(&self.physics).filter(|_| is_there)?;
        let parameter = kind.parameters.iter().find(|it| it.replaces == Some(replaced))?;
        self.parameters.get(parameter.name).copied()
    }
}

/// A stretch of the track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Location {
    /// First and last position in m.
    pub x_m: [f64; 2],
    /// Ids of the sleepers in this stretch.
    pub sleepers: Vec<String>,
}

/// Whether two locations share a sleeper, or a place away from all sleepers; `None` is everywhere.
pub(crate) fn meet(one: Option<&Location>, other: Option<&Location>) -> bool {
    let (Some(one), Some(other)) = (one, other) else { return true };
    if one.sleepers.is_empty() && other.sleepers.is_empty() {
        return one.x_m[0] <= other.x_m[1] && other.x_m[0] <= one.x_m[1];
    }
    one.sleepers.iter().any(|sleeper| other.sleepers.contains(sleeper))
}

/// Values without and with the accepted physics.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeforeAfter<T> {
    /// Value of the calibrated baseline alone.
    pub before: T,
    /// Value with the accepted physics.
    pub after: T,
}

/// Mean log predictive densities without and with the accepted physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitScores {
    /// Definition of the scores.
    pub score: String,
    /// Scores of the calibrated baseline.
    pub before: Scores,
    /// Scores with the accepted physics.
    pub after: Scores,
    /// Gain at each held-out speed in nats, over all its log powers; keys are speeds in km/h.
    pub held_out_gain_nats: BTreeMap<String, f64>,
}

/// Scores of one model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Score on the fitted data.
    pub in_sample: Score,
    /// Score on speeds that were not fitted; `None` for a single speed.
    pub held_out: Option<Score>,
}

/// A score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Mean log density per band and sleeper in nats; higher is better.
    pub score: f64,
}

/// Parameters of a sleeper without and with the accepted physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SleeperValues {
    /// Id of the sleeper.
    pub id: String,
    /// Position along the track in m.
    pub x_m: f64,
    /// Railpad stiffness in N/m.
    #[serde(rename = "railpad_stiffness_N_m")]
    pub railpad_stiffness: BeforeAfter<Estimate>,
    /// Ballast stiffness in N/m.
    #[serde(rename = "ballast_stiffness_N_m")]
    pub ballast_stiffness: BeforeAfter<Estimate>,
    /// Irregularity level.
    pub irregularity_level: BeforeAfter<Estimate>,
    /// Flags: `loss_of_contact` if the wheel loses contact at the sleeper.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub flags: Vec<String>,
}

/// Levels in dB re 1 (m/s2)2: `[speed][sleeper][band]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Levels {
    /// Centres of the bands in Hz.
    #[serde(rename = "frequency_Hz")]
    pub frequency_hz: Vec<f64>,
    /// Speeds in km/h.
    pub speeds_km_h: Vec<f64>,
    /// Measured levels.
    #[serde(rename = "measured_dB")]
    pub measured_db: Vec<Vec<Vec<f64>>>,
    /// Levels predicted by the calibrated baseline.
    #[serde(rename = "before_dB")]
    pub before_db: Vec<Vec<Vec<f64>>>,
    /// Levels predicted with the accepted physics.
    #[serde(rename = "after_dB")]
    pub after_db: Vec<Vec<Vec<f64>>>,
    /// Expected standard deviation of one level, `[speed][band]`; `None` for bands that are not compared.
    #[serde(rename = "scatter_dB")]
    pub scatter_db: Vec<Vec<Option<f64>>>,
}

#[cfg(test)]
impl Hypothesis {
    /// An accepted hypothesis, for tests.
    pub(crate) fn accepted(physics: &str, location: Option<Location>) -> Self {
        Self {
            physics: physics.to_owned(),
            family: None,
            family_probability: 0.987,
            probability: 0.987,
            accepted: true,
            location,
            port: None,
            behaviour: None,
            parameters: BTreeMap::new(),
            assumed: BTreeMap::new(),
            look_alikes: Vec::new(),
            would_separate: String::new(),
            detectability: 9.0,
            log_evidence: 40.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_a_missing_railpad_is_the_railpad_of_its_sleeper() {
        let at = Location { x_m: [1.0; 2], sleepers: vec!["SN7".to_owned()] };
        let left = Estimate { mean: 9e6, sd: 2e6 };
        let mut missing = Hypothesis::accepted("missing_railpad", Some(at.clone()));
        missing.parameters.insert("stiffness_N_per_m".to_owned(), left);
        let railpad = |of: &Hypothesis, id: &str| of.in_place_of(Parameter::RailpadStiffness, id);
        assert_eq!(railpad(&missing, "SN7"), Some(left));
        assert_eq!(railpad(&missing, "SN8"), None);
        assert_eq!(missing.in_place_of(Parameter::BallastStiffness, "SN7"), None);
        assert_eq!(railpad(&Hypothesis { accepted: false, ..missing.clone() }, "SN7"), None);
        // A layer's stiffness is no railpad's.
        let mut layer = Hypothesis::accepted("subgrade_layer", Some(at));
        layer.parameters.clone_from(&missing.parameters);
        assert_eq!(railpad(&layer, "SN7"), None);
    }
}
