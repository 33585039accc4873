//! `tracktwin diagnose`: where recording and simulation differ, and what physics was left out.

use super::progress::Progress;
use super::{OrInput, Stop, say};
use crate::{null_campaign, provenance};
use anyhow::Context;
use clap::Args;
use nalgebra::DVector;
use std::path::PathBuf;
use std::sync::Mutex;
use tracktwin_diagnosis::{
    Candidate, Diagnosis, Evidence, NullModel, Search, Stage, Subject, Verdict, first_calibration,
    first_look, search,
};
use tracktwin_library::Library;
use tracktwin_parameters::TrackDesign;
use tracktwin_report::Origin;
use tracktwin_signal::recording::Recording;
use tracktwin_surrogate::Trained;
use tracktwin_worker::{CODE_VERSION, Experiment};

/// Steps of a stage's progress bar.
const STEPS: u64 = 100;

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
    /// The library that keeps null simulations and diagnoses: sqlite:PATH or postgres://...
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY")]
    library: Option<String>,
    /// Folder for diagnosis.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let origin = origin(&arguments);
    let Arguments { recording, models, library, out } = arguments;
    let recording = Recording::open(&recording).or_input()?;
    let library = match library {
        Some(url) => Some(Library::open(&url).await.or_input()?),
        None => None,
    };
    let design = design(models, library.as_ref()).await?;
    std::fs::create_dir_all(&out)
        .with_context(|| format!("{}: the folder cannot be made", out.display()))
        .or_input()?;
    let diagnosis = diagnose(recording, &design, library.as_ref()).await?;
    let json = serde_json::to_string_pretty(&diagnosis).context("a diagnosis is plain JSON")?;
    std::fs::write(out.join("diagnosis.json"), &json)?;
    let page = tracktwin_report::diagnosis_page(&diagnosis, &origin);
    std::fs::write(out.join("report.html"), page)?;
    if let Some(library) = &library {
        let record = provenance::diagnosis(&diagnosis, json)?;
        if let Err(error) = library.record_diagnosis(record).await {
            // The answer stands in the folder all the same.
            tracing::warn!("the library does not keep this diagnosis: {error:?}");
        }
    }
    say(&diagnosis.sentence);
    say(&format!("report: {}", out.join("report.html").display()));
    match diagnosis.verdict {
        Verdict::Consistent => Ok(()),
        _ => Err(Stop::Negative),
    }
}

/// How the diagnosis is repeated.
fn origin(arguments: &Arguments) -> Origin {
    let Arguments { recording, models, library, out } = arguments;
    let mut command = vec![format!("tracktwin diagnose {}", recording.display())];
    command.extend(models.as_ref().map(|models| format!("--models {}", models.display())));
    command.extend(library.as_ref().map(|library| format!("--library {library}")));
    command.push(format!("--out {}", out.display()));
    Origin {
        command: command.join(" "),
        version: format!("tracktwin {CODE_VERSION}"),
        library: library.clone().unwrap_or_default(),
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
    Ok(Experiment::from_json(&campaign.experiment_json).or_input()?.design)
}

/// Diagnoses a recording; null simulations are kept in the library if there is one.
async fn diagnose(
    recording: Recording,
    design: &TrackDesign,
    library: Option<&Library>,
) -> Result<Diagnosis, Stop> {
    let mut subject = Subject::new(&recording, design).or_input()?;
    let look = stage("first look", || first_look(&recording));
    let suggested = subject.suggested(&look);
    let start = stage("baseline", || first_calibration(&subject)).context("no baseline fits")?;
    let null = null_model(&subject, &start, library).await?;
    let found = searched(&subject, &null, start, &suggested)?;
    let evidence =
        Evidence { recording: &recording, subject: &subject, look: &look, search: &found };
    Ok(evidence.conclude().context("no conclusion can be drawn")?)
}

/// The null model, with its progress shown.
async fn null_model(
    subject: &Subject,
    start: &DVector<f64>,
    library: Option<&Library>,
) -> Result<NullModel, Stop> {
    let surfaces = u64::from(null_campaign::SURFACES);
    let shown = Mutex::new(Progress::begin("null model", 0, surfaces));
    let null = null_campaign::of(subject, start, library, |done| {
        shown.lock().expect("nobody panics while holding it").at(done, "");
    });
    let null = null.await?;
    shown.into_inner().expect("nobody panics while holding it").end();
    Ok(null)
}

/// The search, with its progress shown.
fn searched(
    subject: &Subject,
    null: &NullModel,
    start: DVector<f64>,
    suggested: &[Candidate],
) -> Result<Search, Stop> {
    let shown = Mutex::new(None::<(Stage, Progress)>);
    let progress = |stage, share| {
        show(&mut shown.lock().expect("nobody panics while holding it"), stage, share);
    };
    let found = tokio::task::block_in_place(|| search(subject, null, start, suggested, &progress));
    if let Some((_, progress)) = shown.into_inner().expect("nobody panics while holding it") {
        progress.end();
    }
    Ok(found.context("the search for left-out physics broke down")?)
}

/// Runs a stage without steps of its own.
fn stage<T>(name: &'static str, work: impl FnOnce() -> T) -> T {
    let progress = Progress::begin(name, 0, 1);
    let done = work();
    progress.end();
    done
}

fn show(shown: &mut Option<(Stage, Progress)>, stage: Stage, share: f64) {
    if shown.as_ref().is_none_or(|(known, _)| *known != stage) {
        if let Some((_, progress)) = shown.take() {
            progress.end();
        }
        let name = match stage {
            Stage::Baseline => "baseline",
            Stage::Screening => "screening",
            Stage::Refinement => "refinement",
            Stage::HeldOut => "held out",
        };
        *shown = Some((stage, Progress::begin(name, 0, STEPS)));
    }
    if let Some((_, progress)) = shown {
        progress.at((share * STEPS as f64) as u64, "");
    }
}
