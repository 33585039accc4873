//! The library as plain tables: SQL queries, reading, writing, verification.
//!
//! Owns what is the same for every table; knows no file format and compares nothing but what the
//! schema itself promises.

mod attest;
mod cell;
mod decode;
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
