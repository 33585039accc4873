//! Classes of errors: wrong input, temporary failures, and faults of the data.

use crate::LibraryError;
use crate::error_code::is_constraint;
use std::time::Duration;

impl LibraryError {
    /// Whether the input of the user is the cause, and not a failure.
    pub const fn is_wrong_input(&self) -> bool {
        matches!(
            self,
            Self::UnknownUrl { .. }
                | Self::BadPostgresUrl { .. }
                | Self::Missing { .. }
                | Self::Empty { .. }
                | Self::NoFolder { .. }
                | Self::NotALibrary { .. }
                | Self::NotLetIn { .. }
                | Self::NewerSchema { .. }
                | Self::OlderSchema { .. }
                | Self::InUse { .. }
                | Self::UnknownCampaign { .. }
                | Self::UnknownWorker { .. }
                | Self::OtherDefinition { .. }
                | Self::OtherModel { .. }
                | Self::MixedModels { .. }
                | Self::Flagged { .. }
                | Self::OtherTruth { .. }
                | Self::SeedTooLarge { .. }
                | Self::OnlyReads
                | Self::Folder { .. }
                | Self::NoLocks { .. }
                | Self::NotWritable { .. }
                | Self::BadQuery { .. }
                | Self::BadRow { .. }
        )
    }

    /// Whether the operation may succeed later, for example after the machine is repaired.
    pub const fn is_temporary(&self) -> bool {
        matches!(
            self,
            Self::Unavailable { .. } | Self::DiskFull | Self::FileGone { .. } | Self::Busy
        )
    }

    /// Whether the data that were read are invalid, in contrast to a failure of reading.
    pub fn is_of_the_data(&self) -> bool {
        match self {
            Self::Malformed { .. } | Self::Damaged { .. } | Self::Altered { .. } => true,
            Self::Database(error) => {
                matches!(error, sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_))
            }
            _ => false,
        }
    }

    /// Whether the content of the database is the cause, its schema included.
    pub(crate) fn is_of_the_database(&self) -> bool {
        matches!(self, Self::Database(_)) || self.is_of_the_data()
    }

    /// Whether the rows to be written are the cause: their cells, or their references.
    pub(crate) fn is_about_rows(&self) -> bool {
        match self {
            Self::BadRow { .. } | Self::OtherDefinition { .. } => true,
            Self::Database(error) => is_constraint(error),
            _ => false,
        }
    }

    /// Error of a database that has not responded for this time.
    pub(crate) fn silent(for_so_long: Duration) -> Self {
        Self::Unavailable { reason: format!("no response within {} s", for_so_long.as_secs()) }
    }

    pub(crate) const fn is_unavailable(&self) -> bool {
        matches!(self, Self::Unavailable { .. })
    }
}
