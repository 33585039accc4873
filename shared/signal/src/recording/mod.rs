//! Recordings of axle-box acceleration: folders with `recording.json` and one file per pass.
//!
//! This module reads, checks, imports and writes recordings. It assigns the samples of a pass to
//! sleepers and compares the track of a recording with a design. Transforms and features of the samples
//! are in other modules.

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
mod motion;
mod odometer;
mod parquet_file;
mod part;
mod quiet;
mod selection;
mod sleeper;
mod speed_change;
mod steps;
#[cfg(test)]
mod tests;
mod track;
mod window;

pub use check::RATE_TOLERANCE;
pub use clock::STEP_TOLERANCE as TIME_STEP_TOLERANCE;
pub use error::{Fault, RecordingError};
pub use folder::{Pass, Recording};
pub use motion::MotionFault;
pub use selection::{Selection, SelectionFault};
pub use sleeper::Sleeper;
pub use steps::{JUMP, JUMP_M};
pub use track::{OtherTrack, StatedTrack, compare_designs, nominal};
pub use window::SleeperWindow;
