//! The three columns of a pass, independent of the file format.

use super::error::{Fault, RecordingError};
use super::{csv_file, limits, parquet_file};
use std::path::Path;

/// Names of the columns of a pass, in the order they are written.
pub(super) const NAMES: [&str; 3] = ["time_s", "position_m", "acceleration_m_s2"];

/// Share of missing values up to which each is a fault of its row.
const MISSING_MAX: f64 = 0.01;

/// The columns of a pass: finite numbers, equally many, at least two.
pub(super) struct Columns {
    /// Times in s.
    pub time_s: Vec<f64>,
    /// Positions of the wheel along the track in m.
    pub position_m: Vec<f64>,
    /// Vertical accelerations of the axle box in m/s2, positive downwards.
    pub acceleration_m_s2: Vec<f64>,
}

impl Columns {
    /// Reads the columns of a `.parquet` or `.csv` file and checks each separately.
    pub(super) fn read(path: &Path) -> Result<Self, RecordingError> {
        if !path.is_file() {
            return Err(RecordingError::new(path, "file", Fault::NoSuchFile));
        }
        limits::file(path)?;
        let extension = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let columns = match extension.to_ascii_lowercase().as_str() {
            "parquet" => parquet_file::read(path, &NAMES)?,
            "csv" => csv_file::read(path, &NAMES)?,
            _ => return Err(RecordingError::new(path, "file", Fault::UnknownKind)),
        };
        check(path, &columns)?;
        let [time_s, position_m, acceleration_m_s2] = columns;
        Ok(Self { time_s, position_m, acceleration_m_s2 })
    }
}

fn check(path: &Path, columns: &[Vec<f64>; 3]) -> Result<(), RecordingError> {
    let rows = columns[0].len();
    for (name, column) in NAMES.into_iter().zip(columns) {
        let fault = if column.len() < 2 {
            Some(Fault::Empty { rows: column.len() })
        } else if column.len() != rows {
            Some(Fault::LengthMismatch { rows: column.len(), others: rows })
        } else {
            sparse(column).or_else(|| not_finite(column))
        };
        if let Some(fault) = fault {
            return Err(RecordingError::new(path, name, fault));
        }
    }
    Ok(())
}

/// The fault of a column in which so many values are missing that it was sampled more slowly than the others.
pub(super) fn sparse(column: &[f64]) -> Option<Fault> {
    let missing = column.iter().filter(|value| !value.is_finite()).count();
    let is_sparse = missing > 1 && missing as f64 > MISSING_MAX * column.len() as f64;
    is_sparse.then_some(Fault::Sparse { missing, rows: column.len() })
}

/// The first value that is not finite.
pub(super) fn not_finite(column: &[f64]) -> Option<Fault> {
    let index = column.iter().position(|value| !value.is_finite())?;
    Some(Fault::NotFinite { row: index + 1, value: column[index].to_string() })
}
