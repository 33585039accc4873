//! Recordings of axle-box acceleration: folders of `recording.json` and one file a pass.
//!
//! Owns reading, checking, importing and writing of recordings, and which samples of a pass belong to which
//! sleeper. What is computed from the samples is left to the transforms and features.

mod check;
mod columns;
mod csv_file;
mod error;
mod folder;
pub mod import;
mod limits;
mod manifest;
mod parquet_file;
#[cfg(test)]
mod tests;

pub use error::{Fault, RecordingError};
pub use folder::{Pass, Recording, Sleeper};
