//! A library in a `SQLite` file.

use super::file_lock::{Identity, identity};
use super::file_system::shared_between_hosts;
use super::retry_budget::RetryBudget;
use super::sqlite_schema::{bring_up_to_date, check_to_read};
use super::{Access, Connection, Readers};
use crate::LibraryError;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{ConnectOptions, Connection as _, SqliteConnection};
use std::ffi::OsStr;
use std::io::{ErrorKind, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `application_id` of a library, set by the first migration.
const APPLICATION_ID: i64 = 0x7477_696e;

/// Time limit of waiting for another writing process.
///
/// The longest writes take seconds. A process that writes for more than half a minute is stuck.
const BUSY_TIMEOUT: Duration = Duration::from_secs(30);

/// Page size of a new library in bytes. Three to five results fit into a page. With the default of 4096
/// bytes, one result fits and a quarter of the page stays empty.
const PAGE_BYTES: u32 = 16_384;

/// Number of pages of the write-ahead log before a checkpoint: 32 MB.
///
/// A checkpoint waits for the disk twice. With the default of 4 MB (300 cases), every second group of
/// reports would cause one.
const LOG_PAGES: &str = "2048";

/// Number of reading connections, in addition to the writing one.
const READERS: u32 = 4;

/// Opens the file, and updates its schema unless it is only read. With [`Access::Create`], initialises an empty file or
/// creates a new one.
pub(super) async fn open(
    path: &Path,
    access: Access,
) -> Result<(Readers, Connection), LibraryError> {
    refuse_what_seems_empty(path)?;
    warn_of_the_place(path);
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(access != Access::Read)
        .read_only(access == Access::Read)
        .page_size(PAGE_BYTES)
        .busy_timeout(BUSY_TIMEOUT)
        .foreign_keys(true);
    let mut connection = options.connect().await.map_err(|error| closed_to_us(error, path))?;
    let is_empty = refuse_foreign_database(&mut connection, path).await?;
    if is_empty && access != Access::Create {
        return Err(LibraryError::Empty { library: path.display().to_string() });
    }
    let connection = if access == Access::Read {
        check_to_read(&mut connection, path).await?;
        connection
    } else {
        connection.close().await?;
        connect_to_write(&options, path).await?
    };
    let readers = SqlitePoolOptions::new()
        .max_connections(READERS)
        .connect_lazy_with(options.create_if_missing(false).pragma("query_only", "on"));
    let file = OpenFile::at(path)?;
    Ok((Readers::Sqlite(readers), Connection::Sqlite(connection, file)))
}

/// Opens the writing connection and updates the schema.
async fn connect_to_write(
    options: &SqliteConnectOptions,
    path: &Path,
) -> Result<SqliteConnection, LibraryError> {
    let options = options
        .clone()
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .pragma("wal_autocheckpoint", LOG_PAGES);
    let mut budget = RetryBudget::new(true);
    let mut connection = loop {
        match options.connect().await.map_err(|error| closed_to_us(error, path)) {
            // Switching to the write-ahead log needs exclusive access, and `SQLite` does not wait
            // for it.
            Err(error) if error.is_temporary() && budget.wait().await.is_ok() => {}
            opened => break opened?,
        }
    };
    bring_up_to_date(&mut connection, path).await?;
    Ok(connection)
}

/// Identity of the open file, to detect that its path no longer leads to it. Data written to a removed or
/// replaced file is lost when the process ends.
pub(crate) struct OpenFile {
    path: PathBuf,
    identity: Identity,
}

impl OpenFile {
    fn at(path: &Path) -> Result<Self, LibraryError> {
        let identity = identity(path).ok_or_else(|| gone(path))?;
        Ok(Self { path: path.to_owned(), identity })
    }

    /// Checks that the path still leads to the open file.
    ///
    /// # Errors
    /// [`LibraryError::FileGone`].
    pub(super) fn check(&self) -> Result<(), LibraryError> {
        match identity(&self.path) {
            Some(found) if found == self.identity => Ok(()),
            _ => Err(gone(&self.path)),
        }
    }
}

fn gone(path: &Path) -> LibraryError {
    LibraryError::FileGone { library: path.display().to_string() }
}

/// Converts the error of opening a file to one with a remedy for the user, if there is a remedy.
fn closed_to_us(error: sqlx::Error, path: &Path) -> LibraryError {
    let library = path.display().to_string();
    let code = error.as_database_error().and_then(sqlx::error::DatabaseError::code);
    // SQLITE_NOTADB.
    if code.as_deref() == Some("26") {
        return LibraryError::NotALibrary { library };
    }
    let not_let_in = |reason: &str| LibraryError::NotLetIn {
        library: path.display().to_string(),
        reason: reason.to_owned(),
    };
    match error.into() {
        LibraryError::NotOpened { .. } => {
            not_let_in("the file cannot be opened or created; check the permissions of its folder")
        }
        LibraryError::NotWritable { .. } => not_let_in(
            "its folder is not writable, which SQLite needs even to read; copy the library",
        ),
        LibraryError::NoLocks { reason, .. } => {
            LibraryError::NoLocks { library: place(path), reason }
        }
        other => other,
    }
}

/// Error for a lock of the library that cannot be taken.
pub(crate) fn not_locked(path: &Path, source: std::io::Error) -> LibraryError {
    match source.kind() {
        // The rights of the folder, or its room, are another matter.
        ErrorKind::PermissionDenied
        | ErrorKind::ReadOnlyFilesystem
        | ErrorKind::StorageFull
        | ErrorKind::QuotaExceeded => {
            LibraryError::Lock { library: path.display().to_string(), source }
        }
        _ => LibraryError::NoLocks { library: place(path), reason: source.to_string() },
    }
}

/// Name of a library, with the name of its file system if several machines may share that.
fn place(path: &Path) -> String {
    match shared_between_hosts(path) {
        Some(name) => format!("library {} (on {name})", path.display()),
        None => format!("library {}", path.display()),
    }
}

/// Logs a warning if the file system is unsuitable for a library.
fn warn_of_the_place(path: &Path) {
    if let Some(name) = shared_between_hosts(path) {
        tracing::warn!(
            "library {}: it is on {name}, which several machines may share; only programs of \
                 one machine at a time may use it there: a local disk is safer, and several \
                 machines need PostgreSQL",
            path.display()
        );
    }
    let links = std::fs::metadata(path).map_or(1, |file| file.nlink());
    if links > 1 {
        tracing::warn!(
            "library {}: the file has {links} hard links, but SQLite stores its write-ahead log \
                 beside the name that was opened: always use the same name, or replace the others \
                 by symbolic links",
            path.display()
        );
    }
}

/// First bytes of every `SQLite` file.
const HEAD: &[u8] = b"SQLite format 3\0";
const BYTES_MIN: usize = 512;

/// Returns an error for files that `SQLite` would treat as empty and overwrite: a short foreign
/// file, a truncated database, and an empty file with a non-empty log.
fn refuse_what_seems_empty(path: &Path) -> Result<(), LibraryError> {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    let Some(begin) = begin(path) else { return Ok(()) };
    let lost = |reason: &str| Err(LibraryError::Malformed { reason: reason.to_owned() });
    match begin.len() {
        0 if begin_of_log(&log) => {
            lost("the file is empty, but its write-ahead log is not: its content is lost")
        }
        0 | BYTES_MIN.. => Ok(()),
        length if begin[..length.min(HEAD.len())] != HEAD[..length.min(HEAD.len())] => {
            Err(LibraryError::NotALibrary { library: path.display().to_string() })
        }
        length => lost(&format!("the file is truncated after {length} bytes")),
    }
}

/// The first bytes of a file; `None` if it cannot be read.
fn begin(path: &Path) -> Option<Vec<u8>> {
    let mut begin = Vec::new();
    let file = std::fs::File::open(path).ok()?;
    file.take(BYTES_MIN as u64).read_to_end(&mut begin).ok()?;
    Some(begin)
}

fn begin_of_log(log: &OsStr) -> bool {
    begin(Path::new(log)).is_some_and(|begin| !begin.is_empty())
}

/// Returns whether the database is empty, and an error if it is a foreign database. Nothing is written.
async fn refuse_foreign_database(
    connection: &mut SqliteConnection,
    path: &Path,
) -> Result<bool, LibraryError> {
    let (application_id, tables): (i64, i64) = sqlx::query_as(
        "select application_id,
            (select count(*) from sqlite_schema where type = 'table' and name <> '_sqlx_migrations')
        from pragma_application_id",
    )
    .fetch_one(connection)
    .await
    .map_err(|error| closed_to_us(error, path))?;
    if application_id != APPLICATION_ID && tables > 0 {
        return Err(LibraryError::NotALibrary { library: path.display().to_string() });
    }
    Ok(application_id != APPLICATION_ID && tables == 0)
}
