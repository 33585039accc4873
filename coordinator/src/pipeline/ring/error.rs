//! Why a ring study ends before its time.

use crate::pipeline::diagnose::DiagnosingError;
use crate::pipeline::invert::InvertingError;
use std::path::Path;
use tracktwin_files::FilesError;
use tracktwin_reference_simulator::TruthError;
use tracktwin_ring::RingError;
use tracktwin_signal::FeatureError;
use tracktwin_signal::recording::RecordingError;

/// Why a ring study ends before its time.
#[derive(Debug, thiserror::Error)]
pub enum RingStudyError {
    /// The folder holds another ring.
    #[error(
        "{folder}: contains a ring of other settings ({known}); use another --out, or the same settings"
    )]
    Other {
        /// The folder.
        folder: String,
        /// Seed, laps, speeds and stretch of the ring there, and the version that began it.
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
        /// The part.
        part: String,
        /// Why.
        source: InvertingError,
    },
    /// The recording has no spectra.
    #[error(transparent)]
    Features(#[from] FeatureError),
    /// The models cannot evaluate the recording, or a window of it has no spectrum.
    #[error(transparent)]
    Models(#[from] tracktwin_evaluation::Error),
    /// A part of the recording cannot be diagnosed.
    #[error("{part}: {source}")]
    Diagnosis {
        /// The part.
        part: String,
        /// Why.
        source: DiagnosingError,
    },
    /// A file of the folder is not what it was.
    #[error("{path}: {source}; remove it, and it is made again")]
    NoEvaluation {
        /// The file.
        path: String,
        /// Why.
        source: RingError,
    },
    /// The same of a file of the program's own.
    #[error("{path}: {source}; remove it, and it is made again")]
    Json {
        /// The file.
        path: String,
        /// Why.
        source: serde_json::Error,
    },
    /// The file that identifies the folder's ring says nothing.
    #[error("{path}: not the plan of a ring of this version ({source}); use another --out")]
    Terms {
        /// The file.
        path: String,
        /// Why.
        source: serde_json::Error,
    },
    /// A file cannot be read or written, or belongs to another.
    #[error(transparent)]
    Files(#[from] FilesError),
}

impl RingStudyError {
    /// Whether the settings or the folder are to be changed.
    pub fn is_wrong_input(&self) -> bool {
        match self {
            Self::Other { .. }
            | Self::Models(_)
            | Self::NoEvaluation { .. }
            | Self::Json { .. }
            | Self::Terms { .. } => true,
            Self::Files(error) => error.is_wrong_input(),
            Self::Inversion { source: InvertingError::Recording(_), .. }
            | Self::Diagnosis { source: DiagnosingError::Recording(_), .. } => true,
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
