//! Errors of a trial.

use crate::pipeline::diagnose::DiagnosingError;
use crate::pipeline::null_models::NullModelError;
use std::collections::BTreeMap;
use tracktwin_diagnosis::CalibrationError;
use tracktwin_files::FilesError;
use tracktwin_library::LibraryError;
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::TruthError;
use tracktwin_signal::recording::RecordingError;
use tracktwin_trial::{FORMAT, SealError};

/// Errors that end a trial.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The folder contains another trial.
    #[error(
        "{folder}: contains a trial of seed {seed} by version {version}; use another --out, \
             or the same seed"
    )]
    Other {
        /// Path of the folder.
        folder: String,
        /// Seed of the existing trial.
        seed: u64,
        /// Version of the program that started the existing trial.
        version: String,
    },
    /// The folder contains a trial of another track.
    #[error(
        "{folder}: contains a trial of {}; use another --out, or --preset {}",
        .preset.name(),
        .preset.name()
    )]
    OtherPreset {
        /// Path of the folder.
        folder: String,
        /// Track of the existing trial.
        preset: Preset,
    },
    /// The folder contains a trial with cases of another format.
    #[error(
        "{folder}: contains a trial of format {format}, whose cases are others than those of this \
             program (format {}); use another --out, or the program that began it",
        FORMAT
    )]
    OtherFormat {
        /// Path of the folder.
        folder: String,
        /// Format of the existing trial.
        format: u32,
    },
    /// The library returned an error.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// A truth was changed after sealing.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// A recording cannot be simulated.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Some diagnoses failed. All other cases were answered and scored.
    #[error(
        "{} of {of} diagnoses failed; all others are scored; repeat the command to try these again\n{}",
        .cases.len(),
        .cases.iter().map(|(number, reason)| format!("case {number}: {reason}")).collect::<Vec<_>>().join("\n")
    )]
    BrokenDown {
        /// Reason of each failure, by number of the case.
        cases: BTreeMap<u32, String>,
        /// Number of cases of the trial.
        of: u32,
    },
    /// A diagnosis failed.
    #[error("case {number}: {source}")]
    Diagnosis {
        /// Number of the case.
        number: u32,
        /// Cause.
        source: DiagnosingError,
    },
    /// The recording was not compared with a track model.
    #[error("case {number}: the recording has no track to compare with")]
    NoTrack {
        /// Number of the case.
        number: u32,
    },
    /// The paper's method cannot evaluate the recording.
    #[error("case {number}: {source}")]
    Paper {
        /// Number of the case.
        number: u32,
        /// Cause.
        source: tracktwin_evaluation::Error,
    },
    /// The track model of a truth cannot be built.
    #[error(transparent)]
    Model(#[from] CalibrationError),
    /// A file has invalid content.
    #[error("{path}: {source}")]
    Json {
        /// Path of the file.
        path: String,
        /// Cause.
        source: serde_json::Error,
    },
    /// A file cannot be written, or exists already.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// A file cannot be read.
    #[error("{path}: {source}")]
    File {
        /// Path of the file.
        path: String,
        /// Cause.
        source: std::io::Error,
    },
}

impl TrialError {
    /// Whether the same call may succeed later, when the library is available again.
    pub(super) fn is_temporary(&self) -> bool {
        match self {
            Self::Library(error) => error.is_temporary(),
            Self::Diagnosis {
                source: DiagnosingError::NullModel(NullModelError::Library(error)),
                ..
            } => error.is_temporary(),
            _ => false,
        }
    }
}
