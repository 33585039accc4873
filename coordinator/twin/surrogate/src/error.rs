//! Errors of training, prediction and loading of models.

use std::path::PathBuf;

/// Errors of training and prediction.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A table has a wrong number of rows or columns.
    #[error("{what}: {found} numbers instead of {expected}")]
    Shape {
        /// The table.
        what: &'static str,
        /// Expected count.
        expected: usize,
        /// Count found.
        found: usize,
    },
    /// A number of the training set is NaN or infinite.
    #[error("{what}: entry {entry} is not a finite number")]
    NotFinite {
        /// The table.
        what: String,
        /// Row of the library, from 0.
        entry: usize,
    },
    /// Too few entries to fit and to validate.
    #[error("{found} cases are too few for training; at least {least} are needed")]
    TooFewEntries {
        /// Number of entries found.
        found: usize,
        /// Smallest number of entries needed.
        least: usize,
    },
    /// A parameter has the same value in all entries.
    #[error("{0} has the same value in every library entry")]
    Constant(String),
    /// Feature columns that are empty or exceed the number of bins.
    #[error("feature {feature}: columns {start}..{end} lie outside the {bins} bins")]
    Columns {
        /// Name of the feature set.
        feature: String,
        /// First column.
        start: usize,
        /// Column after the last.
        end: usize,
        /// Number of bins.
        bins: usize,
    },
    /// No feature set has this name.
    #[error("unknown feature set {0}")]
    UnknownFeature(String),
    /// The Cholesky factorisation of a matrix found a pivot that is not positive.
    #[error("the covariance matrix of {entries} library entries is not positive definite")]
    NotPositiveDefinite {
        /// Number of rows of the matrix.
        entries: usize,
    },
    /// An eigenvalue iteration did not converge.
    #[error("the eigenvalues of a {size} x {size} matrix were not found")]
    NoEigenvalues {
        /// Number of rows of the matrix.
        size: usize,
    },
    /// A file cannot be written, or its path cannot be read.
    #[error("{0}")]
    Files(#[source] tracktwin_files::FilesError),
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The content of a file has the wrong format.
    #[error("{path}: {reason}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
    /// A file was changed after it was written.
    #[error("{path}: the file does not belong to these models (checksum differs)")]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The models were trained on another library.
    #[error("models belong to library {trained_on}, not {offered}; train again")]
    OtherLibrary {
        /// Digest of the library they were trained on.
        trained_on: String,
        /// Digest of the library at hand.
        offered: String,
    },
}
