//! Which file a library URL means.

use crate::LibraryError;
use std::path::PathBuf;

/// The path in `sqlite:PATH` (or `sqlite://PATH`).
pub(crate) fn sqlite_path(url: &str) -> Result<PathBuf, LibraryError> {
    if let Some((scheme @ ("postgres" | "postgresql"), rest)) = url.split_once("://") {
        // What stands before the host may hold a password.
        let host = rest.rsplit_once('@').map_or(rest, |(_, host)| host);
        return Err(LibraryError::PostgresNotSupported { url: format!("{scheme}://{host}") });
    }
    let path = url.strip_prefix("sqlite:").map(|rest| rest.strip_prefix("//").unwrap_or(rest));
    match path {
        // A database in memory is not shared between connections, and no library.
        Some(path) if !path.is_empty() && !path.starts_with(':') => Ok(PathBuf::from(path)),
        _ => Err(LibraryError::UnknownUrl { url: url.to_owned() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sqlite_url_is_a_path() {
        assert_eq!(sqlite_path("sqlite:a/b.sqlite").unwrap(), PathBuf::from("a/b.sqlite"));
        assert_eq!(sqlite_path("sqlite:///a/b.sqlite").unwrap(), PathBuf::from("/a/b.sqlite"));
    }

    #[test]
    fn other_urls_are_refused_with_what_to_write_and_without_passwords() {
        for url in ["a.sqlite", "sqlite:", "sqlite::memory:", "mysql://x"] {
            assert!(sqlite_path(url).unwrap_err().to_string().contains("sqlite:PATH"), "{url}");
        }
        let message = sqlite_path("postgres://me:secret@host/db").unwrap_err().to_string();
        assert!(message.contains("postgres://host/db") && !message.contains("secret"), "{message}");
    }
}
