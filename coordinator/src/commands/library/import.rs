//! `tracktwin library import`: adds exported tables to a library.

use super::files::parquet_file;
use super::{OrInput, Stop};
use crate::commands::library_url::LibraryUrl;
use crate::commands::{print_json, println_stdout};
use anyhow::anyhow;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use tracktwin_files::inside;
use tracktwin_library::{Cell, Library, LibraryError, Table};

/// Arguments of `library import`.
#[derive(Args)]
pub(in crate::commands) struct Arguments {
    /// Folder written by `library export --format parquet`.
    folder: PathBuf,
    #[command(flatten)]
    library: LibraryUrl,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// A table that was read, and how many of its rows were new.
#[derive(Serialize)]
struct Imported {
    table: &'static str,
    rows: usize,
    added: u64,
}

pub(super) async fn run(arguments: &Arguments) -> Result<(), Stop> {
    let folder = &arguments.folder;
    let file = |table: &Table| inside(folder, &format!("{}.parquet", table.name));
    // Check before anything is written.
    let files = Table::ALL.iter().map(|table| file(table)).collect::<Result<Vec<_>, _>>()?;
    let missing = Table::ALL.iter().zip(&files).find(|(_, file)| !file.is_file());
    if let Some((missing, file)) = missing {
        if file.with_extension("csv").is_file() {
            return Err(anyhow!(
                "{}: the tables are CSV, but `library import` reads Parquet only; write them with \
                 `tracktwin library export --format parquet --out FOLDER`",
                folder.display()
            ))
            .or_input();
        }
        return Err(anyhow!(
            "{}: {}.parquet is missing; `tracktwin library export --out FOLDER` writes all tables",
            folder.display(),
            missing.name
        ))
        .or_input();
    }
    let library = arguments.library.open_or_create().await?;
    let mut imported = Vec::new();
    for (table, file) in Table::ALL.into_iter().zip(&files) {
        imported.push(import(&library, table, file).await?);
    }
    library.finish_complete_cases().await?;
    library.close().await;
    if arguments.json {
        print_json(&imported);
        return Ok(());
    }
    for Imported { table, rows, added } in &imported {
        println_stdout(&format!("{table}: {added} of {rows} rows added"));
    }
    Ok(())
}

async fn import(library: &Library, table: &'static Table, path: &Path) -> Result<Imported, Stop> {
    let mut imported = Imported { table: table.name, rows: 0, added: 0 };
    let take = async |rows: Vec<Vec<Cell>>| {
        imported.rows += rows.len();
        imported.added += library.write_table(table, rows).await?;
        Ok::<(), anyhow::Error>(())
    };
    let taken = parquet_file::read(path, table, take).await;
    taken.map_err(|error| {
        // Wrong input, unless the library could not be written.
        let is_input = error.downcast_ref().is_none_or(LibraryError::is_wrong_input);
        let error = error.context(path.display().to_string());
        if is_input { Stop::Input(error) } else { Stop::Failure(error) }
    })?;
    Ok(imported)
}
