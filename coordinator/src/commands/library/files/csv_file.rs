//! Tables as CSV files.

use super::text;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use tracktwin_library::{Cell, Table};

/// A CSV file that is being written.
pub(in crate::commands::library) struct CsvFile {
    out: BufWriter<File>,
}

impl CsvFile {
    /// Begins a file with the table's heads.
    pub(in crate::commands::library) fn create(path: &Path, table: &Table) -> io::Result<Self> {
        let mut out = BufWriter::new(File::create(path)?);
        let heads: Vec<_> = table.columns.iter().map(|column| column.name.to_owned()).collect();
        writeln!(out, "{}", text::csv_line(&heads))?;
        Ok(Self { out })
    }

    pub(in crate::commands::library) fn write(&mut self, rows: &[Vec<Cell>]) -> io::Result<()> {
        for row in rows {
            let cells: Vec<_> = row.iter().map(text::cell).collect();
            writeln!(self.out, "{}", text::csv_line(&cells))?;
        }
        Ok(())
    }

    pub(in crate::commands::library) fn end(self) -> io::Result<()> {
        self.out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
    }
}
