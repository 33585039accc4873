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

impl<E: Into<anyhow::Error>> From<E> for Stop {
    fn from(error: E) -> Self {
        Self::Failure(error.into())
    }
}

impl Stop {
    /// Wrong input or a failure, as the library says.
    pub(super) fn from_library(error: LibraryError) -> Self {
        if error.is_wrong_input() { Self::Input(error.into()) } else { Self::Failure(error.into()) }
    }

    /// As [`Stop::from_library`], of what fails in a farm.
    pub(super) fn from_farm(error: FarmError) -> Self {
        match error {
            FarmError::Library(error) => Self::from_library(error),
            other => Self::Failure(other.into()),
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
