//! Conversion of database errors by their codes.

use crate::LibraryError;
use crate::engine::{self, SQLITE_FULL};
use sqlx::error::DatabaseError;
use sqlx::migrate::MigrateError;
use std::borrow::Cow;

/// Class of PostgreSQL's codes for a broken connection. The single codes are for a server that stops, was
/// stopped, is starting, or has no free connection, and for transactions that should be repeated.
const POSTGRES_BROKEN: &str = "08";
const POSTGRES_LATER: [&str; 6] = ["57P01", "57P02", "57P03", "53300", "40001", "40P01"];

/// Codes for a read-only file or folder, a read-only transaction, and a role without the right to write.
const NOT_WRITABLE: [&str; 5] = ["8", "776", "1544", "25006", "42501"];

/// Codes for damage: a malformed file (`SQLite`); a malformed page or index, or a missing file
/// (PostgreSQL).
const MALFORMED: [&str; 8] = ["11", "26", "267", "523", "779", "XX001", "XX002", "58P01"];

/// Code of PostgreSQL for a full disk.
const POSTGRES_FULL: &str = "53100";

/// Whether an error is a violated constraint: all such codes of `SQLite`, and PostgreSQL's classes for constraints
/// and for data.
pub(crate) fn is_constraint(error: &sqlx::Error) -> bool {
    let Some(code) = code(error) else { return false };
    if code.len() == 5 {
        return code.starts_with("23") || code.starts_with("22");
    }
    code.parse::<u32>().is_ok_and(|code| code % 256 == 19)
}

fn code(error: &sqlx::Error) -> Option<String> {
    error.as_database_error().and_then(DatabaseError::code).map(Cow::into_owned)
}

impl From<MigrateError> for LibraryError {
    fn from(error: MigrateError) -> Self {
        match error {
            MigrateError::Execute(error) => match Self::from(error) {
                Self::Database(error) => Self::Migration(MigrateError::Execute(error)),
                known => known,
            },
            other => Self::Migration(other),
        }
    }
}

impl From<sqlx::Error> for LibraryError {
    fn from(error: sqlx::Error) -> Self {
        use sqlx::Error::{Io, PoolTimedOut, Protocol, Tls, WorkerCrashed};
        if matches!(error, Io(_) | PoolTimedOut | Protocol(_) | Tls(_) | WorkerCrashed) {
            return Self::Unavailable { reason: error.to_string() };
        }
        if matches!(error, sqlx::Error::PoolClosed) {
            return Self::Closed;
        }
        if let Some(fault) = engine::sqlite_fault(&error) {
            return fault;
        }
        match code(&error).as_deref() {
            Some(code) if SQLITE_FULL.contains(&code) || code == POSTGRES_FULL => Self::DiskFull,
            Some(code)
                if POSTGRES_LATER.contains(&code)
                    || (code.len() == 5 && code.starts_with(POSTGRES_BROKEN)) =>
            {
                Self::Unavailable { reason: error.to_string() }
            }
            Some(code) if MALFORMED.contains(&code) => {
                let reason = error.as_database_error().map(DatabaseError::message);
                Self::Malformed { reason: reason.unwrap_or_default().to_owned() }
            }
            Some(code) if NOT_WRITABLE.contains(&code) => {
                let reason = error.as_database_error().map(DatabaseError::message);
                Self::NotWritable { reason: reason.unwrap_or_default().to_owned() }
            }
            _ => Self::Database(error),
        }
    }
}
