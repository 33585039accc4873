//! The argument that selects the library.

use super::Stop;
use anyhow::Context;
use clap::Args;
use tracktwin_library::{Library, without_password};

/// Selects the library.
#[derive(Args)]
pub(super) struct LibraryUrl {
    /// The library: `sqlite:PATH` or `postgres://USER@HOST/DATABASE`.
    // The value may contain a password, which help must not show.
    #[arg(
        id = "library",
        long,
        value_name = "URL",
        env = "TRACKTWIN_LIBRARY",
        hide_env_values = true
    )]
    url: String,
}

impl LibraryUrl {
    /// Opens the library, which must exist, for reading. Use this for commands that write nothing.
    pub(super) async fn open_to_read(&self) -> Result<Library, Stop> {
        Ok(Library::open_to_read(&self.url).await?)
    }

    /// Opens the library, which must exist.
    pub(super) async fn open(&self) -> Result<Library, Stop> {
        Ok(Library::open(&self.url).await?)
    }

    /// Opens the library, which must exist and be intact. Use this for commands that add data to the
    /// library or need all its data.
    pub(super) async fn open_whole(&self) -> Result<Library, Stop> {
        open_whole(&self.url).await
    }

    /// Opens the library, which must be intact; creates it if missing.
    pub(super) async fn open_or_create(&self) -> Result<Library, Stop> {
        open_or_create(&self.url).await
    }

    /// Name of the library, without password.
    pub(super) fn name(&self) -> String {
        without_password(&self.url)
    }
}

/// Opens the library at this URL, which must exist and be intact.
pub(super) async fn open_whole(url: &str) -> Result<Library, Stop> {
    whole(Library::open(url).await?).await
}

/// Opens the library at this URL, which must be intact; creates it if missing.
pub(super) async fn open_or_create(url: &str) -> Result<Library, Stop> {
    whole(Library::open_or_create(url).await?).await
}

/// Returns the library if its database is intact, otherwise an error.
async fn whole(library: Library) -> Result<Library, Stop> {
    let name = library.name();
    library.check_whole().await.with_context(|| format!("library {name}"))?;
    Ok(library)
}
