//! The record of an evaluation, from which files and pages are made.

use crate::{OutsideLibrary, Unevenness};
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_parameters::Parameter;

/// The format of `evaluation.json`.
pub const FORMAT: &str = "tracktwin-evaluation/1";

/// An estimated value, in the parameter's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Expected value.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
}

/// An estimate a parameter, in catalogue order.
pub type Estimates = BTreeMap<Parameter, Estimate>;

/// The track's parameters along a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// [`FORMAT`].
    pub format: &'static str,
    /// The recording's name.
    pub recording: String,
    /// How the sleepers' own estimates were made: `gp`.
    pub method: &'static str,
    /// Where they come from.
    pub provenance: Provenance,
    /// The sleepers, along the track.
    pub sleepers: Vec<SleeperEvaluation>,
    /// The sleepers that no pass covers.
    pub unevaluated: Vec<Unevaluated>,
    /// Part of the recording outside the library.
    pub outside_library: OutsideLibrary,
    /// How much sleepers are taken to differ.
    pub unevenness: Unevenness,
    /// Passes left out, with the reason.
    pub notes: Vec<String>,
    /// Frequencies of the bins in Hz, ascending; for pictures.
    #[serde(skip)]
    pub frequencies_hz: Vec<f64>,
}

/// Provenance of the estimates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Version of this program.
    pub code_version: &'static str,
    /// The campaign the models were trained on.
    pub campaign: String,
    /// Digest of its library.
    pub library_digest: String,
    /// Library entries, those kept for testing included.
    pub library_entries: usize,
    /// Feature set of the models.
    pub feature: &'static str,
    /// How features are made.
    pub feature_definition: serde_json::Value,
    /// Speeds of the models in km/h that the recording has, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Which models speak where a sleeper has all of these speeds.
    pub combination: &'static str,
    /// Range and error of each parameter.
    pub parameters: BTreeMap<Parameter, Known>,
}

/// Range and error of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Known {
    /// Lowest and highest value in the library, in the parameter's unit. Means stay inside.
    pub range: [f64; 2],
    /// Mean absolute error on the test half over that range (paper, eq. 11), of the best of the
    /// models that speak.
    pub mase_test: f64,
    /// The same of a constant, the library's median.
    pub mase_constant: f64,
}

impl Known {
    /// Share of a constant's error above which a parameter counts as not resolved.
    const HARDLY: f64 = 0.9;

    /// Whether the models estimate the parameter noticeably better than a constant.
    pub fn beats_constant(&self) -> bool {
        self.mase_test < Self::HARDLY * self.mase_constant
    }
}

/// A sleeper that was evaluated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SleeperEvaluation {
    /// Its name.
    pub id: String,
    /// Its place along the track in m.
    pub x_m: f64,
    /// Mean and standard deviation by Gaussian processes.
    #[serde(flatten)]
    pub estimates: Estimates,
    /// Standard deviations without the unevenness of the track.
    #[serde(rename = "sd_if_even")]
    pub sd_without_unevenness: BTreeMap<Parameter, f64>,
    /// The model selector's answer.
    pub selector: Selected,
    /// Flags of its estimates.
    pub flags: Vec<Flag>,
    /// Passes that were averaged at each speed.
    pub measured: Vec<Measured>,
}

/// The library entries nearest to a sleeper's features (paper, eq. 7, 8 and 10).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Selected {
    /// Mean and standard deviation over the matches.
    #[serde(flatten)]
    pub estimates: Estimates,
    /// Rows of the library that match best, the best first.
    pub entries: Vec<usize>,
    /// Mean absolute percentage error of each match (0.05 is 5 %; paper, eq. 10).
    pub mape: Vec<f64>,
}

/// Measured data of a sleeper at one speed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Speed of the models in km/h.
    pub speed_km_h: f64,
    /// Passes averaged.
    pub passes: usize,
    /// Mean over passes of the ln LWPS, a value a bin; for pictures.
    #[serde(skip)]
    pub log_power: Vec<f64>,
    /// The ln LWPS of the matches, the best first; for pictures.
    #[serde(skip)]
    pub matches: Vec<Vec<f64>>,
}

/// Something to keep in mind about a sleeper's estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// A pass covers only part of the sleeper's window.
    IncompleteWindow,
    /// A pass begins or ends so near that low frequencies lack signal beside the window.
    ShortMargin,
    /// A speed is missing: single-speed models were combined.
    MissingSpeed,
    /// A mean lies at an end of what the library's tracks have: the track may lie beyond.
    AtEdgeOfRange,
    /// It differs from its neighbours by more than the track varies elsewhere.
    UnlikeNeighbours,
    /// The railpad is so stiff that stiffer ones hardly change the recording: its stiffness is a lower
    /// bound.
    RailpadAtLeast,
    /// The wheel is in the air in the sleeper's window: what was recorded there is hardly the track's.
    LossOfContact,
    /// The features are such as no track of the library has: the estimates are not valid.
    OutsideLibrary,
}

/// A sleeper without estimates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unevaluated {
    /// Its name.
    pub id: String,
    /// Its place along the track in m.
    pub x_m: f64,
    /// Why there are none.
    pub reason: &'static str,
}

impl SleeperEvaluation {
    /// Whether the estimates, the selector's too, mean anything.
    pub fn is_valid(&self) -> bool {
        !self.flags.contains(&Flag::OutsideLibrary)
    }
}

impl Flag {
    /// A few words for a person.
    pub const fn label(self) -> &'static str {
        match self {
            Self::IncompleteWindow => "incomplete window",
            Self::ShortMargin => "short margin",
            Self::MissingSpeed => "missing speed",
            Self::AtEdgeOfRange => "at edge of range",
            Self::UnlikeNeighbours => "unlike its neighbours",
            Self::RailpadAtLeast => "railpad: at least",
            Self::LossOfContact => "loss of contact",
            Self::OutsideLibrary => "outside library: not valid",
        }
    }

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::IncompleteWindow => "incomplete_window",
            Self::ShortMargin => "short_margin",
            Self::MissingSpeed => "missing_speed",
            Self::AtEdgeOfRange => "at_edge_of_range",
            Self::UnlikeNeighbours => "unlike_neighbours",
            Self::RailpadAtLeast => "railpad_at_least",
            Self::LossOfContact => "loss_of_contact",
            Self::OutsideLibrary => "outside_library",
        }
    }
}
