//! Locks that end with their process, held on folders and on files that are being written.

use std::fs::{File, TryLockError};
use std::path::Path;

/// A lock on a folder or file, held until it is dropped.
#[derive(Debug)]
pub(crate) struct Lock {
    _held: Option<File>,
}

impl Lock {
    /// Waits for the lock. On a file system without locks, nothing is held and the call succeeds.
    pub(crate) fn wait(path: &Path) -> Self {
        let held = File::open(path).and_then(|file| file.lock().map(|()| file));
        Self { _held: held.ok() }
    }
}

/// Whether the lock is free; false if this is unknown.
pub(crate) fn is_free(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock | TryLockError::Error(_)) => false,
    }
}
