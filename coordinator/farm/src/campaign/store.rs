//! Campaigns and their cases on their way into a library.

use super::{Campaign, cases};
use tracktwin_library::{CampaignRecord, Library, LibraryError};
use tracktwin_parameters::SobolError;

/// Cases stored at a time, so that a million need no more memory than these.
const CASES_AT_A_TIME: u32 = 4096;

/// Why a campaign can't be stored.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The library fails or refuses.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The campaign has no such cases.
    #[error(transparent)]
    Cases(#[from] SobolError),
}

/// Stores a campaign and those of its cases that the library does not have yet.
///
/// # Errors
/// [`StoreError`] when the library fails or the campaign has fewer cases.
pub async fn store_campaign(library: &Library, campaign: &Campaign) -> Result<(), StoreError> {
    insert_campaign(library, campaign).await?;
    add_cases(library, campaign, |_| true).await
}

/// Stores a campaign, without cases if it is new.
///
/// # Errors
/// [`StoreError`] when the library fails.
pub async fn insert_campaign(library: &Library, campaign: &Campaign) -> Result<(), StoreError> {
    let definition = &campaign.definition;
    let record = CampaignRecord {
        id: campaign.id(),
        name: campaign.name.clone(),
        definition_json: campaign.definition_json(),
        definition_hash: campaign.definition_hash(),
        experiment_json: definition.experiment.to_json(),
        experiment_hash: definition.experiment.hash(),
        speeds_km_h: definition.experiment.speeds_km_h.clone(),
        seed: definition.seed,
    };
    Ok(library.insert_campaign(&record).await?)
}

/// Stores the missing cases of a campaign while `goes_on` returns true; its argument is the number
/// of stored cases.
///
/// # Errors
/// As [`store_campaign`]; what was stored before stays.
pub async fn add_cases(
    library: &Library,
    campaign: &Campaign,
    mut goes_on: impl FnMut(u32) -> bool,
) -> Result<(), StoreError> {
    let id = campaign.id();
    // Cases are stored in order, so the existing ones are the first; those after a gap are kept
    // unchanged.
    let mut stored = library.cases_in_order(&id).await?;
    while goes_on(stored) && stored < campaign.cases {
        let end = campaign.cases.min(stored.saturating_add(CASES_AT_A_TIME));
        library.insert_cases(&id, &cases(campaign, stored..end)?).await?;
        stored = end;
    }
    Ok(())
}
