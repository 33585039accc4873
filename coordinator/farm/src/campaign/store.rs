//! Stores campaigns and their cases in a library.

use super::{Campaign, cases};
use tracktwin_experiment::Experiment;
use tracktwin_library::{CampaignRecord, Library, LibraryError};
use tracktwin_parameters::{Case, SobolError};

/// Number of cases stored in one call. It bounds the memory needed for a campaign with a million cases.
const CASES_AT_A_TIME: u32 = 4096;

/// Reasons for not storing a campaign.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The library returned an error.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The campaign's sequence has fewer points than the campaign has cases.
    #[error(transparent)]
    Cases(#[from] SobolError),
    /// The stored definition of a campaign cannot be read.
    #[error(
        "the definition of campaign {campaign} cannot be used ({reason}): copy the intact rows to another library \
         with `tracktwin library copy`, and add the campaign's file there"
    )]
    Definition {
        /// Id of the campaign.
        campaign: String,
        /// Cause.
        reason: String,
    },
    /// A stored case is not of the campaign's definition.
    #[error(
        "case {index} of campaign {campaign} has neither the parameters nor the hash that the campaign's definition \
         states: copy the intact rows to another library with `tracktwin library copy`, and add the campaign's file \
         there"
    )]
    OtherCase {
        /// Id of the campaign.
        campaign: String,
        /// Index of the case.
        index: u32,
    },
}

/// Stores a campaign and those of its cases that the library lacks.
///
/// # Errors
/// Returns [`StoreError`] if the library fails or the sequence has too few points.
pub async fn store_campaign(library: &Library, campaign: &Campaign) -> Result<(), StoreError> {
    insert_campaign(library, campaign).await?;
    add_cases(library, campaign, |_| true).await
}

/// Stores a campaign without adding cases.
///
/// # Errors
/// Returns [`StoreError`] if the library fails.
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

/// Stores the missing cases of a campaign while `goes_on` returns true. The argument of `goes_on` is the
/// number of stored cases.
///
/// # Errors
/// As [`store_campaign`]. Cases stored before the error are kept.
pub async fn add_cases(
    library: &Library,
    campaign: &Campaign,
    mut goes_on: impl FnMut(u32) -> bool,
) -> Result<(), StoreError> {
    let id = campaign.id();
    let experiment = &campaign.definition.experiment;
    // Cases are stored in order, so the existing ones are the first; those after a gap are kept
    // unchanged.
    let mut stored = library.cases_in_order(&id).await?;
    while goes_on(stored) && stored < campaign.cases {
        let end = campaign.cases.min(stored.saturating_add(CASES_AT_A_TIME));
        library
            .insert_cases(&id, &cases(campaign, stored..end)?, |case| drawn(experiment, case))
            .await?;
        stored = end;
    }
    Ok(())
}

/// What is drawn for a case besides its parameters, as JSON; `None` if nothing is.
pub(super) fn drawn(experiment: &Experiment, case: &Case) -> Option<String> {
    let drawn = experiment.drawn(case);
    (!drawn.is_empty()).then(|| serde_json::to_string(&drawn).expect("numbers become JSON"))
}
