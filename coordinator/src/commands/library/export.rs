//! `tracktwin library export`: writes a library as Parquet or CSV files.

use super::files::csv_file::CsvFile;
use super::files::parquet_file::ParquetFile;
use super::{OrInput, Stop};
use crate::commands::files::{Force, check};
use crate::commands::library_url::LibraryUrl;
use crate::commands::{print_json, println_stdout};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::path::{Path, PathBuf};
use tracktwin_files::{FileName, Kind, Output};
use tracktwin_library::{Cell, Library, Table};

/// Maximum number of rows in memory and in a row group of a Parquet file: 30 MB of results.
const ROWS_A_GROUP: usize = 8192;

/// Arguments of `library export`.
#[derive(Args)]
#[command(
    after_help = "A folder receives one file per table, for `library import`. A file receives the training \
    set:\none row per case and speed, with parameters and features.\n\n\
    Examples:\n  tracktwin library export --out training.parquet --library sqlite:out/library.sqlite\n  \
    python3 -c \"import pandas; print(pandas.read_parquet('training.parquet'))\""
)]
pub(in crate::commands) struct Arguments {
    #[command(flatten)]
    library: LibraryUrl,
    /// Output folder for all tables, or output file for the training set.
    #[arg(long, value_name = "DIR|FILE")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// File format [default: from the extension of the file, otherwise parquet].
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Parquet: small, exact, typed; series are lists.
    Parquet,
    /// CSV: series are JSON arrays.
    Csv,
}

impl Format {
    const fn extension(self) -> &'static str {
        match self {
            Self::Parquet => "parquet",
            Self::Csv => "csv",
        }
    }

    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        [Self::Parquet, Self::Csv].into_iter().find(|format| format.extension() == extension)
    }
}

/// A file that was written.
#[derive(Serialize)]
struct Exported {
    file: String,
    table: &'static str,
    rows: usize,
}

pub(super) async fn run(arguments: &Arguments) -> Result<(), Stop> {
    let Arguments { library, out, force, format, json } = arguments;
    let named = Format::of(out).filter(|_| !out.is_dir());
    if let (Some(named), Some(format)) = (named, *format)
        && named != format
    {
        return Err(anyhow!(
            "--format {}: --out {} names a {} file; give the same format in both, or leave --format out",
            format.extension(),
            out.display(),
            named.extension()
        ))
        .or_input();
    }
    let format = format.or(named).unwrap_or(Format::Parquet);
    if let (None, Some(extension), false) = (named, out.extension(), out.is_dir()) {
        let extension = extension.display();
        return Err(anyhow!(
            "--out {}: {extension} is neither parquet nor csv; name a .parquet or .csv file, or a folder",
            out.display()
        ))
            .or_input();
    }
    let (folder, tables) = match named {
        Some(_) => {
            let (folder, name) = FileName::of_path(out)?;
            (folder, vec![(Table::ENTRIES, name)])
        }
        None => (out.clone(), tables(format)?),
    };
    let names: Vec<&str> = tables.iter().map(|(_, name)| name.as_str()).collect();
    check(&folder, Kind::Export, *force, &names)?;
    let library = library.open_to_read().await?;
    let mut output = Output::begin(&folder, Kind::Export, force.force)?;
    let mut written = Vec::new();
    for &(table, ref name) in &tables {
        let rows = export(&library, table, name, &mut output, format).await?;
        let file = name.within(&folder).display().to_string();
        written.push(Exported { file, table: table.name, rows });
    }
    output.commit()?;
    if *json {
        print_json(&written);
        return Ok(());
    }
    let each = if named.is_some() { ", one per case and speed" } else { "" };
    for Exported { file, rows, .. } in &written {
        println_stdout(&format!("{file}: {rows} rows{each}"));
    }
    Ok(())
}

/// All tables with the names of their files.
fn tables(format: Format) -> Result<Vec<(&'static Table, FileName)>, Stop> {
    let named = |table: &'static Table| {
        Ok((table, FileName::new(table.name)?.with_ending(format.extension())))
    };
    Table::ALL.into_iter().map(named).collect()
}

/// Writes a table to a file of the output.
async fn export(
    library: &Library,
    table: &'static Table,
    name: &FileName,
    output: &mut Output,
    format: Format,
) -> Result<usize, Stop> {
    let at = || format!("{name}: cannot be written");
    let path = output.stage(name);
    let mut file = Sink::create(&path, table, format).with_context(at)?;
    let mut count = 0;
    let take = async |rows: Vec<Vec<Cell>>| {
        count += rows.len();
        file.write(&rows).with_context(at)
    };
    library.read_table(table, ROWS_A_GROUP, take).await?;
    file.end().with_context(at)?;
    Ok(count)
}

/// A file of either format.
enum Sink {
    Parquet(Box<ParquetFile>),
    Csv(Box<CsvFile>),
}

impl Sink {
    fn create(path: &Path, table: &'static Table, format: Format) -> anyhow::Result<Self> {
        Ok(match format {
            Format::Parquet => Self::Parquet(Box::new(ParquetFile::create(path, table)?)),
            Format::Csv => Self::Csv(Box::new(CsvFile::create(path, table)?)),
        })
    }

    fn write(&mut self, rows: &[Vec<Cell>]) -> anyhow::Result<()> {
        match self {
            Self::Parquet(file) => Ok(file.write(rows)?),
            Self::Csv(file) => Ok(file.write(rows)?),
        }
    }

    fn end(self) -> anyhow::Result<()> {
        match self {
            Self::Parquet(file) => Ok(file.end()?),
            Self::Csv(file) => Ok(file.end()?),
        }
    }
}
