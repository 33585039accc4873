//! Files and folders that the user names; what can't be had is said with its path.

use anyhow::{Context, Result};
use std::path::Path;

/// Makes a folder and those above it.
pub(super) fn make_folder(path: &Path) -> Result<()> {
    let unmakable = || format!("{}: the folder cannot be made", path.display());
    std::fs::create_dir_all(path).with_context(unmakable)
}

/// What a file holds.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| unreadable(path))
}

/// What a file of text holds.
pub(super) fn read_text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| unreadable(path))
}

fn unreadable(path: &Path) -> String {
    format!("{}: cannot be read", path.display())
}
