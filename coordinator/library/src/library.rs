//! Opening and closing a library; the connections to it.

use crate::LibraryError;
use crate::engine::{self, Connection, FileLock, Opened, Readers, Target, Write, iso_utc, sql};
use crate::lease::QueueCursor;
use std::path::Path;
use std::sync::Arc;

/// A model library. Clones share its connections.
#[derive(Clone)]
pub struct Library {
    opened: Arc<Opened>,
    cursor: Arc<QueueCursor>,
}

/// The right to hand out a library's cases, until it is dropped.
#[derive(Debug)]
pub struct Claim {
    lock: Option<FileLock>,
}

impl Claim {
    /// Whether this process alone leases cases, so that existing leases belong to no running
    /// worker.
    pub const fn is_exclusive(&self) -> bool {
        self.lock.is_some()
    }
}

impl Library {
    /// Opens the library at `sqlite:PATH` or `postgres://...`, bringing its schema up to date.
    ///
    /// # Errors
    /// [`LibraryError`] when the URL is none, nothing is there, it is no library, or a later
    /// version of the program has written it.
    pub async fn open(url: &str) -> Result<Self, LibraryError> {
        let library = Self::of(engine::open(url).await?);
        match library.add_missing_bins().await {
            // A damaged library is opened as well, for verification and salvage.
            Err(error) if !error.is_of_the_database() => Err(error),
            _ => Ok(library),
        }
    }

    /// Opens the library at `sqlite:PATH` or `postgres://...`, or makes an empty one there.
    ///
    /// # Errors
    /// As [`Library::open`]; and when its folder does not exist.
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
    /// Why not: [`LibraryError::Closed`] or [`LibraryError::Lost`]. A restart is required.
    pub fn takes_writes(&self) -> Result<(), LibraryError> {
        self.opened.writer.runs()
    }

    /// Its name: its file, or its URL without user and password.
    pub fn name(&self) -> String {
        self.opened.target.name()
    }

    /// Its file, where it is in one.
    pub fn path(&self) -> Option<&Path> {
        self.opened.target.path()
    }

    /// The library's clock, in ms since 1970: what leases are given and ended by.
    ///
    /// With `SQLite` it is this machine's. With PostgreSQL it is the server's, so that coordinators
    /// with different or adjusted clocks agree on the end of a lease.
    pub fn now_unix_ms(&self) -> i64 {
        self.opened.clock.unix_ms()
    }

    /// Claims the right to lease cases. With `SQLite` one process at a time has it; with PostgreSQL
    /// any number of processes.
    ///
    /// The system takes it back when the process ends, however it ends.
    ///
    /// # Errors
    /// [`LibraryError::InUse`] when another process has it; [`LibraryError::NoLocks`] where the file system
    /// has no locks.
    pub fn claim(&self) -> Result<Claim, LibraryError> {
        let Some(path) = self.opened.target.path() else { return Ok(Claim { lock: None }) };
        match FileLock::try_take(path) {
            Ok(Some(lock)) => Ok(Claim { lock: Some(lock) }),
            Ok(None) => Err(LibraryError::InUse { library: self.name() }),
            Err(source) => Err(engine::not_locked(path, source)),
        }
    }

    /// Finds out whether this program may write at all.
    ///
    /// # Errors
    /// [`LibraryError::NotWritable`] when it may not, or when the library does not answer.
    pub async fn check_writable(&self) -> Result<(), LibraryError> {
        self.write(CheckWritable).await
    }

    /// Checks whether the database is intact, so that nothing is added to a damaged one. With `SQLite` it
    /// reads the file once. A PostgreSQL server checks the pages that it reads by itself.
    ///
    /// # Errors
    /// [`LibraryError::Malformed`] when it is not.
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

    /// Stores something with the time that it is.
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

/// Something that is stored, and when that is.
pub(crate) struct Dated<T> {
    pub(crate) it: T,
    /// By the library's clock, as ISO 8601.
    pub(crate) at: String,
}

/// Changes nothing.
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
