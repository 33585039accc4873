//! Restores cases that were altered in a library from the stored definition of their campaign.

use super::{Campaign, Definition, StoreError, Surfaces, case, drawn};
use serde::Deserialize;
use tracktwin_experiment::Experiment;
use tracktwin_library::{AlteredCase, CampaignRecord, Library};
use tracktwin_parameters::{Axis, Case, Parameter, ParameterSpace, Sequence};

/// Gives cases that do not match their hash the parameters that their campaign's definition states. Returns the
/// number of these cases.
///
/// # Errors
/// Returns [`StoreError`] if the library fails, or if the definition does not state these cases.
pub async fn restore_cases(library: &Library, id: &str) -> Result<u32, StoreError> {
    let altered = library.altered_cases(id).await?;
    if altered.is_empty() {
        return Ok(0);
    }
    let campaign = stored(&library.campaign(id).await?)?;
    let experiment = &campaign.definition.experiment;
    let mut restored = Vec::with_capacity(altered.len());
    for altered in &altered {
        let case = original(&campaign, id, altered)?;
        restored.push((case.clone(), drawn(experiment, &case)));
    }
    library.restore_cases(id, restored).await?;
    Ok(u32::try_from(altered.len()).unwrap_or(u32::MAX))
}

/// The case as the definition states it. Either its parameters or its hash must be as stored; otherwise the
/// stored case is not of this definition.
fn original(campaign: &Campaign, id: &str, altered: &AlteredCase) -> Result<Case, StoreError> {
    let index = altered.case.index;
    let original = case(campaign, index)?;
    let same = original.parameter_hash();
    if same == altered.parameter_hash || same == altered.case.parameter_hash() {
        return Ok(original);
    }
    Err(StoreError::OtherCase { campaign: id.to_owned(), index })
}

/// Parts of a stored definition.
#[derive(Deserialize)]
struct Stored {
    seed: u64,
    sequence: Sequence,
    space: Vec<Axis>,
    fixed: [f64; Parameter::COUNT],
    #[serde(default)]
    surfaces: Surfaces,
}

/// The campaign of a record, whose definition must match its hash.
fn stored(record: &CampaignRecord) -> Result<Campaign, StoreError> {
    let unreadable =
        |reason: String| StoreError::Definition { campaign: record.id.clone(), reason };
    let hash = blake3::hash(record.definition_json.as_bytes()).to_hex();
    if hash.as_str() != record.definition_hash {
        return Err(unreadable("it does not match its hash".to_owned()));
    }
    let stored: Stored = serde_json::from_str(&record.definition_json)
        .map_err(|error| unreadable(error.to_string()))?;
    let Stored { seed, sequence, space, fixed, surfaces } = stored;
    let space = ParameterSpace::new(space).map_err(|error| unreadable(error.to_string()))?;
    let experiment = Experiment::from_json(&record.experiment_json)
        .map_err(|error| unreadable(error.to_string()))?;
    Ok(Campaign {
        name: record.name.clone(),
        cases: u32::MAX,
        sequence_by_cases: false,
        definition: Definition { seed, sequence, space, fixed, surfaces, experiment },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(campaign: &Campaign) -> CampaignRecord {
        let experiment = &campaign.definition.experiment;
        CampaignRecord {
            id: campaign.id(),
            name: campaign.name.clone(),
            definition_json: campaign.definition_json(),
            definition_hash: campaign.definition_hash(),
            experiment_json: experiment.to_json(),
            experiment_hash: experiment.hash(),
            speeds_km_h: experiment.speeds_km_h.clone(),
            seed: campaign.definition.seed,
        }
    }

    #[test]
    fn the_stored_definition_states_the_same_cases() {
        for extra in ["", "surfaces = \"shared\"\n", "sequence = \"rotated\"\n"] {
            let file = format!("{extra}{}", crate::campaign::DEFAULT);
            let campaign = Campaign::parse(&file, "c.toml", Some(40)).unwrap();
            let again = stored(&record(&campaign)).unwrap();
            for index in [0, 17, 39] {
                assert_eq!(case(&again, index).unwrap(), case(&campaign, index).unwrap());
            }
        }
    }

    #[test]
    fn a_definition_that_was_altered_restores_nothing() {
        let campaign = Campaign::built_in(Some(40)).unwrap();
        let mut record = record(&campaign);
        record.definition_json = record.definition_json.replacen("\"seed\":1", "\"seed\":2", 1);
        let error = stored(&record).unwrap_err().to_string();
        assert!(
            error.contains("does not match its hash") && error.contains("library copy"),
            "{error}"
        );
    }

    #[test]
    fn a_case_whose_parameters_and_hash_are_both_others_is_not_restored() {
        let campaign = Campaign::built_in(Some(40)).unwrap();
        let whole = case(&campaign, 3).unwrap();
        let other = Case { surface_seed: 1, ..whole.clone() };
        let (hash, no_hash) = (whole.parameter_hash(), "0".to_owned());
        let altered = |case: &Case, parameter_hash: &String| AlteredCase {
            case: case.clone(),
            parameter_hash: parameter_hash.clone(),
        };
        assert_eq!(original(&campaign, "c", &altered(&other, &hash)).unwrap(), whole);
        assert_eq!(original(&campaign, "c", &altered(&whole, &no_hash)).unwrap(), whole);
        let error = original(&campaign, "c", &altered(&other, &no_hash)).unwrap_err().to_string();
        assert!(error.contains("case 3") && error.contains("library copy"), "{error}");
    }
}
