//! From a library to what surrogates are trained on.

use tracktwin_experiment::{Experiment, ExperimentError};
use tracktwin_library::{CampaignRecord, Library, LibraryError};
use tracktwin_parameters::{Parameter, ParameterSet};
use tracktwin_signal::{FeatureDefinition, FeatureSet};
use tracktwin_surrogate::ENTRIES_MIN;
use tracktwin_surrogate::Tested;
use tracktwin_surrogate::{FeatureColumns, ModelGroup, Split, TrainOptions, Trained, TrainingSet};

/// The feature vectors that models are trained on (paper, eq. 9).
pub(super) const TRAINED: [FeatureSet; 5] =
    [FeatureSet::Gf, FeatureSet::Lf1, FeatureSet::Lf2, FeatureSet::Lf3, FeatureSet::Lf4];

/// Test cases that a picture can show without becoming a blot.
const TESTED_SHOWN: usize = 1000;

/// Why a library can't be trained on.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The library can't be read.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// No parameter varies.
    #[error(
        "campaign {campaign}: no parameter varies over its finished cases; train on a \
             campaign with a range for at least one parameter"
    )]
    NothingVaries {
        /// The campaign.
        campaign: String,
    },
    /// Too few cases are finished.
    #[error(
        "campaign {campaign}: {finished} cases are finished, but training needs \
             {ENTRIES_MIN}; simulate more with `tracktwin run --cases N`, or with a coordinator \
             and `tracktwin campaign add --cases N`"
    )]
    TooFew {
        /// The campaign.
        campaign: String,
        /// Cases that are finished.
        finished: u32,
    },
    /// The campaign's experiment isn't understood by this version.
    #[error("campaign {campaign}: invalid experiment: {source}")]
    Experiment {
        /// The campaign.
        campaign: String,
        /// What is wrong with it.
        source: ExperimentError,
    },
    /// The campaign's definition isn't understood by this version.
    #[error("campaign {campaign}: invalid definition: {source}")]
    Definition {
        /// The campaign.
        campaign: String,
        /// What is wrong with it.
        source: serde_json::Error,
    },
}

/// All finished cases of a campaign, if there are enough of them to train on and they differ.
///
/// # Errors
/// [`TrainingError`]; everything that can be checked without the results is checked before they are
/// read.
pub async fn set_to_train_on(
    library: &Library,
    campaign: &CampaignRecord,
) -> Result<TrainingSet, TrainingError> {
    let finished = library.status(&campaign.id).await?.finished;
    if (finished as usize) < ENTRIES_MIN {
        return Err(TrainingError::TooFew { campaign: campaign.id.clone(), finished });
    }
    let set = set(library, campaign).await?;
    if set.varied.is_empty() {
        return Err(TrainingError::NothingVaries { campaign: campaign.id.clone() });
    }
    Ok(set)
}

/// All finished cases of a campaign, and what training on them must know.
///
/// # Errors
/// [`TrainingError`].
pub async fn set(
    library: &Library,
    campaign: &CampaignRecord,
) -> Result<TrainingSet, TrainingError> {
    let features = feature_definition(campaign)?;
    let speeds = campaign.speeds_km_h.len();
    let mut log_power = vec![Vec::new(); speeds];
    let mut values = Vec::new();
    library
        .training_set(&campaign.id, |entry| {
            values.push(entry.case.parameters);
            for (table, features) in log_power.iter_mut().zip(&entry.features) {
                table.extend_from_slice(&features.log_power);
            }
        })
        .await?;
    let varies = |parameter: &Parameter| {
        values.windows(2).any(|pair| pair[0][*parameter] != pair[1][*parameter])
    };
    let varied: Vec<_> = Parameter::ALL.iter().copied().filter(varies).collect();
    let parameters =
        values.iter().flat_map(|set| varied.iter().map(|&parameter| set[parameter])).collect();
    Ok(TrainingSet {
        frequencies_hz: features.frequencies_hz(),
        speeds_km_h: campaign.speeds_km_h.clone(),
        log_power,
        varied,
        parameters,
        campaign: campaign.id.clone(),
        library_digest: library.digest(&campaign.id).await?,
        feature_definition: serde_json::to_value(&features).expect("settings become JSON"),
    })
}

/// Models to train: the paper's feature vectors at every speed, and the global feature of all
/// speeds together.
pub fn options(set: &TrainingSet) -> TrainOptions {
    let columns = |feature: FeatureSet| FeatureColumns {
        name: feature.name().to_owned(),
        columns: feature.bins(&set.frequencies_hz),
    };
    TrainOptions::new(TRAINED.into_iter().map(columns).collect())
}

/// True and predicted values of cases that no model was trained on, by the models that read most
/// speeds.
///
/// # Errors
/// [`tracktwin_surrogate::Error`] when set and models don't belong together.
pub fn tested(
    set: &TrainingSet,
    trained: &Trained,
) -> Result<Vec<Tested>, tracktwin_surrogate::Error> {
    let Some(group) = trained.groups().last() else { return Ok(Vec::new()) };
    tested_by(set, trained, group)
}

/// True and predicted values of cases that no model was trained on, by the models of one group.
///
/// # Errors
/// [`tracktwin_surrogate::Error`] when set and models don't belong together.
pub fn tested_by(
    set: &TrainingSet,
    trained: &Trained,
    group: &ModelGroup,
) -> Result<Vec<Tested>, tracktwin_surrogate::Error> {
    let mut cases = Split::halves(set.entries(), trained.split_seed()).test;
    cases.truncate(TESTED_SHOWN);
    let bins = set.frequencies_hz.len();
    let speeds: Vec<_> = (0..set.speeds_km_h.len())
        .filter(|&speed| group.key().speeds_km_h.contains(&set.speeds_km_h[speed]))
        .collect();
    let features = |case: usize, speed: usize| &set.log_power[speed][case * bins..][..bins];
    let observed: Vec<Vec<f64>> = cases
        .iter()
        .map(|&case| speeds.iter().flat_map(|&speed| features(case, speed)).copied().collect())
        .collect();
    let predicted = group.predict(&observed)?;
    let pairs = |column: usize| {
        let truth = |case: usize| set.parameters[case * set.varied.len() + column];
        let pairs = cases.iter().zip(&predicted);
        pairs.map(|(&case, of)| (truth(case), of[column].mean)).collect()
    };
    Ok(set.varied.iter().enumerate().map(|(column, &of)| (of, pairs(column))).collect())
}

/// How a campaign's features are made.
///
/// # Errors
/// [`TrainingError::Experiment`].
pub fn feature_definition(campaign: &CampaignRecord) -> Result<FeatureDefinition, TrainingError> {
    Ok(experiment(campaign)?.features)
}

/// The values of the parameters that a campaign does not vary.
///
/// # Errors
/// [`TrainingError::Definition`].
pub fn fixed(campaign: &CampaignRecord) -> Result<ParameterSet, TrainingError> {
    #[derive(serde::Deserialize)]
    struct Definition {
        fixed: [f64; Parameter::COUNT],
    }
    serde_json::from_str::<Definition>(&campaign.definition_json)
        .map(|definition| ParameterSet::new(definition.fixed))
        .map_err(|source| TrainingError::Definition { campaign: campaign.id.clone(), source })
}

/// Experiment of a campaign's cases.
///
/// # Errors
/// [`TrainingError::Experiment`].
pub fn experiment(campaign: &CampaignRecord) -> Result<Experiment, TrainingError> {
    Experiment::from_json(&campaign.experiment_json)
        .map_err(|source| TrainingError::Experiment { campaign: campaign.id.clone(), source })
}
