//! One hash over everything a campaign has found.

use crate::{Library, LibraryError};

impl Library {
    /// BLAKE3 (hexadecimal) over the checksums of a campaign's results by index: parameters, seed and
    /// features, to the bit. Equal campaigns have equal digests whoever simulated them, in whatever
    /// order, and in whichever database.
    ///
    /// Checksums are made of what is stored, so that a digest says what is there; whether that is what workers
    /// reported, [`Library::verify`] says.
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
