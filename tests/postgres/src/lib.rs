//! A throw-away PostgreSQL server for tests, from the binaries that are installed.
//!
//! Owns finding, starting, stopping and removing it; what the databases hold is the tests' own. It
//! ends with the test's process, however that ends.

mod installation;
mod server;

pub use server::{Server, Settings};
