//! Incomplete files without a final name. They are hidden and locked by the process that writes them.
//! The next writer removes those of ended processes.

use crate::FilesError;
use crate::lock::{Lock, is_free};
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use tempfile::{Builder, NamedTempFile, TempDir};

const PREFIX: &str = ".tracktwin-";
const SUFFIX: &str = ".partial";

/// What the process's umask makes of it is a file's usual mode.
const USUAL: u32 = 0o666;

/// A folder of files that have no names yet.
#[derive(Debug)]
pub(crate) struct Staging {
    folder: TempDir,
    _lock: Lock,
}

impl Staging {
    /// A staging folder inside `folder`, which is there; leftovers of dead writers are removed.
    pub(crate) fn new(folder: &Path) -> Result<Self, FilesError> {
        let _others_wait = Lock::wait(folder);
        sweep(folder);
        let made = Builder::new().prefix(PREFIX).suffix(SUFFIX).tempdir_in(folder);
        let staging = made.map_err(FilesError::written(folder))?;
        let lock = Lock::wait(staging.path());
        Ok(Self { folder: staging, _lock: lock })
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// A file beside `path` that has no name yet, of this mode.
pub(crate) fn file(path: &Path, mode: Option<u32>) -> Result<NamedTempFile, FilesError> {
    let folder = folder_of(path);
    let _others_wait = Lock::wait(folder);
    sweep(folder);
    let permissions = Permissions::from_mode(mode.unwrap_or(USUAL));
    let made =
        Builder::new().prefix(PREFIX).suffix(SUFFIX).permissions(permissions).tempfile_in(folder);
    let file = made.map_err(FilesError::written(path))?;
    // Without locks nothing is cleaned up.
    let _ = file.as_file().lock();
    Ok(file)
}

/// The folder of a file.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Removes what dead writers have left.
fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(PREFIX) && name.ends_with(SUFFIX) && is_free(&entry.path()) {
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            let path = entry.path();
            // What can't be removed does no harm.
            let _ =
                if is_folder { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
        }
    }
}
