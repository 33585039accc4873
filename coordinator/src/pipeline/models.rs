//! Trains, tests and saves the models of a campaign.

use super::compute::compute;
use super::provenance;
use super::train::{self, TrainingError};
use std::path::Path;
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_library::{CampaignRecord, Library};
use tracktwin_surrogate::{GroupKey, INDEX, Tested, Trained};

/// Files that are written in addition to those of [`Trained`].
const PAGE: &str = "models.html";
const SCORES: &str = "mase.json";

/// Errors of training models and saving them.
#[derive(Debug, thiserror::Error)]
pub enum ModelsError {
    /// The campaign is unsuitable for training.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The training failed.
    #[error(transparent)]
    Surrogate(#[from] tracktwin_surrogate::Error),
    /// The output folder cannot be written.
    #[error(transparent)]
    Files(#[from] FilesError),
}

impl ModelsError {
    /// Whether the user's input is the cause, and not a failure.
    pub fn is_wrong_input(&self) -> bool {
        match self {
            Self::Training(TrainingError::Library(error)) => error.is_wrong_input(),
            Self::Surrogate(tracktwin_surrogate::Error::Files(error)) | Self::Files(error) => {
                error.is_wrong_input()
            }
            Self::Training(_) | Self::Surrogate(_) => true,
        }
    }
}

/// Checks that models can be written to a folder. With `force`, other files may be replaced.
///
/// # Errors
/// Returns [`FilesError`] with the path of a file that must not be replaced.
pub fn check_files(folder: &Path, force: bool) -> Result<(), FilesError> {
    tracktwin_files::check(folder, Kind::Models, force, &[PAGE, SCORES, INDEX])
}

/// Trains on a campaign, and saves the models and their errors in `folder`. `seed` determines which half of
/// the cases is used for training; `highest_hz` limits the frequencies of the features.
///
/// # Errors
/// Returns [`ModelsError`] if the campaign is unsuitable, the training fails, or a file cannot be written.
pub async fn train_into(
    folder: &Path,
    force: bool,
    library: &Library,
    campaign: &CampaignRecord,
    seed: u64,
    highest_hz: Option<f64>,
    watch: &dyn Fn(tracktwin_surrogate::Progress<'_>),
) -> Result<Trained, ModelsError> {
    let set = train::set_to_train_on(library, campaign, highest_hz).await?;
    let mut options = train::options(&set);
    options.seed = seed;
    let (trained, tested) = compute(|| {
        let trained = tracktwin_surrogate::train(&set, &options, watch)?;
        let tested = train::tested(&set, &trained)?;
        Ok::<_, tracktwin_surrogate::Error>((trained, tested))
    })?;
    save(folder, force, &trained, &tested)?;
    if let Err(error) = library.record_training(provenance::training(&trained)).await {
        // The models in the folder are complete, even if the library is read-only.
        tracing::warn!(
            error = &error as &dyn std::error::Error,
            "the files are complete, but the training cannot be stored in the library"
        );
    }
    Ok(trained)
}

fn save(
    folder: &Path,
    force: bool,
    trained: &Trained,
    tested: &[Tested],
) -> Result<(), ModelsError> {
    let page = tracktwin_report::models_page(trained, tested);
    let mut output = Output::begin(folder, Kind::Models, force)?;
    output.add(&FileName::new(PAGE)?, page.as_bytes())?;
    output.add(&FileName::new(SCORES)?, format!("{:#}\n", scores(trained)).as_bytes())?;
    trained.add_to(&mut output)?;
    Ok(output.commit()?)
}

/// Readable name of a group: `13 km/h GF`, `7+10+13 km/h GF`.
pub fn group_name(key: &GroupKey) -> String {
    let speeds: Vec<_> =
        key.speeds_km_h.iter().map(|speed| tracktwin_number::rounded(*speed, 4)).collect();
    format!("{} km/h {}", speeds.join("+"), key.feature)
}

/// Errors of the models, one record per model: the content of `mase.json`.
pub fn scores(trained: &Trained) -> serde_json::Value {
    let records: Vec<_> = trained
        .groups()
        .iter()
        .flat_map(|group| group.models().iter().map(move |model| (group.key(), model)))
        .map(|(key, model)| {
            serde_json::json!({
                "speeds_km_h": key.speeds_km_h,
                "feature": key.feature,
                "parameter": model.parameter,
                "mase_test": model.score.mase_test,
                "mase_folds": model.score.mase_folds,
                "coverage_90_test": model.score.coverage_90_test,
            })
        })
        .collect();
    let cases = trained.entries();
    serde_json::json!({ "format": "tracktwin-mase/1", "cases": cases, "models": records })
}
