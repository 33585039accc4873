//! Errors of a library.

use sqlx::migrate::MigrateError;
use std::path::PathBuf;

/// Errors of reading or writing a library. Each message is one line.
///
/// `library` is a path, or a URL without its password.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// The text is not a library URL.
    #[error("library {url}: write sqlite:PATH or postgres://USER@HOST/DATABASE")]
    UnknownUrl {
        /// The given URL.
        url: String,
    },
    /// A PostgreSQL URL that cannot be parsed.
    #[error("library {url}: {reason}; write postgres://USER:PASSWORD@HOST:PORT/DATABASE")]
    BadPostgresUrl {
        /// The URL without user and password.
        url: String,
        /// Cause.
        reason: String,
    },
    /// The path leads to a folder.
    #[error(
        "library {library}: is a folder; give a file, for example \
             sqlite:{library}/library.sqlite"
    )]
    Folder {
        /// Path of the folder.
        library: String,
    },
    /// No file exists at the path.
    #[error(
        "library {library}: the file does not exist; create it with `tracktwin run \
             --library sqlite:{library}`"
    )]
    Missing {
        /// Path of the file.
        library: String,
    },
    /// The database exists but contains no library.
    #[error("library {library}: the database is empty; fill it with `tracktwin run`")]
    Empty {
        /// Name of the library.
        library: String,
    },
    /// The folder of the library's file does not exist.
    #[error("library {library}: the folder {folder} does not exist; create it first")]
    NoFolder {
        /// Path of the library.
        library: String,
        /// Path of the missing folder.
        folder: PathBuf,
    },
    /// The file or database exists but is not a library of this program.
    #[error("library {library}: not a tracktwin library; correct the path or the database")]
    NotALibrary {
        /// Name of the library.
        library: String,
    },
    /// The server has no such database or user, or access is denied.
    #[error("library {library}: {reason}")]
    NotLetIn {
        /// Name of the library.
        library: String,
        /// Error message of the server or of the file system.
        reason: String,
    },
    /// The server cannot be reached.
    #[error(
        "library {library}: the server cannot be reached; check host and port, and that the \
             server runs"
    )]
    Unreachable {
        /// Name of the library.
        library: String,
        /// Error of the connection.
        source: sqlx::Error,
    },
    /// A later version of the program has written the library.
    #[error(
        "library {library}: its schema {found} is newer than this program's ({known}); use the \
         program that wrote it, or a later one"
    )]
    NewerSchema {
        /// Name of the library.
        library: String,
        /// Version of the library's schema.
        found: i64,
        /// Newest version that this program supports.
        known: i64,
    },
    /// An earlier version of the program has written the library, which is opened for reading only.
    #[error(
        "library {library}: its schema {found} is older than this program's ({known}), and \
             commands that only read do not change it: upgrade it with `tracktwin library \
             upgrade`, or use the program that wrote it"
    )]
    OlderSchema {
        /// Name of the library.
        library: String,
        /// Version of the library's schema.
        found: i64,
        /// Version that this program needs.
        known: i64,
    },
    /// Another process has claimed the right to lease the library's cases.
    #[error(
        "library {library}: another process is running a campaign on it; stop it, or wait until \
             it ends"
    )]
    InUse {
        /// Name of the library.
        library: String,
    },
    /// The library has no campaign with this id.
    #[error("the library has no campaign {id}; list the campaigns with `tracktwin library status`")]
    UnknownCampaign {
        /// Id of the campaign.
        id: String,
    },
    /// The library has no worker with this name.
    #[error("the library has no worker {id}; list the workers with `tracktwin status`")]
    UnknownWorker {
        /// Name of the worker.
        id: String,
    },
    /// The library has a campaign with the same id and another definition.
    #[error("the library has a campaign {id} with another definition; use another library")]
    OtherDefinition {
        /// Id of the campaign.
        id: String,
    },
    /// Another version of the physics has computed the results of the campaign.
    #[error(
        "campaign {campaign} was computed with model {stored}, but this program has model \
             {own}: use the version that computed it, start a new campaign (another `name` in \
             its file), or let `tracktwin campaign retry {campaign} --other-model` delete those \
             results and compute them again"
    )]
    OtherModel {
        /// Id of the campaign.
        campaign: String,
        /// Hash of the model that computed the results.
        stored: String,
        /// Hash of this program's model.
        own: String,
    },
    /// Several versions of the physics have computed the results of the campaign.
    #[error(
        "campaign {campaign} has results of two models, {one} and {other} (case {index}): \
             `tracktwin campaign retry {campaign} --other-model` deletes those of other models \
             than this program's, and `tracktwin run` or a coordinator computes them again"
    )]
    MixedModels {
        /// Id of the campaign.
        campaign: String,
        /// Hash of the model that computed the case with the lowest index.
        one: String,
        /// Hash of the other model.
        other: String,
        /// Lowest index of a case of the other model.
        index: u32,
    },
    /// Results of the campaign are flagged, because their worker computed wrong results.
    #[error(
        "campaign {campaign} has results of a worker that computed wrong results (the first is \
             case {index}: {reason}): `tracktwin campaign retry {campaign} --flagged` deletes \
             them, and `tracktwin run` or a coordinator computes them again"
    )]
    Flagged {
        /// Id of the campaign.
        campaign: String,
        /// Lowest index of a case with flagged results.
        index: u32,
        /// Reason of the flag.
        reason: String,
    },
    /// A case of a trial was sealed with another truth.
    #[error(
        "trial {trial} in the library has another truth in case {number}; use another seed, \
             or the program version that started it"
    )]
    OtherTruth {
        /// Id of the trial.
        trial: String,
        /// Number of the case.
        number: u32,
    },
    /// A seed that does not fit into a signed integer of SQL.
    #[error("the seed {seed} is too large; it must be below 2^63")]
    SeedTooLarge {
        /// The seed.
        seed: u64,
    },
    /// The stored data are invalid.
    #[error("the library is damaged: {what}; list the faults with `tracktwin library verify`")]
    Damaged {
        /// Description of the invalid data.
        what: String,
    },
    /// Stored results differ from those that their worker reported.
    #[error(
        "the results of case {index} do not match their checksum: a number was altered or a \
             pass was lost after storing; count such cases with `tracktwin library verify`, \
             simulate them again with `tracktwin campaign retry --altered`"
    )]
    Altered {
        /// Lowest index of an affected case found so far.
        index: u32,
    },
    /// The database itself is damaged.
    #[error(
        "the library's database is damaged ({reason}) and no longer written to: list the \
             faults with `tracktwin library verify`, copy the intact rows to another library \
             with `tracktwin library copy`"
    )]
    Malformed {
        /// First fault that the database reports.
        reason: String,
    },
    /// The statement would write, but only reading is allowed.
    #[error(
        "`library sql` only reads: give one statement that begins with select, with, values or \
         explain and writes nothing"
    )]
    OnlyReads,
    /// The user or the process has no right to write.
    #[error(
        "the library is read-only here: {reason}; grant the right to write, or use another \
             library"
    )]
    NotWritable {
        /// Error message of the database.
        reason: String,
    },
    /// The database rejects a statement.
    #[error("the database rejects the statement: {reason}")]
    BadQuery {
        /// Error message of the database.
        reason: String,
    },
    /// A row does not fit its table.
    #[error("a row does not fit the table {table}: {what}")]
    BadRow {
        /// Name of the table.
        table: &'static str,
        /// Description of the misfit.
        what: String,
    },
    /// The library was closed before the call.
    #[error("the library is closed")]
    Closed,
    /// The writing connection to a file was lost.
    #[error(
        "the writing connection to the library was lost ({reason}); acknowledged results \
             are stored: restart the program"
    )]
    Lost {
        /// Cause.
        reason: String,
    },
    /// The lock of the library's file cannot be taken, because of missing permissions or disk space.
    #[error(
        "library {library}: cannot be locked; check the permissions of its folder and the free \
             space"
    )]
    Lock {
        /// Path of the library.
        library: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file system does not support locks or shared memory, which `SQLite` needs.
    #[error(
        "{library}: SQLite's locks do not work on its file system ({reason}), which is \
             common on network file systems: put the library on a local disk (--library \
             sqlite:/PATH/ON/A/LOCAL/DISK), or use a PostgreSQL server (--library \
             postgres://USER@HOST/DATABASE)"
    )]
    NoLocks {
        /// Name of the library, with the name of its file system if known.
        library: String,
        /// The operation that failed.
        reason: String,
    },
    /// Reading or writing the disk failed, or the network to it.
    #[error(
        "reading or writing the library's file failed ({reason}): check the system log for \
             disk errors; acknowledged results are stored: repeat the command to continue"
    )]
    Disk {
        /// The operation that failed.
        reason: String,
    },
    /// A file of an open library cannot be opened.
    #[error(
        "a file of the library could not be opened ({reason}): check that its folder exists \
             and is writable, and the limit of open files (ulimit -n)"
    )]
    NotOpened {
        /// The operation that failed.
        reason: String,
    },
    /// Another process has been writing for longer than the timeout of 30 s.
    #[error(
        "another program has been writing to the library for longer than 30 s: stop it, or \
             try again later; on a network file system the locks may not work: use a local disk"
    )]
    Busy,
    /// The database does not respond at present. A later call may succeed.
    #[error("the library's database does not respond: {reason}")]
    Unavailable {
        /// Cause.
        reason: String,
    },
    /// The library's file was removed or replaced while it was open.
    #[error(
        "library {library}: its file was removed, moved or replaced while it was open; \
             restore it, or stop and start again"
    )]
    FileGone {
        /// Path of the library.
        library: String,
    },
    /// The disk is full.
    #[error("the library's disk is full; no data is lost: free space and repeat the command")]
    DiskFull,
    /// Any other error of the database.
    #[error("the library's database failed")]
    Database(#[source] sqlx::Error),
    /// An update of the schema failed.
    #[error("the library's schema cannot be updated")]
    Migration(#[source] MigrateError),
}
