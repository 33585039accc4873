//! `tracktwin diagnose`: where recording and simulation differ, and what physics was left out.

use super::files::{Force, check, make_folder};
use super::library_url::{open_or_create, open_whole};
use super::progress::Stages;
use super::{OrInput, Stop, println_stderr, println_stdout};
use crate::pipeline;
use crate::pipeline::diagnose::{DiagnosingError, Setting, diagnose};
use crate::pipeline::provenance;
use anyhow::Context;
use clap::Args;
use clap::builder::PossibleValuesParser;
use std::path::PathBuf;
use tracktwin_diagnosis::{Verdict, check_track};
use tracktwin_experiment::CODE_VERSION;
use tracktwin_files::{FileName, Kind, Output};
use tracktwin_library::{Library, without_password};
use tracktwin_parameters::TrackDesign;
use tracktwin_report::Origin;
use tracktwin_signal::recording::Recording;
use tracktwin_surrogate::Trained;
use tracktwin_track::extension;

/// What `diagnose` is told.
#[derive(Args)]
#[command(
    after_help = "Exit codes: 0 nothing is left out, 1 something is, 2 wrong input, 3 failure."
)]
pub(super) struct Arguments {
    /// The recording: a folder with `recording.json` and a file a pass.
    recording: PathBuf,
    /// Folder of the models, as `train` or `run` wrote it: their campaign says what track it is.
    #[arg(long, value_name = "DIR", requires = "library")]
    models: Option<PathBuf>,
    /// The library that keeps null simulations and diagnoses, made if it is not there:
    /// sqlite:PATH or postgres://...
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Folder for diagnosis.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Leave a kind of physics out of the catalogue, to see what else explains the recording; may
    /// be given several times.
    #[arg(long, value_name = "PHYSICS", value_parser = PossibleValuesParser::new(names()))]
    without: Vec<String>,
}

/// Names of the catalogue.
fn names() -> impl Iterator<Item = &'static str> {
    extension::Kind::all().map(|kind| kind.physics)
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let origin = origin(&arguments);
    let Arguments { recording, models, library, out, force, without } = arguments;
    let recording = Recording::open(&recording).or_input()?;
    check(&out, Kind::Results, force, &["report.html", "diagnosis.json"])?;
    recording.doubts.iter().for_each(|doubt| println_stderr(doubt));
    let library = match library {
        // Models belong to a library that is there already.
        Some(url) if models.is_some() => Some(open_whole(&url).await?),
        Some(url) => Some(open_or_create(&url).await?),
        None => None,
    };
    let design = design(models, library.as_ref()).await?;
    check_track(&recording, &design).or_input()?;
    make_folder(&out)?;
    let shown = Stages::default();
    let setting =
        Setting { design: &design, library: library.as_ref(), without: &without, shuffle: None };
    let diagnosed = diagnose(&recording, setting, &|stage, share| shown.at(stage, share)).await;
    shown.end();
    let mut diagnosis = diagnosed.map_err(stop)?.diagnosis;
    diagnosis.notes.splice(..0, recording.doubts.iter().cloned());
    let json = serde_json::to_string_pretty(&diagnosis).context("a diagnosis is plain JSON")?;
    let page = tracktwin_report::diagnosis_page(&diagnosis, &origin);
    let mut output = Output::begin(&out, Kind::Results, force.force)?;
    output.add(&FileName::new("report.html")?, page.as_bytes())?;
    output.add(&FileName::new("diagnosis.json")?, json.as_bytes())?;
    output.commit()?;
    if let Some(library) = &library {
        let record = provenance::diagnosis(&diagnosis, json);
        if let Err(error) = library.record_diagnosis(record).await {
            // The answer stands in the folder all the same.
            tracing::warn!("the library does not keep this diagnosis: {error:?}");
        }
    }
    println_stdout(&diagnosis.sentence);
    println_stdout(&format!("report: {}", out.join("report.html").display()));
    match diagnosis.verdict {
        Verdict::Consistent => Ok(()),
        _ => Err(Stop::Negative),
    }
}

/// What a recording lacks is mended by its owner; all else is ours.
fn stop(error: DiagnosingError) -> Stop {
    match error {
        DiagnosingError::Recording(error) => Stop::Input(error.into()),
        failed => Stop::Failure(failed.into()),
    }
}

/// How the diagnosis is repeated.
fn origin(arguments: &Arguments) -> Origin {
    let Arguments { recording, models, library, out, without, .. } = arguments;
    let mut command = vec![format!("tracktwin diagnose {}", recording.display())];
    command.extend(models.as_ref().map(|models| format!("--models {}", models.display())));
    let library = library.as_deref().map(without_password);
    command.extend(library.as_ref().map(|library| format!("--library {library}")));
    command.extend(without.iter().map(|physics| format!("--without {physics}")));
    command.push(format!("--out {}", out.display()));
    Origin {
        command: command.join(" "),
        version: format!("tracktwin {CODE_VERSION}"),
        library: library.unwrap_or_default(),
    }
}

/// The track that the models' campaign was simulated on; V-Track without models.
async fn design(models: Option<PathBuf>, library: Option<&Library>) -> Result<TrackDesign, Stop> {
    let (Some(models), Some(library)) = (models, library) else {
        return Ok(TrackDesign::v_track());
    };
    let models = Trained::load(&models).or_input()?;
    let campaign = library
        .campaign(models.campaign())
        .await
        .context("the models belong to another library; train on this one")
        .or_input()?;
    Ok(pipeline::train::experiment(&campaign).or_input()?.design)
}
