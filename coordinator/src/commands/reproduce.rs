//! `tracktwin reproduce`: compares this program's results with the paper's.

use super::files::{Force, check, make_folder};
use super::library::{CHOOSE_REMEDY, choose};
use super::library_url::LibraryUrl;
use super::progress::{Progress, Stages, TrainingBar};
use super::{OrInput, Stop, evaluate, print_json, println_stderr, println_stdout};
use crate::pipeline;
use crate::pipeline::compute::compute;
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::models::{check_files, train_into};
use crate::pipeline::reproduce::ReproducingError;
use anyhow::anyhow;
use clap::Args;
use std::path::{Path, PathBuf};
use tracktwin_experiment::Experiment;
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_library::{CampaignRecord, Library};
use tracktwin_reproduction::{
    ClaimVerdict, Compared, Figure, Provenance, Recordings, Reproduction, Results,
};
use tracktwin_surrogate::{Trained, TrainingSet};

/// Arguments of `reproduce`.
#[derive(Args)]
#[command(after_long_help = "\
The paper: Shen et al. 2023, Mechanical Systems and Signal Processing 204, 110730.

  fig2    acceleration, CWT and SSWT of five bays (passes are simulated)
  fig3    spectra at six sleepers (likewise)
  fig8    power spectrum of the irregularity
  fig9    receptance peaks of the nominal track
  fig10   spectra at several speeds
  fig11   best matches of the model selector
  fig12   sensitivity of the spectra to each parameter
  fig13   model selector and the size of the library
  fig14   errors of the models on the test half (needs models)
  fig15   tracks of the examples
  fig16   example: a step in railpad and ballast (needs models; passes are simulated)
  fig17   example: levels of irregularity (likewise)
  fig18   example: bending stiffness of the sleepers (likewise)
  fig19   example: stiffness reduced at a few sleepers (likewise)
  fig25   Gaussian processes and other regressions (needs models)

Commands that fill a library for all figures and compare the results:

  tracktwin run --cases 10000 --no-train --library sqlite:library.sqlite --out out
  tracktwin reproduce --library sqlite:library.sqlite --out reproduction

Exit codes: 0 no row differs, 1 a row differs, 2 wrong input, 3 failure.")]
pub(super) struct Arguments {
    /// Figures of the paper, such as `fig14` [default: all available].
    #[arg(value_name = "FIGURE")]
    figures: Vec<String>,
    #[command(flatten)]
    library: LibraryUrl,
    /// Output folder for reproduce.json and reproduce.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Folder of models trained on this library [default: OUT/models, trained when needed].
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Id or name of the campaign; required if the library holds several.
    #[arg(long, value_name = "CAMPAIGN")]
    campaign: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Seed that selects the training half of the cases when no models are given, as with `train`.
const SEED: u64 = 0;

/// The output files.
const PAGE: &str = "reproduce.html";
const ANSWER: &str = "reproduce.json";

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let figures = figures(&arguments.figures).or_input()?;
    let library = arguments.library.open_whole().await?;
    let given = arguments.models.as_deref().map(Trained::load).transpose().or_input()?;
    let campaign = campaign(&library, arguments.campaign.as_deref(), given.as_ref()).await?;
    let experiment = pipeline::train::experiment(&campaign).or_input()?;
    pipeline::reproduce::check(&experiment, &figures).or_input()?;
    let out = &arguments.out;
    check(out, Kind::Results, arguments.force, &[PAGE, ANSWER])?;
    make_folder(out)?;
    let needed = figures.iter().any(|figure| figure.needs_models());
    let models = match given {
        Some(models) => Some(models),
        None if needed => {
            let folder = out.join("models");
            match kept(&library, &campaign, &folder).await? {
                Some(models) => Some(models),
                None => Some(train(&library, &campaign, &folder, arguments.force).await?),
            }
        }
        None => None,
    };
    let material = Material::read(&library, &campaign, models).await?;
    let reproduction = compare(&figures, &experiment, &material).await.or_input()?;
    write(&reproduction, out, arguments.force)?;
    if arguments.json {
        print_json(&reproduction);
    } else {
        print(&reproduction, out);
    }
    if reproduction.count(ClaimVerdict::Differs) > 0 { Err(Stop::Negative) } else { Ok(()) }
}

/// Models of the library in its present state, if an earlier call trained them in this folder.
async fn kept(
    library: &Library,
    campaign: &CampaignRecord,
    folder: &Path,
) -> Result<Option<Trained>, Stop> {
    let Ok(models) = Trained::load(folder) else { return Ok(None) };
    let digest = library.digest(&campaign.id).await?;
    let fit = models.campaign() == campaign.id && models.belongs_to(&digest).is_ok();
    if fit {
        println_stderr(&format!("models: those of {} are used again", folder.display()));
    }
    Ok(fit.then_some(models))
}

/// Trains models of the campaign when none were given.
async fn train(
    library: &Library,
    campaign: &CampaignRecord,
    folder: &Path,
    Force { force }: Force,
) -> Result<Trained, Stop> {
    check_files(folder, force)?;
    make_folder(folder)?;
    let bar = TrainingBar::default();
    let watch = |at: tracktwin_surrogate::Progress<'_>| bar.at(&at);
    let trained = train_into(folder, force, library, campaign, SEED, None, &watch).await?;
    bar.end();
    Ok(trained)
}

