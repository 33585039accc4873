//! Recordings of other makes: tables of any kind, and what their columns mean.
//!
//! Owns reading of CSV, Parquet, NumPy and MATLAB files into named columns, and the way from these
//! to a recording. What a recording must satisfy is checked where it is opened.

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
