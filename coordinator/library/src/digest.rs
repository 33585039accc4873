//! One hash of all results of a campaign.

use crate::result::StoredCase;
use crate::{Library, LibraryError};

/// Hash of the results that are added, by ascending index.
pub(crate) struct Digest(blake3::Hasher);

impl Digest {
    pub(crate) fn new() -> Self {
        Self(blake3::Hasher::new_derive_key("tracktwin library digest 2"))
    }

    pub(crate) fn add(&mut self, case: &StoredCase) {
        self.0.update(case.checksum().as_bytes());
    }

    /// The hash in hexadecimal digits.
    pub(crate) fn finish(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

impl Library {
    /// Returns the BLAKE3 hash (hexadecimal) of the checksums of a campaign's results, ordered by index.
    /// The checksums cover parameters, seed and features to the last bit. Equal campaigns have equal
    /// digests, independent of workers, order and database.
    ///
    /// The checksums are computed again from the stored data. [`Library::verify`] checks that the stored
    /// data are those that the workers reported.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if the library cannot be read or has no such campaign.
    pub async fn digest(&self, campaign: &str) -> Result<String, LibraryError> {
        self.campaign(campaign).await?;
        let mut digest = Digest::new();
        let add = |case: StoredCase| {
            digest.add(&case);
            Ok(())
        };
        self.stored_cases(campaign, add).await?;
        Ok(digest.finish())
    }
}
