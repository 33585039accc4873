//! Opening of a library in either database.

use super::clock::Clock;
use super::{Readers, Target, Writer, postgres, sqlite};
use crate::LibraryError;
use std::path::Path;
use std::sync::Arc;

/// Connections of an open library.
pub(crate) struct Opened {
    pub(crate) target: Target,
    pub(crate) readers: Readers,
    pub(crate) writer: Writer,
    pub(crate) clock: Arc<Clock>,
}

/// Opens an existing library.
pub(crate) async fn open(url: &str) -> Result<Opened, LibraryError> {
    let target = parse(url)?;
    if target.path().is_some_and(|path| !path.is_file()) {
        return Err(LibraryError::Missing { library: target.name() });
    }
    connect(target, false).await
}

/// Opens a library, or creates an empty one.
pub(crate) async fn open_or_create(url: &str) -> Result<Opened, LibraryError> {
    let target = parse(url)?;
    let folder = target.path().and_then(Path::parent);
    if let Some(folder) = folder.filter(|it| !it.as_os_str().is_empty() && !it.is_dir()) {
        let folder = folder.to_owned();
        return Err(LibraryError::NoFolder { library: target.name(), folder });
    }
    connect(target, true).await
}

fn parse(url: &str) -> Result<Target, LibraryError> {
    let target = Target::parse(url)?;
    if target.path().is_some_and(Path::is_dir) {
        return Err(LibraryError::Folder { library: target.name() });
    }
    Ok(target)
}

async fn connect(target: Target, create: bool) -> Result<Opened, LibraryError> {
    let (readers, writing, clock) = match &target {
        Target::Sqlite(path) => {
            let (readers, writing) = sqlite::open(path, create).await?;
            (readers, Some(writing), Clock::Machine)
        }
        Target::Postgres { options, name } => {
            let (readers, clock) = postgres::open(options, name, create).await?;
            (readers, None, clock)
        }
    };
    let clock = Arc::new(clock);
    let writer = Writer::start(&target, writing, &clock);
    Ok(Opened { target, readers, writer, clock })
}
