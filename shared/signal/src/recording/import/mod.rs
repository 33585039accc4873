//! Import of foreign recordings: tables of several formats, and the meaning of their columns.
//!
//! This module reads CSV, Parquet, NumPy and MATLAB files into named columns and converts these columns
//! to a recording. [`Recording::open`](super::Recording::open) checks the recording.

mod column;
mod csv_table;
mod doubt;
mod foreign;
mod layout;
mod mat_listing;
mod matlab;
mod numpy;
#[cfg(test)]
mod odd_files;
#[cfg(test)]
mod odd_kinds;
mod pass;
mod places;
mod rate;
mod raw;
mod sleepers;
mod speeds;
mod table;
#[cfg(test)]
mod tests;
mod text;
mod unit;

pub use column::{Column, Oddity};
pub use layout::{Layout, LayoutError};
pub use pass::{Imported, import};
pub use table::Table;
pub use unit::{AccelerationUnit, PositionUnit, SpeedUnit, TimeUnit};
