//! One file, replaced at once.

use crate::{FilesError, partial};
use std::fs::File;
use std::io::Write as _;
use std::path::Path;

/// Mode of a file that only its owner reads.
const SECRET: u32 = 0o600;

/// Writes a file atomically: a reader finds the old or the new one, also after a crash or on a full
/// disk. For files in folders of the program; others go through [`crate::Output`].
///
/// # Errors
/// [`FilesError::System`] when the file cannot be written; then the old one is kept.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), FilesError> {
    write(path, bytes, None)
}

/// As [`replace`], for a file that only its owner is to read.
///
/// # Errors
/// As [`replace`].
pub fn replace_secret(path: &Path, bytes: &[u8]) -> Result<(), FilesError> {
    write(path, bytes, Some(SECRET))
}

fn write(path: &Path, bytes: &[u8], mode: Option<u32>) -> Result<(), FilesError> {
    let mut file = partial::file(path, mode)?;
    let filled = file.write_all(bytes).and_then(|()| file.as_file().sync_all());
    filled.map_err(FilesError::written(path))?;
    file.persist(path).map_err(|error| FilesError::written(path)(error.error))?;
    sync_folder(partial::folder_of(path));
    Ok(())
}

/// Makes new names last over a power cut; file systems that can't do so are not asked twice.
pub(crate) fn sync_folder(folder: &Path) {
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}
