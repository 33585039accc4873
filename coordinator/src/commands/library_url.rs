//! The argument that says which library is meant.

use super::Stop;
use clap::Args;
use tracktwin_library::Library;

/// Which library is meant.
#[derive(Args)]
pub(super) struct LibraryUrl {
    /// The library: `sqlite:PATH` or `postgres://USER@HOST/DATABASE`.
    // Its value may hold a password, which help is not to show.
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
    /// The library, which is there.
    pub(super) async fn open(&self) -> Result<Library, Stop> {
        Ok(Library::open(&self.url).await?)
    }

    /// The library, made where there is none.
    pub(super) async fn open_or_create(&self) -> Result<Library, Stop> {
        Ok(Library::open_or_create(&self.url).await?)
    }
}
