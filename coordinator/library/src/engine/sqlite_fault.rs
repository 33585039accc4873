//! Conversion of the error codes of `SQLite` for faults of disk and locks.

use crate::LibraryError;
use sqlx::sqlite::SqliteError;

/// Codes for a full disk: a full file, or no space for the memory shared between processes.
pub(crate) const SQLITE_FULL: [&str; 2] = ["13", "4874"];

/// Codes for a database that another process has locked for longer than the timeout, or is recovering.
const SQLITE_BUSY: [&str; 3] = ["5", "261", "773"];

/// Codes, with their names, for missing support of the file system: locks, shared memory, and the locking
/// protocol.
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

/// Primary code for a file that cannot be read or written; it is the low byte of the extended codes.
const SQLITE_IOERR: i32 = 10;

/// Primary code for a file that cannot be opened: the library, its log, or a temporary file.
const SQLITE_CANTOPEN: i32 = 14;

/// Converts an error code to a fault of disk or locks; `None` for other errors.
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
