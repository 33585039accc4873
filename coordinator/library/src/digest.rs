//! One hash over everything a campaign has found.

use crate::{Library, LibraryError};

impl Library {
    /// BLAKE3 (hexadecimal) over the checksums of a campaign's results by index: parameters, seed
    /// and features, to the bit. Equal campaigns have equal digests, independent of workers, order
    /// and database.
    ///
    /// Checksums are computed from the stored data, so a digest describes the stored data;
    /// [`Library::verify`] checks that they are what the workers reported.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read or has no such campaign.
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
