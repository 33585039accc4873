//! Common interface to two databases: statements, rows, connections, and the tasks that write.
//!
//! This module handles the differences between `SQLite` and PostgreSQL. The modules of the tables therefore
//! write each statement once, with `$1` for its first value; both databases accept this. The module does not
//! depend on any table.

mod clock;
mod connection;
mod dialect;
mod file_lock;
mod file_system;
mod iso;
mod open;
mod postgres;
mod retry_budget;
mod row;
mod schema_version;
mod sqlite;
mod sqlite_fault;
mod sqlite_schema;
mod statement;
mod target;
mod views;
mod writer;
mod writer_shards;

pub(crate) use connection::{Connection, Readers};
pub(crate) use dialect::Dialect;
pub(crate) use file_lock::{FileLock, identity};
pub(crate) use iso::iso_utc;
pub(crate) use open::{Access, Opened, open, open_or_create};
pub(crate) use row::Row;
pub(crate) use sqlite::not_locked;
pub(crate) use sqlite_fault::{SQLITE_FULL, sqlite_fault};
pub(crate) use sqlite_schema::schema_objects;
pub(crate) use statement::{Statement, Text, Value, series, sql};
pub(crate) use target::Target;
pub use target::without_password;
pub(crate) use writer::{Write, Writer};
