//! Comparison of a library's schema with that of this program, for reading without an update.

use crate::LibraryError;

/// Checks that a library has the schema of this program.
///
/// # Errors
/// [`LibraryError::OlderSchema`] or [`LibraryError::NewerSchema`].
pub(super) fn refuse_other_schema(
    found: i64,
    known: i64,
    library: &str,
) -> Result<(), LibraryError> {
    let library = library.to_owned();
    match found.cmp(&known) {
        std::cmp::Ordering::Less => Err(LibraryError::OlderSchema { library, found, known }),
        std::cmp::Ordering::Equal => Ok(()),
        std::cmp::Ordering::Greater => Err(LibraryError::NewerSchema { library, found, known }),
    }
}
