//! Opening and closing of a library.

use crate::LibraryError;
use crate::engine::{
    self, Access, Connection, FileLock, Opened, Readers, Target, Write, iso_utc, sql,
};
use crate::lease::QueueCursor;
use std::path::Path;
use std::sync::Arc;

/// A model library. Clones share its connections.
#[derive(Clone)]
pub struct Library {
    opened: Arc<Opened>,
    cursor: Arc<QueueCursor>,
}

/// The right to lease a library's cases, until it is dropped.
#[derive(Debug)]
pub struct Claim {
    lock: Option<FileLock>,
}

impl Claim {
    /// Whether only this process can lease cases. Then existing leases belong to workers that no longer
    /// run.
    pub const fn is_exclusive(&self) -> bool {
        self.lock.is_some()
    }
}

impl Library {
    /// Opens the library at `sqlite:PATH` or `postgres://...`, and updates its schema.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if the URL is invalid, if nothing or something other than a library exists
    /// there, or if a later version of the program has written it.
    pub async fn open(url: &str) -> Result<Self, LibraryError> {
        let library = Self::of(engine::open(url, Access::Write).await?);
        match library.add_missing_bins().await {
            // A damaged library is opened as well, for verification and salvage.
            Err(error) if !error.is_of_the_database() => Err(error),
            _ => Ok(library),
        }
    }

    /// Opens the library at `sqlite:PATH` or `postgres://...` for reading. Nothing is written, and every write
    /// returns [`LibraryError::NotWritable`]. With `SQLite`, other programs may read and write meanwhile; the
    /// files of its write-ahead log (`-wal`, `-shm`) are created if they are missing.
    ///
    /// # Errors
    /// As [`Library::open`], and [`LibraryError::OlderSchema`] if the schema must be updated first.
    pub async fn open_to_read(url: &str) -> Result<Self, LibraryError> {
        Ok(Self::of(engine::open(url, Access::Read).await?))
    }

    /// Opens the library at `sqlite:PATH` or `postgres://...`, or creates an empty one.
    ///
    /// # Errors
    /// As [`Library::open`], and [`LibraryError::NoFolder`] if the folder does not exist.
    pub async fn open_or_create(url: &str) -> Result<Self, LibraryError> {
        Ok(Self::of(engine::open_or_create(url).await?))
    }

    fn of(opened: Opened) -> Self {
        Self { opened: Arc::new(opened), cursor: Arc::default() }
    }

    /// Finishes pending writes and closes the connections. Calls on a remaining clone return an
    /// error.
    pub async fn close(self) {
        self.opened.writer.close().await;
        self.opened.readers.close().await;
    }

    /// Checks whether this process can still write to the library. It cannot after [`Library::close`], after
    /// an internal error of the program during a write, or after the connection to the file was lost.
    ///
    /// # Errors
    /// Returns [`LibraryError::Closed`] or [`LibraryError::Lost`]. The program must be restarted.
    pub fn takes_writes(&self) -> Result<(), LibraryError> {
        self.opened.writer.runs()
    }

    /// Name of the library: the path of its file, or its URL without password.
    pub fn name(&self) -> String {
        self.opened.target.name()
    }

    /// Path of the library's file; `None` for a library on a server.
    pub fn path(&self) -> Option<&Path> {
        self.opened.target.path()
    }

    /// Whether this library is the file to which another URL leads, by any spelling or link.
    pub fn is_at(&self, url: &str) -> bool {
        let other = Target::parse(url).ok();
        let identity = |target: &Target| target.path().and_then(engine::identity);
        identity(self.target()).is_some_and(|own| other.as_ref().and_then(identity) == Some(own))
    }

    /// Present time of the library's clock, in ms since 1970. Leases begin and end by this clock.
    ///
    /// With `SQLite` it is the clock of this machine, with PostgreSQL that of the server. Coordinators
    /// whose clocks differ or are adjusted therefore agree on the end of a lease.
    pub fn now_unix_ms(&self) -> i64 {
        self.opened.clock.unix_ms()
    }

    /// Claims the right to lease cases. With `SQLite`, one process at a time can have it; with PostgreSQL,
    /// any number of processes.
    ///
    /// The operating system releases the claim when the process ends for any reason.
    ///
    /// # Errors
    /// Returns [`LibraryError::InUse`] if another process has the claim; [`LibraryError::NoLocks`] if the
    /// file system has no locks.
    pub fn claim(&self) -> Result<Claim, LibraryError> {
        let Some(path) = self.opened.target.path() else { return Ok(Claim { lock: None }) };
        match FileLock::try_take(path) {
            Ok(Some(lock)) => Ok(Claim { lock: Some(lock) }),
            Ok(None) => Err(LibraryError::InUse { library: self.name() }),
            Err(source) => Err(engine::not_locked(path, source)),
        }
    }

    /// Checks that this program has the right to write to the library.
    ///
    /// # Errors
    /// Returns [`LibraryError::NotWritable`] if it has not, or another error if the library does not
    /// respond.
    pub async fn check_writable(&self) -> Result<(), LibraryError> {
        self.write(CheckWritable).await
    }

    /// Checks that the database is intact, so that nothing is added to a damaged one. With `SQLite`, the
    /// check reads the whole file. A PostgreSQL server checks each page itself when it reads the page.
    ///
    /// # Errors
    /// Returns [`LibraryError::Malformed`] if the database is damaged.
    pub async fn check_whole(&self) -> Result<(), LibraryError> {
        self.readers().refuse_malformed().await
    }

    pub(crate) fn target(&self) -> &Target {
        &self.opened.target
    }

    pub(crate) fn readers(&self) -> &Readers {
        &self.opened.readers
    }

    pub(crate) fn cursor(&self) -> Arc<QueueCursor> {
        self.cursor.clone()
    }

    pub(crate) async fn write<W: Write>(&self, write: W) -> Result<W::Answer, LibraryError> {
        self.opened.writer.write(write).await
    }

    /// Stores a record with the present time.
    pub(crate) async fn write_dated<T>(
        &self,
        it: T,
    ) -> Result<<Dated<T> as Write>::Answer, LibraryError>
    where
        Dated<T>: Write,
    {
        self.write(Dated { it, at: iso_utc(self.now_unix_ms()) }).await
    }
}

/// A record with the time of storing it.
pub(crate) struct Dated<T> {
    pub(crate) it: T,
    /// Time by the library's clock, as ISO 8601.
    pub(crate) at: String,
}

/// A write that changes nothing.
struct CheckWritable;

impl Write for CheckWritable {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        connection
            .execute(sql("update campaign set state = state where id is null"))
            .await
            .map(drop)
    }
}
