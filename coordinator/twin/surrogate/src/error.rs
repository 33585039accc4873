//! Why models cannot be trained, used or loaded.

use std::path::PathBuf;

/// Errors of training and prediction.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A table has another number of rows or columns than stated.
    #[error("{what}: {found} numbers instead of {expected}")]
    Shape {
        /// The table.
        what: &'static str,
        /// Numbers it should hold.
        expected: usize,
        /// Numbers it holds.
        found: usize,
    },
    /// A number of the training set is NaN or infinite.
    #[error("{what}: entry {entry} is not a finite number")]
    NotFinite {
        /// The table.
        what: String,
        /// Row of the library.
        entry: usize,
    },
    /// Too few entries to fit and to validate.
    #[error("{found} cases are too few for training; at least {least} are needed")]
    TooFewEntries {
        /// Entries there are.
        found: usize,
        /// Entries needed.
        least: usize,
    },
    /// A parameter never changes.
    #[error("{0} has the same value in every library entry")]
    Constant(String),
    /// Feature columns outside the bins.
    #[error("feature {feature}: columns {start}..{end} lie outside the {bins} bins")]
    Columns {
        /// Name of the feature set.
        feature: String,
        /// First column.
        start: usize,
        /// Column after the last.
        end: usize,
        /// Bins there are.
        bins: usize,
    },
    /// An undefined feature set.
    #[error("unknown feature set {0}")]
    UnknownFeature(String),
    /// The covariance has a pivot that is not positive.
    #[error("the covariance matrix of {entries} library entries is not positive definite")]
    NotPositiveDefinite {
        /// Its size.
        entries: usize,
    },
    /// An eigenvalue iteration did not converge.
    #[error("the eigenvalues of a {size} x {size} matrix were not found")]
    NoEigenvalues {
        /// Its size.
        size: usize,
    },
    /// A file is not written, or not read for where it is.
    #[error("{0}")]
    Files(#[source] tracktwin_files::FilesError),
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The content of a file does not match its name.
    #[error("{path}: {reason}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
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
