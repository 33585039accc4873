//! Classes of the cases of a trial.

use serde::{Deserialize, Serialize};

/// Class of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Nothing is hidden.
    Control,
    /// A fault of the measuring chain.
    Artefact,
    /// One effect of the catalogue.
    Single,
    /// Two effects of the catalogue.
    Double,
    /// An effect that the catalogue lacks.
    Unknown,
}

impl Class {
    /// Name of the class in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Control => "control",
            Self::Artefact => "artefact",
            Self::Single => "single",
            Self::Double => "double",
            Self::Unknown => "unknown",
        }
    }

    /// Number of hidden effects.
    pub(crate) const fn effects(self) -> usize {
        match self {
            Self::Control => 0,
            Self::Double => 2,
            Self::Artefact | Self::Single | Self::Unknown => 1,
        }
    }
}