/// The figures with these names, each once, in the order of the paper; all figures if no names are given.
fn figures(names: &[String]) -> Result<Vec<Figure>, anyhow::Error> {
    if names.is_empty() {
        return Ok(Figure::ALL.to_vec());
    }
    let parsed = names.iter().map(|name| name.parse().map_err(|error: String| anyhow!(error)));
    let mut figures = parsed.collect::<Result<Vec<Figure>, _>>()?;
    figures.sort_unstable();
    figures.dedup();
    Ok(figures)
}

/// The named campaign, or the campaign of the models, or the only one.
async fn campaign(
    library: &Library,
    id: Option<&str>,
    models: Option<&Trained>,
) -> Result<CampaignRecord, Stop> {
    let campaign = choose(library, id.or(models.map(Trained::campaign)), CHOOSE_REMEDY).await?;
    match models {
        Some(models) if models.campaign() != campaign.id => {
            let (of, id) = (models.campaign(), &campaign.id);
            Err(anyhow!(
                "--models: the models belong to campaign {of}, not {id}; train models on {id}"
            ))
            .or_input()
        }
        _ => Ok(campaign),
    }
}

/// The results of a library, and the models trained on them.
enum Material {
    Results(Box<TrainingSet>),
    Models(Box<Evaluator>),
}

impl Material {
    async fn read(
        library: &Library,
        campaign: &CampaignRecord,
        models: Option<Trained>,
    ) -> Result<Self, Stop> {
        let Some(models) = models else {
            let set = pipeline::train::set(library, campaign, None).await?;
            return Ok(Self::Results(Box::new(set)));
        };
        let evaluator = Evaluator::new(models, library).await.map_err(evaluate::stop)?;
        evaluator.models().belongs_to(&evaluator.set().library_digest).or_input()?;
        Ok(Self::Models(Box::new(evaluator)))
    }

    fn set(&self) -> &TrainingSet {
        match self {
            Self::Results(set) => set,
            Self::Models(evaluator) => evaluator.set(),
        }
    }

    fn evaluator(&self) -> Option<&Evaluator> {
        match self {
            Self::Results(_) => None,
            Self::Models(evaluator) => Some(evaluator),
        }
    }
}

async fn compare(
    figures: &[Figure],
    experiment: &Experiment,
    material: &Material,
) -> Result<Reproduction, ReproducingError> {
    let set = material.set();
    let mut examples = if figures.iter().any(|figure| figure.needs_passes()) {
        let stages = Stages::default();
        let mut at = |share| stages.at("examples", share);
        let recordings =
            compute(|| tracktwin_reproduction::recordings(figures, experiment, &mut at))?;
        stages.end();
        recordings
    } else {
        Recordings::new()
    };
    let evaluator = material.evaluator();
    let results = Results {
        experiment,
        set,
        seed: evaluator.map_or(SEED, |evaluator| evaluator.models().split_seed()),
    };
    let mut progress = Progress::begin("comparing", 0, figures.len() as u64);
    let mut all: Vec<Compared> = Vec::new();
    for (done, &figure) in figures.iter().enumerate() {
        progress.at(done as u64, figure.name());
        let recordings = examples.remove(&figure).unwrap_or_default();
        let compared = pipeline::reproduce::compared(figure, &results, evaluator, recordings);
        all.extend(compared.await?);
    }
    progress.end();
    let provenance = Provenance {
        code_version: env!("CARGO_PKG_VERSION"),
        campaign: set.campaign.clone(),
        library_digest: set.library_digest.clone(),
        library_entries: set.entries(),
    };
    Ok(Reproduction::new(provenance, all))
}

/// Writes the files.
fn write(reproduction: &Reproduction, out: &Path, force: Force) -> Result<(), FilesError> {
    let page = tracktwin_report::reproduction_page(reproduction, &evaluate::command());
    let mut output = Output::begin(out, Kind::Results, force.force)?;
    output.add(&FileName::new(PAGE)?, page.as_bytes())?;
    output.add(&FileName::new(ANSWER)?, reproduction.json().as_bytes())?;
    output.commit()
}

/// Prints every row, and the number of rows with each verdict.
fn print(reproduction: &Reproduction, out: &Path) {
    for row in &reproduction.rows {
        let (figure, verdict) = (row.figure.name(), row.verdict.label());
        println_stdout(&format!(
            "{figure:6} {verdict:12} {}: {} (paper: {})",
            row.claim, row.ours, row.paper
        ));
    }
    let count = |verdict| reproduction.count(verdict);
    let checks = match reproduction.checks() {
        0 => String::new(),
        checks => {
            format!("of {checks} checks of the program {} hold; ", count(ClaimVerdict::Holds))
        }
    };
    println_stdout(&format!(
        "{} reproduced, {} differ, {} cannot tell; {checks}page: {}",
        count(ClaimVerdict::Reproduced),
        count(ClaimVerdict::Differs),
        count(ClaimVerdict::CannotTell),
        out.join(PAGE).display()
    ));
}
