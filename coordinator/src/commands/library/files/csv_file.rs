//! Tables as CSV files.

use super::text;
use std::fs::File;
use std::io;
use std::path::Path;
use tracktwin_library::{Cell, Table};

/// A CSV file open for writing.
pub(in crate::commands::library) struct CsvFile {
    out: csv::Writer<File>,
}

impl CsvFile {
    /// Starts a file with the column names.
    pub(in crate::commands::library) fn create(path: &Path, table: &Table) -> io::Result<Self> {
        let mut out = csv::Writer::from_path(path)?;
        out.write_record(table.columns.iter().map(|column| column.name))?;
        Ok(Self { out })
    }

    pub(in crate::commands::library) fn write(&mut self, rows: &[Vec<Cell>]) -> io::Result<()> {
        for row in rows {
            self.out.write_record(row.iter().map(text::cell))?;
        }
        Ok(())
    }

    pub(in crate::commands::library) fn end(self) -> io::Result<()> {
        self.out.into_inner().map_err(csv::IntoInnerError::into_error)?.sync_all()
    }
}
