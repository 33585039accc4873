//! Creates the training set of surrogates from a library.

use std::f64::consts::TAU;
use tracktwin_experiment::{Experiment, ExperimentError};
use tracktwin_library::{CampaignRecord, Library, LibraryError};
use tracktwin_number::rounded;
use tracktwin_parameters::{Axis, Parameter, ParameterSet, Scale};
use tracktwin_signal::{FeatureDefinition, FeatureSet};
use tracktwin_surrogate::ENTRIES_MIN;
use tracktwin_surrogate::Tested;
use tracktwin_surrogate::{FeatureColumns, ModelGroup, Split, TrainOptions, Trained, TrainingSet};
use tracktwin_track::model::ContactPatch;

/// The feature vectors that models are trained on (paper, eq. 9).
pub(super) const TRAINED: [FeatureSet; 5] =
    [FeatureSet::Gf, FeatureSet::Lf1, FeatureSet::Lf2, FeatureSet::Lf3, FeatureSet::Lf4];

/// Largest relative distance between the end of a range and its last bin: four bins an octave.
const BIN: f64 = 0.19;

/// Relative error of a stored frequency: the last bin of models that were saved is one of them.
const ROUNDING: f64 = 1e-9;

/// Maximum number of test cases shown in a chart.
const TESTED_SHOWN: usize = 1000;

/// Reasons for not training on a library.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The library can't be read.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// No parameter is varied.
    #[error(
        "campaign {campaign}: no parameter varies over its finished cases; train on a \
             campaign with a range for at least one parameter"
    )]
    NothingVaries {
        /// Id of the campaign.
        campaign: String,
    },
    /// Too few cases are finished.
    #[error(
        "campaign {campaign}: {finished} cases are finished, but training needs \
             {ENTRIES_MIN}; simulate more with `tracktwin run --cases N`, or with a coordinator \
             and `tracktwin campaign add --cases N`"
    )]
    TooFew {
        /// Id of the campaign.
        campaign: String,
        /// Number of finished cases.
        finished: u32,
    },
    /// No feature is left.
    #[error("campaign {campaign}: it has no features below {} Hz", rounded(*highest_hz, 5))]
    NoFeatures {
        /// Id of the campaign.
        campaign: String,
        /// Highest frequency allowed in Hz.
        highest_hz: f64,
    },
    /// This version of the program cannot read the campaign's experiment.
    #[error("campaign {campaign}: invalid experiment: {source}")]
    Experiment {
        /// Id of the campaign.
        campaign: String,
        /// Cause.
        source: ExperimentError,
    },
    /// This version of the program cannot read the campaign's definition.
    #[error("campaign {campaign}: invalid definition: {source}")]
    Definition {
        /// Id of the campaign.
        campaign: String,
        /// Cause.
        source: serde_json::Error,
    },
}

/// Reads all finished cases of a campaign, with features up to `highest_hz`. There must be enough cases for
/// training, and a parameter must vary.
///
/// # Errors
/// Returns [`TrainingError`]. All checks that do not need the results are made before the results are read.
pub async fn set_to_train_on(
    library: &Library,
    campaign: &CampaignRecord,
    highest_hz: Option<f64>,
) -> Result<TrainingSet, TrainingError> {
    let finished = library.status(&campaign.id).await?.finished;
    if (finished as usize) < ENTRIES_MIN {
        return Err(TrainingError::TooFew { campaign: campaign.id.clone(), finished });
    }
    if let Some(highest_hz) = highest_hz
        && features_hz(&experiment(campaign)?, Some(highest_hz)).is_empty()
    {
        return Err(TrainingError::NoFeatures { campaign: campaign.id.clone(), highest_hz });
    }
    let set = set(library, campaign, highest_hz).await?;
    if set.varied.is_empty() {
        return Err(TrainingError::NothingVaries { campaign: campaign.id.clone() });
    }
    Ok(set)
}

