//! Why a library refuses, or fails.

use std::path::PathBuf;

/// Why something cannot be read from a library or written to it; one line each.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// Not a library URL at all.
    #[error("library {url}: write sqlite:PATH")]
    UnknownUrl {
        /// The URL.
        url: String,
    },
    /// A PostgreSQL library.
    #[error(
        "library {url}: PostgreSQL libraries come with the distributed farm; write sqlite:PATH"
    )]
    PostgresNotSupported {
        /// The URL, without what stands before its host.
        url: String,
    },
    /// There is nothing at this path.
    #[error(
        "library {path}: there is no such file; `tracktwin run --library sqlite:{path}` makes one"
    )]
    Missing {
        /// The path.
        path: PathBuf,
    },
    /// The folder that should hold the library is not there.
    #[error("library {path}: the folder {folder} is not there; make it first")]
    NoFolder {
        /// The library's path.
        path: PathBuf,
        /// The folder.
        folder: PathBuf,
    },
    /// The file is something else.
    #[error("library {path}: the file is not a tracktwin library")]
    NotALibrary {
        /// The path.
        path: PathBuf,
    },
    /// A later version of the program has written it.
    #[error(
        "library {path}: its schema {found} is newer than this program's ({known}); use the program \
         that wrote it, or a later one"
    )]
    NewerSchema {
        /// The path.
        path: PathBuf,
        /// The library's schema.
        found: i64,
        /// The newest schema known here.
        known: i64,
    },
    /// Another process hands out its cases.
    #[error("library {path}: another process is running a campaign on it")]
    InUse {
        /// The path.
        path: PathBuf,
    },
    /// There is no such campaign.
    #[error("the library has no campaign {id}")]
    UnknownCampaign {
        /// The campaign.
        id: String,
    },
    /// A campaign of that id but another definition.
    #[error("the library has a campaign {id} with another definition")]
    OtherDefinition {
        /// The campaign.
        id: String,
    },
    /// A seed that SQL's signed integers cannot hold.
    #[error("the seed {seed} is too large; it must stay below 2^63")]
    SeedTooLarge {
        /// The seed.
        seed: u64,
    },
    /// What is stored cannot be.
    #[error("the library is damaged: {what}")]
    Damaged {
        /// What was found.
        what: String,
    },
    /// The library was closed meanwhile.
    #[error("the library is closed")]
    Closed,
    /// The lock file beside the library.
    #[error("library {path}: cannot be locked")]
    Lock {
        /// The path.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The database failed.
    #[error("the library's database failed")]
    Database(#[from] sqlx::Error),
    /// A change of the schema failed.
    #[error("the library's schema cannot be brought up to date")]
    Migration(#[from] sqlx::migrate::MigrateError),
}

impl LibraryError {
    /// Whether the user asked for what cannot be, rather than something having failed.
    pub const fn is_wrong_input(&self) -> bool {
        matches!(
            self,
            Self::UnknownUrl { .. }
                | Self::PostgresNotSupported { .. }
                | Self::Missing { .. }
                | Self::NoFolder { .. }
                | Self::NotALibrary { .. }
                | Self::NewerSchema { .. }
                | Self::InUse { .. }
                | Self::UnknownCampaign { .. }
                | Self::OtherDefinition { .. }
                | Self::SeedTooLarge { .. }
        )
    }
}
