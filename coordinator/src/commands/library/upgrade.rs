//! `tracktwin library upgrade`: updates the schema of a library to that of this program.

use super::Stop;
use crate::commands::library_url::LibraryUrl;
use crate::commands::println_stdout;

pub(super) async fn run(url: &LibraryUrl) -> Result<(), Stop> {
    let library = url.open_whole().await?;
    let name = library.name();
    library.close().await;
    println_stdout(&format!("{name}: its schema is that of this program"));
    Ok(())
}