/// Reads all finished cases of a campaign as a training set, with features up to `highest_hz`.
///
/// # Errors
/// Returns [`TrainingError`] if the library cannot be read or the experiment is invalid.
pub async fn set(
    library: &Library,
    campaign: &CampaignRecord,
    highest_hz: Option<f64>,
) -> Result<TrainingSet, TrainingError> {
    let experiment = experiment(campaign)?;
    let frequencies_hz = features_hz(&experiment, highest_hz);
    let bins = frequencies_hz.len();
    let speeds = campaign.speeds_km_h.len();
    let mut log_power = vec![Vec::new(); speeds];
    let mut values = Vec::new();
    let library_digest = library
        .training_set(&campaign.id, |entry| {
            values.push(entry.case.parameters);
            for (table, features) in log_power.iter_mut().zip(&entry.features) {
                table.extend_from_slice(&features.log_power[..bins]);
            }
        })
        .await?;
    let varies = |parameter: &Parameter| {
        values.windows(2).any(|pair| pair[0][*parameter] != pair[1][*parameter])
    };
    let varied: Vec<_> = Parameter::ALL.iter().copied().filter(varies).collect();
    let axes = definition(campaign)?.space;
    let scale = |parameter: &Parameter| {
        let axis = axes.iter().find(|axis| axis.parameter == *parameter);
        axis.map_or(Scale::Linear, |axis| axis.scale)
    };
    let scales = varied.iter().map(scale).collect();
    let parameters =
        values.iter().flat_map(|set| varied.iter().map(|&parameter| set[parameter])).collect();
    Ok(TrainingSet {
        frequencies_hz,
        speeds_km_h: campaign.speeds_km_h.clone(),
        log_power,
        varied,
        scales,
        parameters,
        campaign: campaign.id.clone(),
        library_digest,
        feature_definition: serde_json::to_value(&experiment.features)
            .expect("settings become JSON"),
    })
}

/// Frequencies in Hz of the bins that models use: all bins of the features up to `highest_hz`. If the contact patch
/// filters the irregularity: the bins below the waves that it averages out at the lowest speed.
pub fn features_hz(experiment: &Experiment, highest_hz: Option<f64>) -> Vec<f64> {
    let mut frequencies_hz = experiment.features.frequencies_hz();
    let highest_hz = highest_hz.unwrap_or(f64::INFINITY);
    frequencies_hz.retain(|frequency_hz| *frequency_hz <= highest_hz * (1.0 + ROUNDING));
    if experiment.design.contact_patch_filter {
        let patch = ContactPatch::new(&experiment.design);
        let slowest_m_s =
            experiment.speeds_km_h.iter().copied().fold(f64::INFINITY, f64::min) / 3.6;
        frequencies_hz.retain(|frequency_hz| !patch.averages_out(TAU * frequency_hz / slowest_m_s));
    }
    frequencies_hz
}

/// The models to train: the feature vectors of the paper at every speed, and the global feature of all
/// speeds combined. Local features that the bins do not contain as a whole are left out.
pub fn options(set: &TrainingSet) -> TrainOptions {
    let columns = |feature: FeatureSet| FeatureColumns {
        name: feature.name().to_owned(),
        columns: feature.bins(&set.frequencies_hz),
    };
    let highest_hz = set.frequencies_hz.last().copied().unwrap_or_default();
    let is_whole = |feature: &FeatureSet| {
        *feature == FeatureSet::Gf || feature.range_hz()[1] <= (1.0 + BIN) * highest_hz
    };
    TrainOptions::new(TRAINED.into_iter().filter(is_whole).map(columns).collect())
}

/// True and predicted values of cases that no model was trained on, for the models that combine the most
/// speeds.
///
/// # Errors
/// Returns [`tracktwin_surrogate::Error`] if the models do not belong to the training set.
pub fn tested(
    set: &TrainingSet,
    trained: &Trained,
) -> Result<Vec<Tested>, tracktwin_surrogate::Error> {
    let Some(group) = trained.groups().last() else { return Ok(Vec::new()) };
    tested_by(set, trained, group)
}

/// True and predicted values of cases that no model was trained on, for the models of one group.
///
/// # Errors
/// Returns [`tracktwin_surrogate::Error`] if the models do not belong to the training set.
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

/// Definition of a campaign's features.
///
/// # Errors
/// Returns [`TrainingError::Experiment`] if the experiment cannot be read.
pub fn feature_definition(campaign: &CampaignRecord) -> Result<FeatureDefinition, TrainingError> {
    Ok(experiment(campaign)?.features)
}

/// Definition of a campaign, without its experiment.
#[derive(serde::Deserialize)]
struct Definition {
    space: Vec<Axis>,
    fixed: [f64; Parameter::COUNT],
}

fn definition(campaign: &CampaignRecord) -> Result<Definition, TrainingError> {
    serde_json::from_str(&campaign.definition_json)
        .map_err(|source| TrainingError::Definition { campaign: campaign.id.clone(), source })
}

/// Values of the parameters that a campaign does not vary.
///
/// # Errors
/// Returns [`TrainingError::Definition`] if the definition cannot be read.
pub fn fixed(campaign: &CampaignRecord) -> Result<ParameterSet, TrainingError> {
    Ok(ParameterSet::new(definition(campaign)?.fixed))
}

/// Experiment of a campaign's cases.
///
/// # Errors
/// Returns [`TrainingError::Experiment`] if the experiment cannot be read.
pub fn experiment(campaign: &CampaignRecord) -> Result<Experiment, TrainingError> {
    Experiment::from_json(&campaign.experiment_json)
        .map_err(|source| TrainingError::Experiment { campaign: campaign.id.clone(), source })
}
