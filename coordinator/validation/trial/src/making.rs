//! Making of a case: simulator, assumptions and nuisances.

use crate::effect::Draw;
use crate::varied::{add_nuisances, assumptions, vary_track};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tracktwin_reference_simulator::{Scene, TruthError};
use tracktwin_signal::recording::Recording;

/// Making of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Making {
    /// The reference simulator with the shapes of the catalogue, on a track without nuisances.
    Plain,
    /// The reference simulator with other shapes, modes and steel, and with nuisances.
    Varied,
    /// The second simulator, with shapes, laws and further nuisances of its own.
    Second,
}

impl Making {
    /// All makings.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Varied, Self::Second];

    /// Name of the making in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Varied => "varied",
            Self::Second => "second",
        }
    }

    /// Simulates a scene and writes the recording's folder.
    ///
    /// # Errors
    /// [`TruthError`] if the scene is invalid or the folder cannot be written.
    pub fn record(self, scene: &Scene, folder: &Path) -> Result<(), TruthError> {
        Ok(self.simulate(scene)?.write(folder)?)
    }

    /// Simulates a scene, without files.
    ///
    /// # Errors
    /// [`TruthError`] if the scene is invalid.
    pub fn simulate(self, scene: &Scene) -> Result<Recording, TruthError> {
        match self {
            Self::Plain | Self::Varied => tracktwin_reference_simulator::simulate(scene),
            Self::Second => tracktwin_second_simulator::simulate(scene),
        }
    }

    /// Adds what this making assumes and its nuisances.
    pub(crate) fn complete(self, scene: &mut Scene, draw: &mut Draw<'_>) {
        if self == Self::Varied {
            scene.assumptions = assumptions(draw);
            add_nuisances(scene, draw);
        }
        if self != Self::Plain {
            vary_track(scene, draw);
        }
    }
}
