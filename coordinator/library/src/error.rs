//! Why a library refuses, or fails.

use crate::engine::{self, SQLITE_FULL};
use sqlx::error::DatabaseError;
use sqlx::migrate::MigrateError;
use std::borrow::Cow;
use std::path::PathBuf;
use std::time::Duration;

/// Why something cannot be read from a library or written to it; one line each.
///
/// `library` is a path, or a URL without its password.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// Not a library URL at all.
    #[error("library {url}: write sqlite:PATH or postgres://USER@HOST/DATABASE")]
    UnknownUrl {
        /// The URL.
        url: String,
    },
    /// A PostgreSQL URL that cannot be read.
    #[error("library {url}: {reason}; write postgres://USER:PASSWORD@HOST:PORT/DATABASE")]
    BadPostgresUrl {
        /// The URL without user and password.
        url: String,
        /// What is wrong with it.
        reason: String,
    },
    /// There is a folder at this path.
    #[error(
        "library {library}: is a folder; give a file, for example \
             sqlite:{library}/library.sqlite"
    )]
    Folder {
        /// The library.
        library: String,
    },
    /// There is nothing at this path.
    #[error(
        "library {library}: the file does not exist; create it with `tracktwin run \
             --library sqlite:{library}`"
    )]
    Missing {
        /// The library.
        library: String,
    },
    /// The database holds no library.
    #[error("library {library}: the database is empty; fill it with `tracktwin run`")]
    Empty {
        /// The library.
        library: String,
    },
    /// The folder of the library does not exist.
    #[error("library {library}: the folder {folder} does not exist; create it first")]
    NoFolder {
        /// The library.
        library: String,
        /// The folder.
        folder: PathBuf,
    },
    /// The file or database is something else.
    #[error("library {library}: not a tracktwin library; correct the path or the database")]
    NotALibrary {
        /// The library.
        library: String,
    },
    /// The server knows no such database or user, or does not let it in.
    #[error("library {library}: {reason}")]
    NotLetIn {
        /// The library.
        library: String,
        /// Error of the server.
        reason: String,
    },
    /// There is no server.
    #[error(
        "library {library}: the server cannot be reached; check host and port, and that the \
             server runs"
    )]
    Unreachable {
        /// The library.
        library: String,
        /// Why not.
        source: sqlx::Error,
    },
    /// A later version of the program has written it.
    #[error(
        "library {library}: its schema {found} is newer than this program's ({known}); use the \
         program that wrote it, or a later one"
    )]
    NewerSchema {
        /// The library.
        library: String,
        /// The library's schema.
        found: i64,
        /// The newest schema known here.
        known: i64,
    },
    /// Another process hands out its cases.
    #[error(
        "library {library}: another process is running a campaign on it; stop it, or wait until \
             it ends"
    )]
    InUse {
        /// The library.
        library: String,
    },
    /// There is no such campaign.
    #[error("the library has no campaign {id}; list the campaigns with `tracktwin library status`")]
    UnknownCampaign {
        /// The campaign.
        id: String,
    },
    /// There is no such worker.
    #[error("the library has no worker {id}; list the workers with `tracktwin status`")]
    UnknownWorker {
        /// The worker.
        id: String,
    },
    /// A campaign of that id but another definition.
    #[error("the library has a campaign {id} with another definition; use another library")]
    OtherDefinition {
        /// The campaign.
        id: String,
    },
    /// A trial's case that was sealed with another truth.
    #[error(
        "trial {trial} in the library has another truth in case {number}; use another seed, \
             or the program version that started it"
    )]
    OtherTruth {
        /// The trial.
        trial: String,
        /// Number of the case.
        number: u32,
    },
    /// A seed that SQL's signed integers cannot hold.
    #[error("the seed {seed} is too large; it must be below 2^63")]
    SeedTooLarge {
        /// The seed.
        seed: u64,
    },
    /// Stored data are invalid.
    #[error("the library is damaged: {what}; list the faults with `tracktwin library verify`")]
    Damaged {
        /// What was found.
        what: String,
    },
    /// Results that are not what their worker reported.
    #[error(
        "the results of case {index} do not match their checksum: a number was altered or a \
             pass was lost after storing; count such cases with `tracktwin library verify`, \
             simulate them again with `tracktwin campaign retry --altered`"
    )]
    Altered {
        /// The first case found so.
        index: u32,
    },
    /// The database is not whole.
    #[error(
        "the library's database is damaged ({reason}) and no longer written to: list the \
             faults with `tracktwin library verify`, copy the intact rows to another library \
             with `tracktwin library copy`"
    )]
    Malformed {
        /// What was found.
        reason: String,
    },
    /// A statement that would write, where only reading is done.
    #[error(
        "`library sql` only reads: give one statement that begins with select, with, values or \
         explain and writes nothing"
    )]
    OnlyReads,
    /// Whoever asks may not write.
    #[error(
        "the library is read-only here: {reason}; grant the right to write, or use another \
             library"
    )]
    NotWritable {
        /// Error of the database.
        reason: String,
    },
    /// A statement that the database does not understand.
    #[error("the database rejects the statement: {reason}")]
    BadQuery {
        /// What it said.
        reason: String,
    },
    /// A row that does not fit its table.
    #[error("a row does not fit the table {table}: {what}")]
    BadRow {
        /// The table.
        table: &'static str,
        /// What does not fit.
        what: String,
    },
    /// The library was closed meanwhile.
    #[error("the library is closed")]
    Closed,
    /// The connection that writes to a file has broken.
    #[error(
        "the writing connection to the library was lost ({reason}); acknowledged results \
             are stored: restart the program"
    )]
    Lost {
        /// What was found.
        reason: String,
    },
    /// The lock of the library's file can't be taken, for want of rights or of room.
    #[error(
        "library {library}: cannot be locked; check the permissions of its folder and the free \
             space"
    )]
    Lock {
        /// The library.
        library: String,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file system has no locks, or no memory that processes share, which `SQLite` needs.
    #[error(
        "{library}: SQLite's locks do not work on its file system ({reason}), which is \
             common on network file systems: put the library on a local disk (--library \
             sqlite:/PATH/ON/A/LOCAL/DISK), or use a PostgreSQL server (--library \
             postgres://USER@HOST/DATABASE)"
    )]
    NoLocks {
        /// The library, and what its file system is called where that is known.
        library: String,
        /// What failed.
        reason: String,
    },
    /// The disk, or the network that it is behind, fails.
    #[error(
        "reading or writing the library's file failed ({reason}): check the system log for \
             disk errors; acknowledged results are stored: repeat the command to continue"
    )]
    Disk {
        /// What failed.
        reason: String,
    },
    /// A file of the library can't be opened though the library is.
    #[error(
        "a file of the library could not be opened ({reason}): check that its folder exists \
             and is writable, and the limit of open files (ulimit -n)"
    )]
    NotOpened {
        /// What failed.
        reason: String,
    },
    /// Another process writes for longer than anybody waits.
    #[error(
        "another program has been writing to the library for longer than 30 s: stop it, or \
             try again later; on a network file system the locks may not work: use a local disk"
    )]
    Busy,
    /// The database does not answer now, and may later.
    #[error("the library's database does not respond: {reason}")]
    Unavailable {
        /// What was found.
        reason: String,
    },
    /// The file was removed or replaced while it was open.
    #[error(
        "library {library}: its file was removed, moved or replaced while it was open; \
             restore it, or stop and start again"
    )]
    FileGone {
        /// The library.
        library: String,
    },
    /// There is no room for what should be written.
    #[error("the library's disk is full; no data is lost: free space and repeat the command")]
    DiskFull,
    /// The database failed.
    #[error("the library's database failed")]
    Database(#[source] sqlx::Error),
    /// A change of the schema failed.
    #[error("the library's schema cannot be updated")]
    Migration(#[source] MigrateError),
}

impl LibraryError {
    /// Whether the user asked for what cannot be, rather than something having failed.
    pub const fn is_wrong_input(&self) -> bool {
        matches!(
            self,
            Self::UnknownUrl { .. }
                | Self::BadPostgresUrl { .. }
                | Self::Missing { .. }
                | Self::Empty { .. }
                | Self::NoFolder { .. }
                | Self::NotALibrary { .. }
                | Self::NotLetIn { .. }
                | Self::NewerSchema { .. }
                | Self::InUse { .. }
                | Self::UnknownCampaign { .. }
                | Self::UnknownWorker { .. }
                | Self::OtherDefinition { .. }
                | Self::OtherTruth { .. }
                | Self::SeedTooLarge { .. }
                | Self::OnlyReads
                | Self::Folder { .. }
                | Self::NoLocks { .. }
                | Self::NotWritable { .. }
                | Self::BadQuery { .. }
                | Self::BadRow { .. }
        )
    }

    /// Whether the operation may succeed later, after a repair of the machine.
    pub const fn is_temporary(&self) -> bool {
        matches!(
            self,
            Self::Unavailable { .. } | Self::DiskFull | Self::FileGone { .. } | Self::Busy
        )
    }

    /// Whether what was read is to blame, not the way to it.
    pub(crate) fn is_of_the_data(&self) -> bool {
        match self {
            Self::Malformed { .. } | Self::Damaged { .. } | Self::Altered { .. } => true,
            Self::Database(error) => {
                matches!(error, sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_))
            }
            _ => false,
        }
    }

    /// Whether what is in the database is to blame, its schema included.
    pub(crate) fn is_of_the_database(&self) -> bool {
        matches!(self, Self::Database(_)) || self.is_of_the_data()
    }

    /// Whether rows that were to be written are to blame: their cells, or what they refer to.
    pub(crate) fn is_about_rows(&self) -> bool {
        match self {
            Self::BadRow { .. } | Self::OtherDefinition { .. } => true,
            Self::Database(error) => code(error).is_some_and(|code| is_constraint(&code)),
            _ => false,
        }
    }

    /// A database without a response for this time.
    pub(crate) fn silent(for_so_long: Duration) -> Self {
        Self::Unavailable { reason: format!("no response within {} s", for_so_long.as_secs()) }
    }

    pub(crate) const fn is_unavailable(&self) -> bool {
        matches!(self, Self::Unavailable { .. })
    }
}

/// The class of PostgreSQL's codes for a connection that broke; and single codes for a server that
/// stops, was stopped, or is not up yet, has no connection left, and for transactions that should
/// simply be tried again.
const POSTGRES_BROKEN: &str = "08";
const POSTGRES_LATER: [&str; 6] = ["57P01", "57P02", "57P03", "53300", "40001", "40P01"];

/// A file or a folder that may only be read; a transaction that only reads; a role without the right.
const NOT_WRITABLE: [&str; 5] = ["8", "776", "1544", "25006", "42501"];

/// `SQLite`'s codes for a malformed file, PostgreSQL's for a malformed page, index or a missing file.
const MALFORMED: [&str; 8] = ["11", "26", "267", "523", "779", "XX001", "XX002", "58P01"];

/// Server-side disk full.
const POSTGRES_FULL: &str = "53100";

/// Constraints that a row breaks: all of `SQLite`'s kinds of it; PostgreSQL's classes of constraints and of data.
fn is_constraint(code: &str) -> bool {
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
