//! From a library to what surrogates are trained on.

use tracktwin_library::{CampaignRecord, Library, LibraryError};
use tracktwin_parameters::Parameter;
use tracktwin_signal::{FeatureDefinition, FeatureSet};
use tracktwin_surrogate::{FeatureColumns, TrainOptions, TrainingSet};
use tracktwin_worker::Experiment;

/// The feature vectors of the paper, each trained at every speed (paper, eq. 9).
const PAPER: [FeatureSet; 5] =
    [FeatureSet::Gf, FeatureSet::Lf1, FeatureSet::Lf2, FeatureSet::Lf3, FeatureSet::Lf4];

/// Why a library can't be trained on.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The library can't be read.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The campaign's experiment isn't understood by this version.
    #[error("campaign {campaign}: its experiment is not understood: {source}")]
    Experiment {
        /// The campaign.
        campaign: String,
        /// What the parser said.
        source: serde_json::Error,
    },
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

/// What to train: the paper's feature vectors at every speed, and the global feature of all speeds
/// together.
pub fn options(set: &TrainingSet) -> TrainOptions {
    let columns = |feature: FeatureSet| FeatureColumns {
        name: feature.name().to_owned(),
        columns: feature.bins(&set.frequencies_hz),
    };
    TrainOptions::new(PAPER.into_iter().map(columns).collect())
}

/// How a campaign's features are made.
///
/// # Errors
/// [`TrainingError::Experiment`].
pub fn feature_definition(campaign: &CampaignRecord) -> Result<FeatureDefinition, TrainingError> {
    let experiment: Experiment = serde_json::from_str(&campaign.experiment_json)
        .map_err(|source| TrainingError::Experiment { campaign: campaign.id.clone(), source })?;
    Ok(experiment.features)
}
