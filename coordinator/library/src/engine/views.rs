//! The views: one SQL file per database, outside the numbered migrations.
//!
//! Opening a library for writing creates the views again if the existing ones are of an earlier version.

use crate::LibraryError;

/// Version of both files. It must be raised with every change of one of them; a test checks this.
pub(super) const VERSION: i64 = 2;

pub(super) const SQLITE: &str = include_str!("../../../../migrations/sqlite/views.sql");
pub(super) const POSTGRES: &str = include_str!("../../../../migrations/postgres/views.sql");

/// Logs that a library is read by views of an earlier version.
pub(super) fn warn_of_earlier(library: &str) {
    tracing::warn!(
        "library {library}: its views are of an earlier version; `tracktwin library upgrade` renews them"
    );
}

/// Logs a failure to update the views as a warning if the existing views are still usable. This is the case
/// for read-only access and for the salvage of a damaged library.
///
/// # Errors
/// Returns any other error.
pub(super) fn made(done: Result<(), LibraryError>, library: &str) -> Result<(), LibraryError> {
    use LibraryError::{Busy, DiskFull, Malformed, NotWritable};
    match done {
        Err(error @ (Busy | DiskFull | Malformed { .. } | NotWritable { .. })) => {
            tracing::warn!(
                "library {library}: its views are of an earlier version and cannot be updated: {error}"
            );
            Ok(())
        }
        done => done,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_file_leaves_its_version_behind() {
        assert!(SQLITE.ends_with(&format!("pragma user_version = {VERSION};\n")));
        let comment = format!("comment on view campaign_status is 'views of version {VERSION}';\n");
        assert!(POSTGRES.ends_with(&comment));
    }
}
