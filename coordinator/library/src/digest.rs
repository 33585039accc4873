//! One hash of all results of a campaign.

use crate::{Library, LibraryError};

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
        let mut hasher = blake3::Hasher::new_derive_key("tracktwin library digest 2");
        let add = |case: crate::result::StoredCase| {
            hasher.update(case.checksum().as_bytes());
            Ok(())
        };
        self.stored_cases(campaign, add).await?;
        Ok(hasher.finalize().to_hex().to_string())
    }
}
