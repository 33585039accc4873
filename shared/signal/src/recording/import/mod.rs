//! Recordings of other makes: tables of any kind, and what their columns mean.
//!
//! Owns reading of CSV, Parquet, NumPy and MATLAB files into named columns, and the way from these
//! to a recording. What a recording must satisfy is checked where it is opened.

mod csv_table;
mod layout;
mod matlab;
mod numpy;
mod pass;
mod table;
#[cfg(test)]
mod tests;

pub use layout::{AccelerationUnit, Layout, LayoutError, PositionUnit, SpeedUnit, TimeUnit};
pub use pass::{Imported, import};
pub use table::{Column, Table};
