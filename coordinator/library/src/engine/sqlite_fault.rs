//! Faults of disk and locks in `SQLite`'s error codes.

use crate::LibraryError;
use sqlx::sqlite::SqliteError;

/// The disk is full: found in a file, or in the memory shared between processes.
pub(crate) const SQLITE_FULL: [&str; 2] = ["13", "4874"];

/// Another process wrote for longer than anybody waits, or recovered what a third had left.
const SQLITE_BUSY: [&str; 3] = ["5", "261", "773"];

/// Names of `SQLite`'s codes for missing locks of the file system: locks, shared memory, and the
/// locking protocol.
const SQLITE_NO_LOCKS: [(&str, &str); 8] = [
    ("3850", "SQLITE_IOERR_LOCK"),
    ("2058", "SQLITE_IOERR_UNLOCK"),
    ("2314", "SQLITE_IOERR_RDLOCK"),
    ("3594", "SQLITE_IOERR_CHECKRESERVEDLOCK"),
    ("4618", "SQLITE_IOERR_SHMOPEN"),
    ("5130", "SQLITE_IOERR_SHMLOCK"),
    ("5386", "SQLITE_IOERR_SHMMAP"),
    ("15", "SQLITE_PROTOCOL"),
];

/// `SQLite`'s primary code for a file that can't be read or written; the low byte of all its kinds.
const SQLITE_IOERR: i32 = 10;

/// `SQLite`'s primary code for a file that can't be opened: the library's, its log's, or a temporary one.
const SQLITE_CANTOPEN: i32 = 14;

/// Fault of disk or locks that a code reports, if any.
pub(crate) fn sqlite_fault(error: &sqlx::Error) -> Option<LibraryError> {
    let fault = error.as_database_error()?;
    fault.try_downcast_ref::<SqliteError>()?;
    let code = fault.code()?;
    if SQLITE_FULL.contains(&&*code) {
        return None;
    }
    if SQLITE_BUSY.contains(&&*code) {
        return Some(LibraryError::Busy);
    }
    if let Some((code, name)) = SQLITE_NO_LOCKS.iter().find(|(known, _)| *known == code) {
        let reason = format!("{name}, code {code}");
        return Some(LibraryError::NoLocks { library: "the library".to_owned(), reason });
    }
    let reason = || format!("SQLite's code {code}, {}", fault.message());
    match code.parse::<i32>().ok()? & 0xff {
        SQLITE_IOERR => Some(LibraryError::Disk { reason: reason() }),
        SQLITE_CANTOPEN => Some(LibraryError::NotOpened { reason: reason() }),
        _ => None,
    }
}
