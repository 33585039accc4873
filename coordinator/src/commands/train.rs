//! `tracktwin train`: Gaussian-process models from a library.

use super::files::{Force, check, make_folder};
use super::library::{MEND, choose};
use super::library_url::LibraryUrl;
use super::progress::Progress;
use super::{OrInput, Stop, say};
use crate::pipeline;
use crate::pipeline::provenance;
use crate::pipeline::train::TrainingError;
use clap::Args;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_library::{CampaignRecord, Library};
use tracktwin_surrogate::{GroupKey, ModelGroup, ParameterModel, Trained};

/// What `train` is told.
#[derive(Args)]
#[command(
    after_help = "At least 200 cases of the campaign must be finished: half of them train, the other half tests. \
Exit codes: 0 done, 2 wrong input (too few cases, or none of their parameters varies), 3 failure."
)]
pub(super) struct Arguments {
    #[command(flatten)]
    library: LibraryUrl,
    /// Folder for the models.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// The campaign by its id or name, where the library holds several.
    #[arg(long, value_name = "CAMPAIGN")]
    campaign: Option<String>,
    /// Decides which half of the cases trains; the other tests.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    check_files(&arguments.out, arguments.force)?;
    let library = arguments.library.open_whole().await?;
    let campaign = choose(&library, arguments.campaign.as_deref(), MEND).await?;
    let trained =
        train(&library, &campaign, arguments.seed, &arguments.out, arguments.force).await?;
    say(&table(&trained));
    say(&format!("models: {}", arguments.out.display()));
    Ok(())
}

/// Makes sure that models may be written into a folder.
pub(super) fn check_files(folder: &Path, force: Force) -> Result<(), FilesError> {
    check(folder, Kind::Models, force, &["models.html", "mase.json", "models.json"])
}

/// Trains on a campaign and saves models and their errors in `folder`.
pub(super) async fn train(
    library: &Library,
    campaign: &CampaignRecord,
    seed: u64,
    folder: &Path,
    force: Force,
) -> Result<Trained, Stop> {
    check_files(folder, force)?;
    // Before hours of training.
    make_folder(folder)?;
    let set = pipeline::train::set_to_train_on(library, campaign).await.map_err(stop)?;
    let mut options = pipeline::train::options(&set);
    options.seed = seed;
    let (trained, tested) = tokio::task::spawn_blocking(move || {
        let bar = RefCell::new(None::<Progress>);
        let trained = tracktwin_surrogate::train(&set, &options, &|at| {
            let mut bar = bar.borrow_mut();
            let bar = bar.get_or_insert_with(|| Progress::begin("training", 0, at.groups as u64));
            bar.at(at.finished as u64, &at.next.map(name).unwrap_or_default());
        })?;
        bar.take().into_iter().for_each(Progress::end);
        let tested = pipeline::train::tested(&set, &trained)?;
        Ok::<_, tracktwin_surrogate::Error>((trained, tested))
    })
    .await?
    .or_input()?;
    let page = tracktwin_report::models_page(&trained, &tested);
    let mut output = Output::begin(folder, Kind::Models, force.force)?;
    output.add(&FileName::new("models.html")?, page.as_bytes())?;
    output.add(&FileName::new("mase.json")?, mase_json(&trained).as_bytes())?;
    trained.add_to(&mut output)?;
    output.commit()?;
    if let Err(error) = library.record_training(provenance::training(&trained)).await {
        // The models stand in the folder; somebody who may only read the library has them all the same.
        tracing::warn!("the library does not keep what was trained: {error:?}");
    }
    Ok(trained)
}

/// A library that is away is the machine's fault; a campaign that can't be trained on is not.
fn stop(error: TrainingError) -> Stop {
    match error {
        TrainingError::Library(error) => error.into(),
        other => Stop::Input(other.into()),
    }
}

/// MASE on the test set in per cent, a row a group of models (paper, eq. 11 and Fig. 14), and how
/// much of the test set the 90 % intervals hold.
fn table(trained: &Trained) -> String {
    let width = trained.groups().iter().map(|group| name(group.key()).len()).max().unwrap_or(0);
    let heads = trained.groups().first().map(ModelGroup::models).unwrap_or_default().iter();
    let heads = heads.map(|model| format!("{:>13}", model.parameter.symbol()));
    let rows = trained.groups().iter().map(|group| {
        let cells = group.models().iter().map(|ParameterModel { score, .. }| {
            let (mase, held) = (100.0 * score.mase_test, 100.0 * score.coverage_90_test);
            format!("{mase:>7.1} ({held:>3.0}%)")
        });
        format!("{:width$}{}", name(group.key()), cells.collect::<Vec<_>>().concat())
    });
    let title = "Test MASE in % (share of the test set inside its 90 % interval)";
    let heads = format!("{:width$}{}", "", heads.collect::<Vec<_>>().concat());
    let lines: Vec<_> = [title.to_owned(), heads].into_iter().chain(rows).collect();
    lines.join("\n")
}

/// What people call a group: `13 km/h GF`, `7+10+13 km/h GF`.
fn name(key: &GroupKey) -> String {
    let speeds: Vec<_> =
        key.speeds_km_h.iter().map(|speed| tracktwin_number::rounded(*speed, 4)).collect();
    format!("{} km/h {}", speeds.join("+"), key.feature)
}

/// The table as JSON: a record a model.
fn mase_json(trained: &Trained) -> String {
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
    let text =
        serde_json::json!({ "format": "tracktwin-mase/1", "cases": cases, "models": records });
    format!("{text:#}\n")
}
