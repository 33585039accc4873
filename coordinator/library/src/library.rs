//! Opening and closing a library; the connections to it.

use crate::LibraryError;
use crate::url::sqlite_path;
use crate::writer::{Write, Writer};
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{ConnectOptions, Connection, SqliteConnection};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

static MIGRATIONS: Migrator = sqlx::migrate!("../../migrations/sqlite");

/// `application_id` of a library, set by the first migration.
const APPLICATION_ID: i64 = 0x7477_696e;

/// How long to wait for another process that writes.
///
/// The longest write is a thousand cases; anything beyond half a minute is a stuck process.
const BUSY_TIMEOUT: Duration = Duration::from_secs(30);

/// Connections that read beside the one that writes.
const READERS: u32 = 4;

/// A model library. Clones share its connections.
#[derive(Clone)]
pub struct Library(Arc<Inner>);

struct Inner {
    path: PathBuf,
    readers: SqlitePool,
    writer: Writer,
}

/// The right to hand out a library's cases, until it is dropped.
#[derive(Debug)]
pub struct Claim {
    _lock: File,
}

impl Library {
    /// Opens the library at `sqlite:PATH`, bringing its schema up to date.
    ///
    /// # Errors
    /// [`LibraryError`] when the URL is none, nothing is there, it is no library, or a later
    /// version of the program has written it.
    pub async fn open(url: &str) -> Result<Self, LibraryError> {
        let path = sqlite_path(url)?;
        if !path.is_file() {
            return Err(LibraryError::Missing { path });
        }
        Self::connect(path).await
    }

    /// Opens the library at `sqlite:PATH`, or makes an empty one there.
    ///
    /// # Errors
    /// As [`Library::open`]; and when the folder that should hold it is not there.
    pub async fn open_or_create(url: &str) -> Result<Self, LibraryError> {
        let path = sqlite_path(url)?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            let folder = folder.to_owned();
            return Err(LibraryError::NoFolder { path, folder });
        }
        Self::connect(path).await
    }

    async fn connect(path: PathBuf) -> Result<Self, LibraryError> {
        let options = SqliteConnectOptions::new()
            .filename(&path)
            .create_if_missing(true)
            .busy_timeout(BUSY_TIMEOUT)
            .foreign_keys(true);
        let mut connection =
            options.connect().await.map_err(|error| not_a_database(error, &path))?;
        refuse_strangers(&mut connection, &path).await?;
        connection.close().await?;

        // Only now, since it changes the file.
        let options =
            options.journal_mode(SqliteJournalMode::Wal).synchronous(SqliteSynchronous::Full);
        let mut connection = options.connect().await?;
        migrate(&mut connection, &path).await?;
        let readers = SqlitePoolOptions::new()
            .max_connections(READERS)
            .connect_lazy_with(options.create_if_missing(false).pragma("query_only", "on"));
        Ok(Self(Arc::new(Inner { path, readers, writer: Writer::start(connection) })))
    }

    /// Finishes what was ordered and closes the connections. Whoever still holds a clone is told
    /// that the library is closed.
    pub async fn close(self) {
        self.0.writer.close().await;
        self.0.readers.close().await;
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// Claims the right to hand out cases: with `SQLite`, one process at a time has it.
    ///
    /// The system takes it back when the process ends, however it ends.
    ///
    /// # Errors
    /// [`LibraryError::InUse`] when another process has it.
    pub fn claim(&self) -> Result<Claim, LibraryError> {
        let mut name = self.0.path.clone().into_os_string();
        name.push("-lock");
        let failed = |source| LibraryError::Lock { path: self.0.path.clone(), source };
        let lock = File::create(PathBuf::from(name)).map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => Ok(Claim { _lock: lock }),
            Err(std::fs::TryLockError::WouldBlock) => {
                Err(LibraryError::InUse { path: self.0.path.clone() })
            }
            Err(std::fs::TryLockError::Error(source)) => Err(failed(source)),
        }
    }

    pub(crate) fn readers(&self) -> &SqlitePool {
        &self.0.readers
    }

    pub(crate) async fn write<W: Write>(&self, write: W) -> Result<W::Answer, LibraryError> {
        self.0.writer.write(write).await
    }
}

/// `SQLITE_NOTADB`, the result code for a file that is no database.
fn not_a_database(error: sqlx::Error, path: &Path) -> LibraryError {
    match error.as_database_error().and_then(sqlx::error::DatabaseError::code) {
        Some(code) if code == "26" => LibraryError::NotALibrary { path: path.to_owned() },
        _ => error.into(),
    }
}

/// Refuses a database of somebody else, before anything is written to it.
async fn refuse_strangers(
    connection: &mut SqliteConnection,
    path: &Path,
) -> Result<(), LibraryError> {
    let (application_id, tables): (i64, i64) = sqlx::query_as(
        "select application_id,
            (select count(*) from sqlite_schema where type = 'table' and name <> '_sqlx_migrations')
        from pragma_application_id",
    )
    .fetch_one(connection)
    .await
    .map_err(|error| not_a_database(error, path))?;
    if application_id != APPLICATION_ID && tables > 0 {
        return Err(LibraryError::NotALibrary { path: path.to_owned() });
    }
    Ok(())
}

async fn migrate(connection: &mut SqliteConnection, path: &Path) -> Result<(), LibraryError> {
    let known = MIGRATIONS.iter().map(|migration| migration.version).max().unwrap_or(0);
    MIGRATIONS.run(connection).await.map_err(|error| match error {
        MigrateError::VersionMissing(found) if found > known => {
            LibraryError::NewerSchema { path: path.to_owned(), found, known }
        }
        other => other.into(),
    })
}
