//! The training set of surrogates.

use super::entry::LibraryEntry;
use super::stored::StoredCase;
use crate::digest::Digest;
use crate::model::OneModel;
use crate::{Library, LibraryError};

impl Library {
    /// Passes every finished case of a campaign to `take`, by ascending index. Returns the digest of these
    /// cases: that of [`Library::digest`], if no case was finished since.
    ///
    /// Only one entry is in memory at a time, independent of the number of cases.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if the library cannot be read, a case lacks a speed, its results do not match
    /// their checksum or are flagged, or several models have computed the results.
    pub async fn training_set(
        &self,
        campaign: &str,
        mut take: impl FnMut(LibraryEntry),
    ) -> Result<String, LibraryError> {
        let speeds = self.campaign(campaign).await?.speeds_km_h.len();
        let mut digest = Digest::new();
        let mut model = OneModel::of(campaign);
        let complete = |case: StoredCase| {
            model.check(&case)?;
            refuse_flagged(campaign, &case)?;
            digest.add(&case);
            complete(case, speeds).map(&mut take)
        };
        self.stored_cases(campaign, complete).await?;
        Ok(digest.finish())
    }
}

fn refuse_flagged(campaign: &str, case: &StoredCase) -> Result<(), LibraryError> {
    let Some(reason) = case.flagged.clone() else { return Ok(()) };
    Err(LibraryError::Flagged { campaign: campaign.to_owned(), index: case.case.index, reason })
}

fn complete(case: StoredCase, speeds: usize) -> Result<LibraryEntry, LibraryError> {
    let (index, found) = (case.case.index, case.passes.len());
    if found == speeds {
        return case.entry();
    }
    Err(LibraryError::Damaged { what: format!("case {index} has {found} of {speeds} results") })
}
