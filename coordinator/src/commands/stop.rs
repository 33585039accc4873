//! Why a command ends without being done.

use crate::farm::FarmError;
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

/// A library that says so was given something wrong; all else is a failure.
impl<E: Into<anyhow::Error>> From<E> for Stop {
    fn from(error: E) -> Self {
        let error = error.into();
        let library = match error.downcast_ref::<FarmError>() {
            Some(FarmError::Library(library)) => Some(library),
            _ => error.downcast_ref::<LibraryError>(),
        };
        if library.is_some_and(LibraryError::is_wrong_input) {
            Self::Input(error)
        } else {
            Self::Failure(error)
        }
    }
}

/// Blames an error on what the user gave.
pub(super) trait OrInput<T> {
    /// The value, or [`Stop::Input`].
    ///
    /// # Errors
    /// [`Stop::Input`] with the error.
    fn or_input(self) -> Result<T, Stop>;
}

impl<T, E: Into<anyhow::Error>> OrInput<T> for Result<T, E> {
    fn or_input(self) -> Result<T, Stop> {
        self.map_err(|error| Stop::Input(error.into()))
    }
}
