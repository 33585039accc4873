//! Why a command ends without being done.

use tracktwin_farm::embedded::FarmError;
use tracktwin_files::FilesError;
use tracktwin_library::LibraryError;

/// The end of a command that is not success; each has its exit code.
#[derive(Debug)]
pub(super) enum Stop {
    /// The answer is no, and was said (exit code 1).
    Negative,
    /// What the user gave can't be used (exit code 2).
    Input(anyhow::Error),
    /// The machine, the network or the program failed (exit code 3).
    Failure(anyhow::Error),
}

/// A library or a file that says so was given something wrong; all else is a failure.
impl<E: Into<anyhow::Error>> From<E> for Stop {
    fn from(error: E) -> Self {
        let error = error.into();
        if is_wrong_input(&error).unwrap_or(false) {
            Self::Input(error)
        } else {
            Self::Failure(error)
        }
    }
}

/// What libraries and files say of whose fault an error is.
fn is_wrong_input(error: &anyhow::Error) -> Option<bool> {
    let library = match error.downcast_ref::<FarmError>() {
        Some(FarmError::Library(library)) => Some(library),
        _ => error.downcast_ref::<LibraryError>(),
    };
    if let Some(library) = library {
        return Some(library.is_wrong_input());
    }
    let file = error.chain().find_map(|cause| cause.downcast_ref::<FilesError>());
    file.map(FilesError::is_wrong_input)
}

/// Blames an error on what the user gave, unless it says that the machine is to blame.
pub(super) trait OrInput<T> {
    /// The value, or [`Stop::Input`].
    ///
    /// # Errors
    /// [`Stop::Input`] with the error; [`Stop::Failure`] for a full disk, a missing permission or a
    /// library that fails.
    fn or_input(self) -> Result<T, Stop>;
}

impl<T, E: Into<anyhow::Error>> OrInput<T> for Result<T, E> {
    fn or_input(self) -> Result<T, Stop> {
        self.map_err(|error| {
            let error = error.into();
            match is_wrong_input(&error) {
                Some(false) => Stop::Failure(error),
                _ => Stop::Input(error),
            }
        })
    }
}
