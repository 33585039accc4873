//! Unsuccessful ends of a command.

use crate::pipeline::models::ModelsError;
use tracktwin_farm::campaign::StoreError;
use tracktwin_farm::embedded::FarmError;
use tracktwin_files::FilesError;
use tracktwin_library::LibraryError;

/// Unsuccessful end of a command; each variant has its exit code.
#[derive(Debug)]
pub(super) enum Stop {
    /// The result is negative and was printed (exit code 1).
    Negative,
    /// The input is wrong (exit code 2).
    Input(anyhow::Error),
    /// The machine, the network or the program failed (exit code 3).
    Failure(anyhow::Error),
}

/// Converts an error. Library and file errors caused by wrong input become `Input`; all others become
/// `Failure`.
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

/// Whether an error of a library or a file is wrong input.
fn is_wrong_input(error: &anyhow::Error) -> Option<bool> {
    if let Some(library) = library_error(error) {
        return Some(library.is_wrong_input());
    }
    if let Some(models) = error.downcast_ref::<ModelsError>() {
        return Some(models.is_wrong_input());
    }
    let file = error.chain().find_map(|cause| cause.downcast_ref::<FilesError>());
    file.map(FilesError::is_wrong_input)
}

/// Finds a library error inside another error.
fn library_error(error: &anyhow::Error) -> Option<&LibraryError> {
    if let Some(FarmError::Library(library)) = error.downcast_ref() {
        return Some(library);
    }
    if let Some(StoreError::Library(library)) = error.downcast_ref() {
        return Some(library);
    }
    error.downcast_ref()
}

/// Classifies an error as wrong input, unless it states a failure of the machine.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_s_word_on_whose_fault_it_is_survives_those_who_pass_it_on() {
        let wrong = || LibraryError::SeedTooLarge { seed: u64::MAX };
        assert!(wrong().is_wrong_input());
        let stops: [Stop; 3] = [
            wrong().into(),
            FarmError::Library(wrong()).into(),
            StoreError::Library(wrong()).into(),
        ];
        assert!(stops.iter().all(|stop| matches!(stop, Stop::Input(_))), "{stops:?}");
        let full = StoreError::Library(LibraryError::DiskFull);
        assert!(matches!(Stop::from(full), Stop::Failure(_)));
    }
}
