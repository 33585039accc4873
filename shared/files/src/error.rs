//! Errors of files.

use crate::{Kind, NameError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Error in writing or reading a file.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// An existing file was not written by the program.
    #[error(
        "{}: the file was not written by tracktwin, or was changed since; use another \
             --out, or --force to replace it",
        path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// An existing file belongs to another kind of output.
    #[error(
        "{}: the file belongs to {kind}; use another --out, or --force to replace it",
        path.display()
    )]
    OtherKind {
        /// The file.
        path: PathBuf,
        /// The kind of output that the file belongs to.
        kind: Kind,
    },
    /// A folder exists in place of a file.
    #[error("{}: is a folder, not a file; use another --out", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// A text is not a valid file name.
    #[error("{name:?}: {fault}")]
    Name {
        /// The text.
        name: String,
        /// The fault of the text.
        fault: NameError,
    },
    /// A file that another file names lies outside its folder.
    #[error(
        "{name:?} is outside {}; files named there, and targets of links, must be inside \
             that folder: copy the file into it",
        folder.display()
    )]
    Outside {
        /// The folder.
        folder: PathBuf,
        /// The name.
        name: String,
    },
    /// The operating system returned an error.
    #[error("{}: cannot be {action}: {source}{}", path.display(), remedy(source))]
    System {
        /// The file or folder.
        path: PathBuf,
        /// The failed action: "written", "read", "made".
        action: &'static str,
        /// Error of the system.
        source: std::io::Error,
    },
}

/// What to do about an error of the system, where that can be said.
fn remedy(source: &std::io::Error) -> &'static str {
    match source.kind() {
        ErrorKind::NotFound => "; correct the name",
        ErrorKind::PermissionDenied => "; change its permissions",
        ErrorKind::StorageFull => "; free some space",
        _ => "",
    }
}

impl FilesError {
    pub(crate) fn written(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        Self::system(path, "written")
    }

    pub(crate) fn system(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::System { path, action, source }
    }

    /// Whether the user can correct the error, as for every file that is read. Other errors are faults
    /// of the machine.
    pub fn is_wrong_input(&self) -> bool {
        match self {
            Self::System { action: "read", .. } => true,
            Self::System { source, .. } => matches!(
                source.kind(),
                ErrorKind::NotFound
                    | ErrorKind::NotADirectory
                    | ErrorKind::IsADirectory
                    | ErrorKind::AlreadyExists
                    | ErrorKind::InvalidInput
                    | ErrorKind::InvalidFilename
            ),
            _ => true,
        }
    }
}
