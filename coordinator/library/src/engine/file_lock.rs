//! The lock of a library's file. The lock is on the file itself and does not depend on the file's name.

use parking_lot::{Mutex, MutexGuard};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The files that this process has locked at least once, by device and inode.
///
/// No descriptor is closed before the process exits: closing any descriptor of a file releases all
/// POSIX locks of the process on that file, including those of `SQLite`.
static FILES: Mutex<BTreeMap<Identity, Locked>> = Mutex::new(BTreeMap::new());

/// Device and inode: identity of a file, independent of links and mounts.
pub(crate) type Identity = [u64; 2];

/// Identity of the file at a path; `None` if there is no file.
pub(crate) fn identity(path: &Path) -> Option<Identity> {
    std::fs::metadata(path).ok().as_ref().map(identity_of)
}

fn identity_of(file: &std::fs::Metadata) -> Identity {
    [file.dev(), file.ino()]
}

struct Locked {
    file: File,
    /// Whether a [`FileLock`] of this process holds the lock at present.
    held: bool,
}

/// The right to lease the cases of a file, until it is dropped. The operating system releases the lock when
/// the process ends for any reason.
#[derive(Debug)]
pub(crate) struct FileLock {
    /// `None` if the file system only supports locks on `_beside`.
    identity: Option<Identity>,
    /// Locked file beside the library. Earlier versions of the program lock only this file.
    _beside: File,
}

impl FileLock {
    /// Takes the lock; `None` if another holder has it, in this process or in another.
    ///
    /// # Errors
    /// Returns the error of the operating system if the file system has no locks or the folder is not
    /// writable.
    pub(crate) fn try_take(path: &Path) -> io::Result<Option<Self>> {
        let beside = File::create(beside(&path.canonicalize()?))?;
        match beside.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(None),
            Err(TryLockError::Error(error)) => return Err(error),
        }
        // A network file system turns this lock into one of the kind that SQLite takes on the same file,
        // and SQLite would wait for it for ever.
        if super::file_system::is_shared_between_hosts(path) {
            return Ok(Some(Self { identity: None, _beside: beside }));
        }
        let Some(identity) = hold(path)? else { return Ok(None) };
        Ok(Some(Self { identity: Some(identity), _beside: beside }))
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        let Some(identity) = self.identity else { return };
        if let Some(locked) = files().get_mut(&identity) {
            locked.held = false;
            if let Err(error) = locked.file.unlock() {
                tracing::warn!("the library's file stays locked until this program exits: {error}");
            }
        }
    }
}

/// Locks the file at a path. Returns its identity; `None` if another holder has the lock.
fn hold(path: &Path) -> io::Result<Option<Identity>> {
    let mut files = files();
    let mut found = identity_of(&std::fs::metadata(path)?);
    if !files.contains_key(&found) {
        let file = File::open(path)?;
        found = identity_of(&file.metadata()?);
        // It may have been replaced just now by one that is known; that one's descriptor stays.
        if let Some(known) = files.insert(found, Locked { file, held: false }) {
            std::mem::forget(files.insert(found, known));
        }
    }
    let Some(locked) = files.get_mut(&found).filter(|it| !it.held) else { return Ok(None) };
    match locked.file.try_lock() {
        Ok(()) => {
            locked.held = true;
            Ok(Some(found))
        }
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

fn beside(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push("-lock");
    PathBuf::from(name)
}

fn files() -> MutexGuard<'static, BTreeMap<Identity, Locked>> {
    FILES.lock()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_name_leads_to_a_file_it_is_locked_once() {
        let folder = tempfile::tempdir().unwrap();
        let [file, hard, soft] =
            ["a.sqlite", "hard.sqlite", "soft.sqlite"].map(|name| folder.path().join(name));
        std::fs::write(&file, "").unwrap();
        std::fs::hard_link(&file, &hard).unwrap();
        std::os::unix::fs::symlink("a.sqlite", &soft).unwrap();
        let round_about =
            folder.path().join("../").join(folder.path().file_name().unwrap()).join("a.sqlite");
        let names = [&file, &hard, &soft, &round_about];
        for first in names {
            let lock = FileLock::try_take(first).unwrap();
            assert!(lock.is_some(), "{}", first.display());
            for second in names {
                let refused = FileLock::try_take(second).unwrap().is_none();
                assert!(refused, "{} beside {}", second.display(), first.display());
            }
            drop(lock);
        }
        std::fs::write(folder.path().join("b.sqlite"), "").unwrap();
        let both =
            ["a.sqlite", "b.sqlite"].map(|it| FileLock::try_take(&folder.path().join(it)).unwrap());
        assert!(both.iter().all(Option::is_some), "two files have two locks");
    }
}
