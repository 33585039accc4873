//! `tracktwin library import`: adds exported tables to a library.

use super::files::parquet_file;
use super::{OrInput, Stop};
use crate::commands::library_url::LibraryUrl;
use crate::commands::println_stdout;
use anyhow::anyhow;
use clap::Args;
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
}

pub(super) async fn run(arguments: &Arguments) -> Result<(), Stop> {
    let folder = &arguments.folder;
    let file = |table: &Table| inside(folder, &format!("{}.parquet", table.name));
    // Check before anything is written.
    let files = Table::ALL.iter().map(|table| file(table)).collect::<Result<Vec<_>, _>>()?;
    let missing = Table::ALL.iter().zip(&files).find(|(_, file)| !file.is_file());
    if let Some((missing, _)) = missing {
        return Err(anyhow!(
            "{}: {}.parquet is missing; `tracktwin library export --out FOLDER` writes all tables",
            folder.display(),
            missing.name
        ))
        .or_input();
    }
    let library = arguments.library.open_or_create().await?;
    for (table, file) in Table::ALL.into_iter().zip(&files) {
        let (read, added) = import(&library, table, file).await?;
        println_stdout(&format!("{}: {added} of {read} rows added", table.name));
    }
    library.finish_complete_cases().await?;
    library.close().await;
    Ok(())
}

async fn import(
    library: &Library,
    table: &'static Table,
    path: &Path,
) -> Result<(usize, u64), Stop> {
    let (mut read, mut added) = (0, 0);
    let take = async |rows: Vec<Vec<Cell>>| {
        read += rows.len();
        added += library.write_table(table, rows).await?;
        Ok::<(), anyhow::Error>(())
    };
    let taken = parquet_file::read(path, table, take).await;
    taken.map_err(|error| {
        // Wrong input, unless the library could not be written.
        let is_input = error.downcast_ref().is_none_or(LibraryError::is_wrong_input);
        let error = error.context(path.display().to_string());
        if is_input { Stop::Input(error) } else { Stop::Failure(error) }
    })?;
    Ok((read, added))
}
