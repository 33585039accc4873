//! Recordings of axle-box acceleration: folders of `recording.json` and one file a pass.
//!
//! Owns reading, checking, importing and writing of recordings, which samples of a pass belong to which
//! sleeper, and whether a recording is of a track of a certain design. What is computed from the samples is left to the transforms and features.

mod check;
mod clock;
mod columns;
mod copies;
mod csv_file;
mod error;
mod folder;
pub mod import;
mod limits;
mod manifest;
mod odometer;
mod parquet_file;
mod quiet;
mod sleeper;
#[cfg(test)]
mod tests;
mod track;
mod window;

pub use check::RATE_TOLERANCE;
pub use clock::STEP_TOLERANCE as TIME_STEP_TOLERANCE;
pub use error::{Fault, RecordingError};
pub use folder::{Pass, Recording};
pub use odometer::{JUMP, JUMP_M};
pub use sleeper::Sleeper;
pub use track::{OtherTrack, StatedTrack, compare_designs, nominal};
pub use window::SleeperWindow;
