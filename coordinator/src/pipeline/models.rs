//! From a campaign to a folder of models: trained, tested and saved.

use super::compute::compute;
use super::provenance;
use super::train::{self, TrainingError};
use std::path::Path;
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_library::{CampaignRecord, Library};
use tracktwin_surrogate::{GroupKey, Tested, Trained};

/// The files that are written beside those of [`Trained`].
const PAGE: &str = "models.html";
const SCORES: &str = "mase.json";

/// Why there are no models.
#[derive(Debug, thiserror::Error)]
pub enum ModelsError {
    /// The campaign can't be trained on.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// Training broke down.
    #[error(transparent)]
    Surrogate(#[from] tracktwin_surrogate::Error),
    /// The folder can't be written.
    #[error(transparent)]
    Files(#[from] FilesError),
}

impl ModelsError {
    /// Whether the input is wrong; otherwise the machine has failed.
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

/// Checks that models may be written into a folder, with `force` over other files.
///
/// # Errors
/// [`FilesError`] names the file in the way.
pub fn check_files(folder: &Path, force: bool) -> Result<(), FilesError> {
    tracktwin_files::check(folder, Kind::Models, force, &[PAGE, SCORES, "models.json"])
}

/// Trains on a campaign, and saves models and their errors in `folder`; `seed` decides which half of the
/// cases trains.
///
/// # Errors
/// [`ModelsError`].
pub async fn train_into(
    folder: &Path,
    force: bool,
    library: &Library,
    campaign: &CampaignRecord,
    seed: u64,
    watch: &dyn Fn(tracktwin_surrogate::Progress<'_>),
) -> Result<Trained, ModelsError> {
    let set = train::set_to_train_on(library, campaign).await?;
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

/// The models' errors, a record a model: the content of `mase.json`.
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
