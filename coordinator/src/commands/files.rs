//! Files and folders named by the user; errors state the path.

use clap::Args;
use std::fs::File;
use std::io::Write as _;
use std::path::Path;
use tracktwin_files::{FileName, FilesError, Kind, Output};

/// Treatment of existing files.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct Force {
    /// Also replace files that tracktwin did not write; files that it wrote are always replaced.
    #[arg(long)]
    pub(super) force: bool,
}

/// Creates a folder and its parents and checks that files can be written to it, before a long
/// computation.
pub(super) fn make_folder(path: &Path) -> Result<(), FilesError> {
    tracktwin_files::make_folder(path)?;
    let probe = path.join(format!(".tracktwin-{}", std::process::id()));
    let unwritable =
        |source| FilesError::System { path: path.to_owned(), action: "written to", source };
    File::create_new(&probe).map_err(unwritable)?;
    std::fs::remove_file(&probe).map_err(unwritable)
}

/// Free bytes on the disk of a folder; `None` if the system does not report them.
pub(super) fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// Checks, before a computation, that files of a folder may be written.
pub(super) fn check(
    folder: &Path,
    kind: Kind,
    Force { force }: Force,
    names: &[&str],
) -> Result<(), FilesError> {
    tracktwin_files::check(folder, kind, force, names)
}

/// As [`check`], for a single file.
pub(super) fn check_file(path: &Path, kind: Kind, force: Force) -> Result<(), FilesError> {
    if is_stream(path) {
        return Ok(());
    }
    let (folder, name) = FileName::of_path(path)?;
    check(&folder, kind, force, &[name.as_str()])
}

/// Writes a single file atomically; a pipe or device is written directly.
pub(super) fn write_file(
    path: &Path,
    kind: Kind,
    Force { force }: Force,
    bytes: &[u8],
) -> Result<(), FilesError> {
    if is_stream(path) {
        return stream(path, bytes);
    }
    let (folder, name) = FileName::of_path(path)?;
    let mut output = Output::in_folder(&folder, kind, force)?;
    output.add(&name, bytes)?;
    output.commit()
}

/// Whether a path is a pipe, a device or the like, which cannot be replaced.
pub(super) fn is_stream(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir())
}

fn stream(path: &Path, bytes: &[u8]) -> Result<(), FilesError> {
    let written = File::options().write(true).open(path).and_then(|mut it| it.write_all(bytes));
    written.map_err(|source| FilesError::System {
        path: path.to_owned(),
        action: "written",
        source,
    })
}

/// Content of a small file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, FilesError> {
    tracktwin_files::read(path)
}

/// Content of a small text file.
pub(super) fn read_text(path: &Path) -> Result<String, FilesError> {
    tracktwin_files::read_text(path)
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
        // Not even the superuser can write there.
        let refused = make_folder(Path::new("/proc/self")).unwrap_err();
        assert!(refused.to_string().starts_with("/proc/self: "), "{refused}");
    }
}
