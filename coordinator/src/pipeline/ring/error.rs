//! Errors of a ring study.

use crate::pipeline::diagnose_sections::SectionsError;
use crate::pipeline::invert::InvertingError;
use std::path::Path;
use tracktwin_files::FilesError;
use tracktwin_reference_simulator::TruthError;
use tracktwin_ring::RingError;
use tracktwin_signal::FeatureError;
use tracktwin_signal::recording::RecordingError;

/// Errors that end a ring study.
#[derive(Debug, thiserror::Error)]
pub enum RingStudyError {
    /// The folder contains a ring with other settings.
    #[error(
        "{folder}: contains a ring of other settings ({known}); use another --out, or the same settings"
    )]
    Other {
        /// Path of the folder.
        folder: String,
        /// Seed, laps, speeds and stretch of the existing ring, and the version of the program that created
        /// it.
        known: String,
    },
    /// The ring cannot be recorded.
    #[error("cannot record the ring: {0}")]
    Truth(#[from] TruthError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A part of the recording cannot be evaluated by inversion.
    #[error("{part}: {source}")]
    Inversion {
        /// Name of the part: all passes, a lap or a speed.
        part: String,
        /// Cause.
        source: InvertingError,
    },
    /// The spectra of the recording cannot be computed.
    #[error(transparent)]
    Features(#[from] FeatureError),
    /// The models cannot evaluate the recording, or a window has no spectrum.
    #[error(transparent)]
    Models(#[from] tracktwin_evaluation::Error),
    /// A part of the recording cannot be diagnosed.
    #[error("{part}: {source}")]
    Diagnosis {
        /// Name of the part.
        part: String,
        /// Cause.
        source: SectionsError,
    },
    /// An evaluation file in the folder is invalid.
    #[error("{path}: {source}; remove it, and it is made again")]
    NoEvaluation {
        /// Path of the file.
        path: String,
        /// Cause.
        source: RingError,
    },
    /// Another file written by the program is invalid.
    #[error("{path}: {source}; remove it, and it is made again")]
    Json {
        /// Path of the file.
        path: String,
        /// Cause.
        source: serde_json::Error,
    },
    /// The file that identifies the folder's ring is invalid.
    #[error("{path}: not the plan of a ring of this version ({source}); use another --out")]
    Terms {
        /// Path of the file.
        path: String,
        /// Cause.
        source: serde_json::Error,
    },
    /// A file cannot be read or written, or another program has written it.
    #[error(transparent)]
    Files(#[from] FilesError),
}

impl RingStudyError {
    /// Whether settings or folder are the cause; the user must change them.
    pub fn is_wrong_input(&self) -> bool {
        match self {
            Self::Other { .. }
            | Self::Models(_)
            | Self::NoEvaluation { .. }
            | Self::Json { .. }
            | Self::Terms { .. } => true,
            Self::Files(error) => error.is_wrong_input(),
            Self::Diagnosis { source, .. } => source.is_wrong_input(),
            Self::Inversion { source: InvertingError::Recording(_), .. } => true,
            _ => false,
        }
    }
}

pub(super) fn json(path: &Path) -> impl Fn(serde_json::Error) -> RingStudyError + '_ {
    |source| RingStudyError::Json { path: path.display().to_string(), source }
}

pub(super) fn no_evaluation(path: &Path) -> impl Fn(RingError) -> RingStudyError + '_ {
    |source| RingStudyError::NoEvaluation { path: path.display().to_string(), source }
}
