//! Why a command ends without being done.

use crate::pipeline::models::ModelsError;
use tracktwin_farm::campaign::StoreError;
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
    if let Some(library) = library_error(error) {
        return Some(library.is_wrong_input());
    }
    if let Some(models) = error.downcast_ref::<ModelsError>() {
        return Some(models.is_wrong_input());
    }
    let file = error.chain().find_map(|cause| cause.downcast_ref::<FilesError>());
    file.map(FilesError::is_wrong_input)
}

/// What a library says, whoever passes it on.
fn library_error(error: &anyhow::Error) -> Option<&LibraryError> {
    if let Some(FarmError::Library(library)) = error.downcast_ref() {
        return Some(library);
    }
    if let Some(StoreError::Library(library)) = error.downcast_ref() {
        return Some(library);
    }
    error.downcast_ref()
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
