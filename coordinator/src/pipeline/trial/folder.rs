//! Checks of a trial's folder before anything is written to it.

use super::{SCORES, SEALS, SUMMARY, TABLES, TERMS, Trial, TrialError};
use std::path::Path;
use tracktwin_files::{FilesError, Kind, check, make_folder};

/// Names of the folders inside the trial's folder.
const PARTS: [&str; 3] = ["recordings", "sealed", "diagnoses"];

/// Checks that a folder contains a trial, or no file with the name of a trial's file. Such a file would
/// belong to another program.
///
/// # Errors
/// Returns [`FilesError`] with the first file that exists already.
pub fn check_folder(folder: &Path, force: bool) -> Result<(), FilesError> {
    check(folder, Kind::Trial, force, &[TABLES, SCORES, SUMMARY])?;
    if force || folder.join(TERMS).exists() {
        return Ok(());
    }
    let mut paths = PARTS.iter().chain(&[SEALS]).map(|name| folder.join(name));
    match paths.find(|path| Trial::is_taken(path)) {
        Some(path) => Err(FilesError::Foreign { path }),
        None => Ok(()),
    }
}

impl Trial {
    /// Creates the folder.
    pub(super) fn make_folder(&self) -> Result<(), TrialError> {
        check_folder(&self.folder, self.force)?;
        for part in PARTS {
            make_folder(&self.folder.join(part))?;
        }
        Ok(())
    }
    /// Whether the path is a file or a non-empty folder.
    pub(in crate::pipeline) fn is_taken(path: &Path) -> bool {
        match path.read_dir() {
            Ok(mut entries) => entries.next().is_some(),
            Err(_) => path.symlink_metadata().is_ok(),
        }
    }
}
