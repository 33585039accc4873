//! The record of an evaluation, from which files and pages are made.

use crate::{OutsideLibrary, Unevenness};
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_parameters::Parameter;

/// Value of the field `format` in `evaluation.json`.
pub const FORMAT: &str = "tracktwin-evaluation/1";

/// Mean and standard deviation of a parameter, in the unit of the parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Expected value.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
}

/// One estimate per parameter, in catalogue order.
pub type Estimates = BTreeMap<Parameter, Estimate>;

/// The track's parameters along a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Always [`FORMAT`].
    pub format: &'static str,
    /// Name of the recording.
    pub recording: String,
    /// Method of the estimates: `gp` (Gaussian processes).
    pub method: &'static str,
    /// Models and data of the estimates.
    pub provenance: Provenance,
    /// The sleepers, along the track.
    pub sleepers: Vec<SleeperEvaluation>,
    /// The sleepers that no pass covers.
    pub unevaluated: Vec<Unevaluated>,
    /// Part of the recording outside the library.
    pub outside_library: OutsideLibrary,
    /// Assumed unevenness of the track.
    pub unevenness: Unevenness,
    /// Sentences on sleepers outside the library, and on passes at speeds without models.
    pub notes: Vec<String>,
    /// Frequencies of the bins in Hz, ascending; for charts, not written to files.
    #[serde(skip)]
    pub frequencies_hz: Vec<f64>,
}

/// Models and data of the estimates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Version of this program.
    pub code_version: &'static str,
    /// The campaign on which the models were trained.
    pub campaign: String,
    /// Digest of the campaign's library.
    pub library_digest: String,
    /// Number of library entries, including the test half.
    pub library_entries: usize,
    /// Feature set of the models.
    pub feature: &'static str,
    /// Definition of the features.
    pub feature_definition: serde_json::Value,
    /// Speeds of the models in km/h that the recording has, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Models that are used where a sleeper has all of these speeds.
    pub combination: &'static str,
    /// Range and error of each parameter.
    pub parameters: BTreeMap<Parameter, Known>,
}

/// Range and error of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Known {
    /// Lowest and highest value in the library, in the parameter's unit. Estimated means lie inside.
    pub range: [f64; 2],
    /// Mean absolute error on the test half, divided by the range (paper, eq. 11), of the best model in
    /// use.
    pub mase_test: f64,
    /// Mean absolute error of a constant (the library's median), divided by the range.
    pub mase_constant: f64,
}

impl Known {
    /// A parameter counts as not resolved if its error exceeds this share of the error of a constant.
    const HARDLY: f64 = 0.9;

    /// Whether the error of the models is clearly smaller than that of a constant.
    pub fn beats_constant(&self) -> bool {
        self.mase_test < Self::HARDLY * self.mase_constant
    }
}

/// A sleeper that was evaluated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SleeperEvaluation {
    /// Id of the sleeper.
    pub id: String,
    /// Position along the track in m.
    pub x_m: f64,
    /// Mean and standard deviation of every parameter, from Gaussian processes.
    #[serde(flatten)]
    pub estimates: Estimates,
    /// Standard deviations without the part that the unevenness of the track adds.
    #[serde(rename = "sd_if_even")]
    pub sd_without_unevenness: BTreeMap<Parameter, f64>,
    /// Result of the model selector.
    pub selector: Selected,
    /// Flags of the estimates.
    pub flags: Vec<Flag>,
    /// Measured features at each speed.
    pub measured: Vec<Measured>,
}

/// The library entries nearest to a sleeper's features (paper, eq. 7, 8 and 10).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Selected {
    /// Mean and standard deviation of every parameter over the matches.
    #[serde(flatten)]
    pub estimates: Estimates,
    /// Rows of the best matches in the library, the best first.
    pub entries: Vec<usize>,
    /// Mean absolute percentage error of each match (0.05 is 5 %; paper, eq. 10).
    pub mape: Vec<f64>,
}

/// Measured data of a sleeper at one speed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Speed of the models in km/h.
    pub speed_km_h: f64,
    /// Number of averaged passes.
    pub passes: usize,
    /// Mean over the passes of the natural logarithm of the LWPS, one value per bin; for charts.
    #[serde(skip)]
    pub log_power: Vec<f64>,
    /// Natural logarithms of the LWPS of the matches, the best first, one value per bin; for charts.
    #[serde(skip)]
    pub matches: Vec<Vec<f64>>,
}

/// Limitation of the estimates of a sleeper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// A pass covers only part of the sleeper's window.
    IncompleteWindow,
    /// A pass begins or ends so close to the window that low frequencies lack part of their margin.
    ShortMargin,
    /// A speed is missing; the estimates combine single-speed models.
    MissingSpeed,
    /// A mean lies at an end of the parameter's range in the library; the true value may lie beyond.
    AtEdgeOfRange,
    /// The sleeper differs from its neighbours by more than the track varies elsewhere.
    UnlikeNeighbours,
    /// The railpad is probably so stiff that a stiffer one hardly changes the recording.
    RailpadNotResolved,
    /// The wheel is off the rail in the sleeper's window; the recorded acceleration hardly depends on the
    /// track.
    LossOfContact,
    /// No track of the library can produce the features; the estimates are not valid.
    OutsideLibrary,
    /// No pass covers a whole window with its margins, so that the features are not compared with the library.
    DomainNotTested,
}

/// A sleeper without estimates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unevaluated {
    /// Id of the sleeper.
    pub id: String,
    /// Position along the track in m.
    pub x_m: f64,
    /// Reason for the missing estimates.
    pub reason: &'static str,
}

impl SleeperEvaluation {
    /// Whether the estimates, including those of the model selector, are valid.
    pub fn is_valid(&self) -> bool {
        !self.flags.contains(&Flag::OutsideLibrary)
    }
}

impl Flag {
    /// Short description in English.
    pub const fn label(self) -> &'static str {
        match self {
            Self::IncompleteWindow => "incomplete window",
            Self::ShortMargin => "short margin",
            Self::MissingSpeed => "missing speed",
            Self::AtEdgeOfRange => "at edge of range",
            Self::UnlikeNeighbours => "unlike its neighbours",
            Self::RailpadNotResolved => "railpad: not resolved",
            Self::LossOfContact => "loss of contact",
            Self::OutsideLibrary => "outside library: not valid",
            Self::DomainNotTested => "not tested against the library",
        }
    }

    /// Name of the flag in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::IncompleteWindow => "incomplete_window",
            Self::ShortMargin => "short_margin",
            Self::MissingSpeed => "missing_speed",
            Self::AtEdgeOfRange => "at_edge_of_range",
            Self::UnlikeNeighbours => "unlike_neighbours",
            Self::RailpadNotResolved => "railpad_not_resolved",
            Self::LossOfContact => "loss_of_contact",
            Self::OutsideLibrary => "outside_library",
            Self::DomainNotTested => "domain_not_tested",
        }
    }
}
