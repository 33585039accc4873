//! A temporary PostgreSQL server for tests, run from the installed programs.
//!
//! This crate finds, starts, stops and removes the server; the tests define the content of the databases.
//! The server ends with the test's process, even if the process is killed.

mod installation;
mod server;

pub use server::{Server, Settings};
