//! Files and folders that the user names; what can't be had is said with its path.

use anyhow::{Context, Result};
use std::path::Path;

/// Makes a folder and those above it, and makes sure that files can be written to it: before anything that
/// takes time is done for them.
pub(super) fn make_folder(path: &Path) -> Result<()> {
    let unmakable = || format!("{}: the folder cannot be made", path.display());
    std::fs::create_dir_all(path).with_context(unmakable)?;
    let probe = path.join(format!(".tracktwin-{}", std::process::id()));
    let unwritable = || format!("{}: nothing can be written to the folder", path.display());
    std::fs::File::create_new(&probe).with_context(unwritable)?;
    std::fs::remove_file(&probe).with_context(unwritable)
}

/// Bytes that may still be written where a folder is; nothing where the system does not tell.
pub(super) fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_made_and_left_empty_and_one_that_takes_no_files_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b");
        make_folder(&deep).unwrap();
        assert_eq!(std::fs::read_dir(&deep).unwrap().count(), 0);
        assert!(free_bytes(&deep).is_some_and(|free| free > 0));
        // Nobody writes there, not even the superuser.
        let refused = make_folder(Path::new("/proc/self")).unwrap_err();
        assert!(refused.to_string().starts_with("/proc/self: "), "{refused}");
    }
}
