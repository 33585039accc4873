//! Atomic replacement of a single file.

use crate::{FilesError, partial};
use std::fs::File;
use std::io::Write as _;
use std::path::Path;

/// Mode of a file that only its owner reads.
const SECRET: u32 = 0o600;

/// Writes a file atomically: a reader finds the old or the new content, also after a crash or on a full
/// disk. Use this function for files in folders of the program and [`crate::Output`] for others.
///
/// # Errors
/// [`FilesError::System`] if the file cannot be written. The old file is then kept.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), FilesError> {
    write(path, bytes, None)
}

/// Writes a file like [`replace`], with a mode that only its owner can read.
///
/// # Errors
/// The errors of [`replace`].
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

/// Flushes new file names in a folder to the disk, so that they survive a power failure. Errors are
/// ignored, because some file systems do not support this.
pub(crate) fn sync_folder(folder: &Path) {
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}
