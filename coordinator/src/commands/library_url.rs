//! The argument that says which library is meant.

use super::Stop;
use anyhow::Context;
use clap::Args;
use tracktwin_library::{Library, without_password};

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

    /// The library, which is there and whole: for whoever adds to it, or relies on all of it.
    pub(super) async fn open_whole(&self) -> Result<Library, Stop> {
        open_whole(&self.url).await
    }

    /// The library, whole, or made where there is none.
    pub(super) async fn open_or_create(&self) -> Result<Library, Stop> {
        open_or_create(&self.url).await
    }

    /// What it is called, without password.
    pub(super) fn name(&self) -> String {
        without_password(&self.url)
    }
}

/// The library of this URL, which is there and whole.
pub(super) async fn open_whole(url: &str) -> Result<Library, Stop> {
    whole(Library::open(url).await?).await
}

/// The library of this URL, whole, or made where there is none.
pub(super) async fn open_or_create(url: &str) -> Result<Library, Stop> {
    whole(Library::open_or_create(url).await?).await
}

/// A library, unless its database is malformed.
async fn whole(library: Library) -> Result<Library, Stop> {
    let name = library.name();
    library.check_whole().await.with_context(|| format!("library {name}"))?;
    Ok(library)
}
