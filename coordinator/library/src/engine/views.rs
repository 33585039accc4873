//! The views: one file a database, outside the numbered migrations.
//!
//! Opening a library creates them again if the existing ones are of an earlier version.

use crate::LibraryError;

/// Version of both files; to be raised with every change of one, as a test demands.
pub(super) const VERSION: i64 = 1;

pub(super) const SQLITE: &str = include_str!("../../../../migrations/sqlite/views.sql");
pub(super) const POSTGRES: &str = include_str!("../../../../migrations/postgres/views.sql");

/// Reduces an error of creating views to a warning if the existing views are usable: for read-only
/// access, and for the salvage of a damaged library.
///
/// # Errors
/// Whatever else went wrong.
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
