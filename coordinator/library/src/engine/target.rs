//! Location of a library, parsed from its URL.

use crate::LibraryError;
use sqlx::postgres::PgConnectOptions;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Location of a library.
#[derive(Clone)]
pub(crate) enum Target {
    Sqlite(PathBuf),
    Postgres {
        // Several hundred bytes, and a library has one.
        options: Box<PgConnectOptions>,
        /// The URL without password and settings, for messages.
        name: String,
    },
}

impl Target {
    /// Parses `sqlite:PATH` (or `sqlite://PATH`) or `postgres://[USER[:PASSWORD]@]HOST/DATABASE`.
    pub(crate) fn parse(url: &str) -> Result<Self, LibraryError> {
        if let Some(("postgres" | "postgresql", _)) = url.split_once("://") {
            let name = without_password(url);
            let options = PgConnectOptions::from_str(url).map_err(|source| {
                LibraryError::BadPostgresUrl { url: name.clone(), reason: source.to_string() }
            })?;
            let options = Box::new(options.application_name("tracktwin"));
            return Ok(Self::Postgres { options, name });
        }
        let path = url.strip_prefix("sqlite:").map(|rest| rest.strip_prefix("//").unwrap_or(rest));
        match path {
            // A database in memory is not shared between connections, and no library.
            Some(path) if !path.is_empty() && !path.starts_with(':') => {
                Ok(Self::Sqlite(PathBuf::from(path)))
            }
            _ => Err(LibraryError::UnknownUrl { url: unknown(url) }),
        }
    }

    /// Printable name: a path, or a URL without password.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Sqlite(path) => path.display().to_string(),
            Self::Postgres { name, .. } => name.clone(),
        }
    }

    /// Path of the file, with `SQLite` only.
    pub(crate) fn path(&self) -> Option<&Path> {
        match self {
            Self::Sqlite(path) => Some(path),
            Self::Postgres { .. } => None,
        }
    }
}

/// Returns a library's URL for messages, pages and command lines. The password is removed, and so are the
/// settings, which may contain a password. A path of `SQLite` and a text without `://` stay as they are.
///
/// A `?` before the last `@` belongs to a password or begins the settings. Then the rest after the first name, which
/// is the user or the host, is left out.
pub fn without_password(url: &str) -> String {
    let Some((scheme, rest)) =
        url.split_once("://").filter(|(scheme, _)| !scheme.ends_with("sqlite"))
    else {
        return url.to_owned();
    };
    let before = |text: &str, ends: &[char]| text.split(ends).next().unwrap_or_default().to_owned();
    match rest.rsplit_once('@') {
        None => format!("{scheme}://{}", before(rest, &['?'])),
        Some((login, _)) if login.contains('?') => {
            format!("{scheme}://{}...", before(login, &[':', '/', '?', '@']))
        }
        Some((login, host)) => {
            format!("{scheme}://{}@{}", before(login, &[':']), before(host, &['?']))
        }
    }
}

/// Text of an unknown URL for the message. A login without `://` before it is removed completely.
fn unknown(url: &str) -> String {
    match url.rsplit_once('@') {
        Some((_, host)) if !url.contains("://") => format!("...@{host}"),
        _ => without_password(url),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(url: &str) -> String {
        Target::parse(url).err().expect("it should be refused").to_string()
    }

    #[test]
    fn a_sqlite_url_is_a_path() {
        for (url, path) in
            [("sqlite:a/b.sqlite", "a/b.sqlite"), ("sqlite:///a/b.sqlite", "/a/b.sqlite")]
        {
            assert_eq!(Target::parse(url).unwrap().path(), Some(Path::new(path)));
        }
    }

    #[test]
    fn other_urls_are_refused_with_what_to_write() {
        for url in ["a.sqlite", "sqlite:", "sqlite::memory:", "mysql://x"] {
            assert!(refusal(url).contains("sqlite:PATH"), "{url}");
        }
    }

    #[test]
    fn no_message_shows_a_password() {
        let name = Target::parse("postgres://me:sec@ret@host:1/db?password=secret").unwrap().name();
        assert_eq!(name, "postgres://me@host:1/db");
        assert_eq!(
            without_password("--library=postgres://me:x@host/db"),
            "--library=postgres://me@host/db"
        );
        for same in ["postgres://host/db", "sqlite:a@b.sqlite", "sqlite://a:b@c?d", "--library"] {
            assert_eq!(without_password(same), same);
        }
        let message = refusal("postgres://me:secret@host:port/db");
        assert!(message.contains("host:port") && !message.contains("secret"), "{message}");
    }

    #[test]
    fn no_message_shows_the_password_of_a_wrong_url() {
        for (url, shown) in [
            ("postgre://me:secret@host/db", "postgre://me@host/db"),
            ("postgre://host/db?password=secret", "postgre://host/db"),
            ("postgres://me:se/cret@host:port/db", "postgres://me@host:port/db"),
            ("postgres://me:se?cret@host/db", "postgres://me..."),
            ("postgre://host/db?password=se@cret", "postgre://host..."),
            ("postgres:me:secret@host/db", "...@host/db"),
        ] {
            let message = refusal(url);
            assert!(message.starts_with(&format!("library {shown}: ")), "{message}");
            assert!(!message.contains("cret"), "{message}");
        }
        assert_eq!(without_password("postgres://me:s@e?cret@host/db"), "postgres://me...");
    }
}
