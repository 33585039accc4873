//! The library as plain tables: SQL queries, reading, writing, verification.
//!
//! This module contains the operations that are equal for all tables. It does not depend on any file
//! format, and it checks only what the schema guarantees.

mod attest;
mod cell;
mod decode;
mod merge;
mod query;
mod question;
mod read;
mod salvage;
mod schema;
mod verify;
mod write;

pub use cell::Cell;
pub use query::Answer;
pub use salvage::Lost;
pub use schema::{Column, ColumnKind, Table};
pub use verify::{IntegrityFault, Verified};
