//! `tracktwin train`: trains Gaussian-process models on a library.

use super::files::{Force, make_folder};
use super::library::{CHOOSE_REMEDY, choose};
use super::library_url::LibraryUrl;
use super::numbers::number;
use super::progress::TrainingBar;
use super::{Stop, print_json, println_stdout};
use crate::pipeline::models::{check_files, group_name, scores, train_into};
use clap::Args;
use std::path::PathBuf;
use tracktwin_parameters::quantity::FREQUENCY;
use tracktwin_surrogate::{ModelGroup, ParameterModel, Trained};

/// Arguments of `train`.
#[derive(Args)]
#[command(after_help = "\
At least 200 cases of the campaign must be finished: one half is used for training, the other half
for testing.

Next: `tracktwin evaluate RECORDING --models DIR --library URL --out RESULT`

Exit codes: 0 done, 2 wrong input (too few cases, or no parameter varies), 3 failure.")]
pub(super) struct Arguments {
    #[command(flatten)]
    library: LibraryUrl,
    /// Output folder for the models.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Id or name of the campaign; required if the library holds several.
    #[arg(long, value_name = "CAMPAIGN")]
    campaign: Option<String>,
    /// Highest frequency of the features in Hz [default: all features]; a recording of a low sample rate
    /// needs 0.4 times its rate or less.
    #[arg(long, value_name = "HZ", value_parser = number(FREQUENCY))]
    highest: Option<f64>,
    /// Seed that selects the training half of the cases.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let Arguments { library, out, force: Force { force }, campaign, highest, seed, json } =
        arguments;
    check_files(&out, force)?;
    let library = library.open_whole().await?;
    let campaign = choose(&library, campaign.as_deref(), CHOOSE_REMEDY).await?;
    // Before the training, which takes hours.
    make_folder(&out)?;
    let bar = TrainingBar::default();
    let watch = |at: tracktwin_surrogate::Progress<'_>| bar.at(&at);
    let trained = train_into(&out, force, &library, &campaign, seed, highest, &watch).await?;
    bar.end();
    if json {
        print_json(&scores(&trained));
    } else {
        println_stdout(&table(&trained));
        println_stdout(&format!("models: {}", out.display()));
    }
    Ok(())
}

/// MASE on the test set in per cent, one row per group of models (paper, eq. 11 and Fig. 14), and
/// the coverage of the 90 % intervals.
fn table(trained: &Trained) -> String {
    let width =
        trained.groups().iter().map(|group| group_name(group.key()).len()).max().unwrap_or(0);
    let heads = trained.groups().first().map(ModelGroup::models).unwrap_or_default().iter();
    let heads = heads.map(|model| format!("{:>13}", model.parameter.symbol()));
    let rows = trained.groups().iter().map(|group| {
        let cells = group.models().iter().map(|ParameterModel { score, .. }| {
            let (mase, held) = (100.0 * score.mase_test, 100.0 * score.coverage_90_test);
            format!("{mase:>7.1} ({held:>3.0}%)")
        });
        format!("{:width$}{}", group_name(group.key()), cells.collect::<Vec<_>>().concat())
    });
    let title = "Test MASE in % (coverage of the 90 % interval)";
    let heads = format!("{:width$}{}", "", heads.collect::<Vec<_>>().concat());
    let lines: Vec<_> = [title.to_owned(), heads].into_iter().chain(rows).collect();
    lines.join("\n")
}
