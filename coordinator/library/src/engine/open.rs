//! Opening of a library in either database.

use super::clock::Clock;
use super::{Readers, Target, Writer, postgres, sqlite};
use crate::LibraryError;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

/// Maximum length of the absolute path of a file: `SQLite` accepts 512 bytes, with the ending of its journal.
const PATH_BYTES_MAX: usize = 504;

/// Connections of an open library.
pub(crate) struct Opened {
    pub(crate) target: Target,
    pub(crate) readers: Readers,
    pub(crate) writer: Writer,
    pub(crate) clock: Arc<Clock>,
}

/// What a library is opened for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// Reading only. A library of an earlier schema is refused; no connection can write.
    Read,
    /// Reading and writing. The schema is updated.
    Write,
    /// As [`Access::Write`]. An empty library is created if there is none.
    Create,
}

/// Opens an existing library.
pub(crate) async fn open(url: &str, access: Access) -> Result<Opened, LibraryError> {
    let target = parse(url)?;
    if target.path().is_some_and(|path| !path.exists()) {
        return Err(LibraryError::Missing { library: target.name() });
    }
    connect(target, access).await
}

/// Opens a library, or creates an empty one.
pub(crate) async fn open_or_create(url: &str) -> Result<Opened, LibraryError> {
    let target = parse(url)?;
    let folder = target.path().and_then(Path::parent);
    if let Some(folder) = folder.filter(|it| !it.as_os_str().is_empty() && !it.is_dir()) {
        let folder = folder.to_owned();
        return Err(LibraryError::NoFolder { library: target.name(), folder });
    }
    connect(target, Access::Create).await
}

fn parse(url: &str) -> Result<Target, LibraryError> {
    let target = Target::parse(url)?;
    if target.path().is_some_and(Path::is_dir) {
        return Err(LibraryError::Folder { library: target.name() });
    }
    if let Some(path) = target.path() {
        refuse_long(path)?;
        // A device or a pipe.
        if path.exists() && !path.is_file() {
            return Err(LibraryError::NotALibrary { library: target.name() });
        }
    }
    Ok(target)
}

/// Returns an error for a path with more bytes than the file system or `SQLite` accepts.
fn refuse_long(path: &Path) -> Result<(), LibraryError> {
    let full = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let is_name = |error: &std::io::Error| error.kind() == ErrorKind::InvalidFilename;
    let reason = if path.metadata().err().as_ref().is_some_and(is_name) {
        "the path or a name in it is too long for the file system; give a shorter one".to_owned()
    } else if full.as_os_str().len() > PATH_BYTES_MAX {
        format!(
            "the path is longer than the {PATH_BYTES_MAX} bytes that SQLite accepts; give a shorter one"
        )
    } else {
        return Ok(());
    };
    Err(LibraryError::NotLetIn { library: path.display().to_string(), reason })
}

async fn connect(mut target: Target, access: Access) -> Result<Opened, LibraryError> {
    let (readers, writing, clock) = match &mut target {
        Target::Sqlite(path) => {
            let (readers, writing) = sqlite::open(path, access).await?;
            (readers, Some(writing), Clock::Machine)
        }
        Target::Postgres { options, name } => {
            if access == Access::Read {
                **options = postgres::only_reading(options);
            }
            let (readers, clock) = postgres::open(options, name, access).await?;
            (readers, None, clock)
        }
    };
    let clock = Arc::new(clock);
    let writer = Writer::start(&target, writing, &clock);
    Ok(Opened { target, readers, writer, clock })
}
