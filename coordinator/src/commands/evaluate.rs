//! `tracktwin evaluate`: estimates of the track parameters from a recording.

use super::accepted::{diagnosis_of, with_physics};
use super::files::{Force, check, make_folder};
use super::library_url::{open_or_create, open_whole};
use super::models::load_models;
use super::progress::Stages;
use super::recording::{RecordingArgument, open, usable_with_notes};
use super::track::TrackOption;
use super::{OrInput, Stop, print_json, println_stderr, println_stdout};
use crate::pipeline::compute::compute;
use crate::pipeline::evaluate::{Evaluator, EvaluatorError};
use crate::pipeline::invert::{InvertingError, shown};
use crate::pipeline::{self, provenance};
use anyhow::Context;
use clap::Args;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tracktwin_diagnosis::{Diagnosis, check_track};
use tracktwin_evaluation::{Evaluation, Flag, check_recording};
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_inspection::chain::LossOfContact;
use tracktwin_inspection::inspect;
use tracktwin_inversion::Inversion;
use tracktwin_library::{Library, without_password};
use tracktwin_parameters::Track;
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, FeatureDefinition};
use tracktwin_surrogate::Trained;

/// Names of the page and of the file with its charts along the track.
const PAGE: &str = "report.html";
const PICTURE: &str = "track.svg";

/// Method of estimation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Method {
    /// Gaussian processes and model selector, trained on a library; requires --models.
    Gp,
    /// Fit of the track model to all passes and speeds, with separate stiffnesses for every
    /// sleeper.
    Inversion,
}

/// Arguments of `evaluate`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tracktwin evaluate ride --out result
  tracktwin evaluate ride --models out/models --library sqlite:out/library.sqlite --out result

Without --models the recording is evaluated by inversion, which needs no library and accepts any
track and speed. With --models it is evaluated by Gaussian processes, and the
page also shows the inversion; --method selects one of the two.

Exit codes: 0 done, 1 done, but the estimates of most sleepers are not valid (see the last lines of
the output), 2 wrong input, 3 failure.")]
pub(super) struct Arguments {
    #[command(flatten)]
    recording: RecordingArgument,
    /// Method [default: inversion; both with --models].
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Folder of trained models, written by `train` or `run`; requires --library.
    #[arg(
        long,
        value_name = "DIR",
        requires = "library",
        required_if_eq("method", "gp"),
        conflicts_with = "track"
    )]
    models: Option<PathBuf>,
    /// Library of the models: `sqlite:PATH` or `postgres://USER@HOST/DATABASE`. Without --models it
    /// stores the null simulations of the inversion, which a later evaluation of a similar track then
    /// reads, and the fitted sections, so that an interrupted evaluation continues; it is created if
    /// missing.
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Output folder for evaluation.json, evaluation.csv, report.html and track.svg (the charts along
    /// the track); with both methods also inversion.json and inversion.csv.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    track: TrackOption,
    /// Diagnosis of this recording (diagnosis.json, or its folder): the physics that it accepted becomes part of the track
    /// model of the inversion.
    #[arg(long, value_name = "FILE", conflicts_with = "models")]
    from: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let Arguments { recording, method, models, library, track, from, out, force, json } = arguments;
    // Read the recording first: it is the most frequent cause of errors and the quickest to check.
    let recording = open(recording.folder(), recording.channel())?;
    check_files(&out, force)?;
    let (Some(models), Some(library)) =
        (models.filter(|_| method != Some(Method::Inversion)), library.as_deref())
    else {
        let library = match library {
            Some(url) => Some(open_or_create(&url).await?),
            None => None,
        };
        let diagnosis = from.map(|from| diagnosis_of(&recording, &from)).transpose()?;
        let setting = Setting { diagnosis: diagnosis.as_ref(), library: library.as_ref() };
        return by_inversion(&recording, &track, setting, &out, force, json).await;
    };
    let library = open_whole(library).await?;
    let models = load_models(&models)?;
    let beside = method.is_none();
    let evaluation = evaluate(&recording, &library, models, &out, force, beside, None).await?;
    if json {
        print_json(&summary(&evaluation, &out));
    } else {
        let sleepers = evaluation.sleepers.len();
        println_stdout(&format!("{sleepers} sleepers evaluated; report: {}", report(&out)));
        print_outside(&evaluation);
    }
    conclude(&evaluation)
}

/// Path of the report in an output folder.
pub(super) fn report(folder: &Path) -> String {
    folder.join(PAGE).display().to_string()
}

/// What an inversion takes besides the recording and the track.
#[derive(Clone, Copy)]
struct Setting<'a> {
    /// Diagnosis whose accepted physics is part of the model.
    diagnosis: Option<&'a Diagnosis>,
    /// Library that stores null simulations and fitted sections.
    library: Option<&'a Library>,
}

/// Evaluates a recording by inversion only.
async fn by_inversion(
    recording: &Recording,
    track: &TrackOption,
    setting: Setting<'_>,
    folder: &Path,
    force: Force,
    json: bool,
) -> Result<(), Stop> {
    let (recording, mut notes) = usable_with_notes(recording)?;
    let (track, assumed) = track.of(&recording)?;
    for note in &assumed {
        println_stderr(note);
    }
    notes.extend(assumed);
    check_track(&recording, &track.design).or_input()?;
    make_folder(folder)?;
    let mut inversion = invert(&recording, &track, setting).await.map_err(|error| match error {
        InvertingError::Recording(error) => Stop::Input(error.into()),
        failed => Stop::Failure(failed.into()),
    })?;
    notes.extend(setting.diagnosis.map(with_physics));
    let said = inversion.notes.clone();
    inversion.notes.splice(0..0, notes);
    let extractor = Extractor::new(&FeatureDefinition::default()).context("the usual features")?;
    let page = tracktwin_report::inversion_page(&inversion, &recording, &extractor, &command());
    let mut output = Output::begin(folder, Kind::Results, force.force)?;
    output.add(&FileName::new(PAGE)?, page.as_bytes())?;
    let picture = tracktwin_report::inversion_chart(&inversion);
    output.add(&FileName::new(PICTURE)?, picture.as_bytes())?;
    inversion.add_to(&mut output, "evaluation")?;
    output.commit()?;
    if json {
        print_json(&inversion_summary(&inversion, folder));
    } else {
        let (sleepers, report) = (inversion.sleepers.len(), report(folder));
        println_stdout(&format!("{sleepers} sleepers evaluated by inversion; report: {report}"));
        for sentence in &said {
            println_stdout(sentence);
        }
    }
    if inversion.outside_library.is_most() { Err(Stop::Negative) } else { Ok(()) }
}

/// The inversion of a recording, with a progress bar.
async fn invert(
    recording: &Recording,
    track: &Track,
    Setting { diagnosis, library }: Setting<'_>,
) -> Result<Inversion, InvertingError> {
    let stages = Stages::default();
    let watch = |stage, share| stages.at(stage, share);
    let inverted = pipeline::invert::invert(recording, track, diagnosis, library, &watch).await;
    stages.end();
    inverted
}

/// The command line without passwords.
pub(super) fn command() -> String {
    let arguments = std::env::args().skip(1).map(|argument| without_password(&argument));
    std::iter::once("tracktwin".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// Prints the parameters that are outside the library.
pub(super) fn print_outside(evaluation: &Evaluation) {
    for sentence in evaluation.outside_library.sentences() {
        println_stdout(&sentence);
    }
}

/// Returns a negative result if most of the track is outside the library.
pub(super) fn conclude(evaluation: &Evaluation) -> Result<(), Stop> {
    if evaluation.outside_library.is_most() { Err(Stop::Negative) } else { Ok(()) }
}

/// Printed summary of an evaluation, as JSON.
pub(super) fn summary(evaluation: &Evaluation, folder: &Path) -> Value {
    json!({
        "recording": evaluation.recording, "method": evaluation.method,
        "sleepers": evaluation.sleepers.len(), "outside_library": evaluation.outside_library,
        "notes": evaluation.notes, "report": report(folder),
    })
}

/// Printed summary of an inversion, as JSON.
fn inversion_summary(inversion: &Inversion, folder: &Path) -> Value {
    json!({
        "recording": inversion.recording, "method": inversion.method,
        "sleepers": inversion.sleepers.len(), "outside_library": inversion.outside_library,
        "notes": inversion.notes, "report": report(folder),
    })
}

/// Files of an evaluation.
pub(super) const RESULTS: [&str; 6] =
    [PAGE, PICTURE, "evaluation.csv", "evaluation.json", "inversion.csv", "inversion.json"];

/// Checks that an evaluation can be written into a folder.
pub(super) fn check_files(folder: &Path, force: Force) -> Result<(), FilesError> {
    check(folder, Kind::Results, force, &RESULTS)
}

/// Evaluates a recording with models of this library and, if `beside` is set, also by inversion, whose
/// model contains what `diagnosis` accepted. Writes files and report to `folder`.
pub(super) async fn evaluate(
    recording: &Recording,
    library: &Library,
    models: Trained,
    folder: &Path,
    force: Force,
    beside: bool,
    diagnosis: Option<&Diagnosis>,
) -> Result<Evaluation, Stop> {
    let evaluator = Evaluator::new(models, library).await.map_err(stop)?;
    let (recording, notes) = usable_with_notes(recording)?;
    let design = evaluator.design_for(&recording);
    check_recording(&recording, &design, &evaluator.set().speeds_km_h).or_input()?;
    make_folder(folder)?;
    let mut evaluation = by_models(&recording, &evaluator, notes, diagnosis.is_some())?;
    let mut inversion = None;
    if beside {
        let setting = Setting { diagnosis, library: Some(library) };
        inversion = invert_beside(&recording, &evaluator, setting, &mut evaluation).await;
    }
    let page = tracktwin_report::evaluation_page(
        &evaluation,
        inversion.as_ref(),
        &recording,
        &evaluator.extractor,
        &command(),
    );
    write(&page, &evaluation, inversion.as_ref(), folder, force)?;
    keep(library, &evaluation).await;
    Ok(evaluation)
}

/// Evaluation of the usable part of a recording with models. Lines of the mains are subtracted, and passes
/// of another gain or position than others at their speed are left out. `notes` are stated first; what the
/// passes alone show is stated unless the recording was diagnosed.
fn by_models(
    recording: &Recording,
    evaluator: &Evaluator,
    mut notes: Vec<String>,
    diagnosed: bool,
) -> Result<Evaluation, Stop> {
    let inspection = compute(|| inspect(recording));
    let compared = inspection.comparable(&inspection.without_hum(recording));
    let mut evaluation = compute(|| evaluator.evaluate(&compared)).or_input()?;
    let mut said = [evaluator.notes(), evaluation.notes.clone()].concat();
    let outside = evaluation.outside_library.sentences();
    said.retain(|note| !outside.contains(note));
    said.extend(inspection.notes_on_not_compared(recording));
    if !diagnosed {
        said.extend(shown(&inspection));
    }
    for note in &said {
        println_stderr(note);
    }
    notes.extend(said);
    evaluation.notes = [notes, outside].concat();
    if let Some(lost) = &inspection.loss_of_contact {
        flag(&mut evaluation, lost, recording.passes.len());
    }
    Ok(evaluation)
}

/// Inversion in addition to an evaluation with models. If the inversion fails, the evaluation stays valid.
async fn invert_beside(
    recording: &Recording,
    evaluator: &Evaluator,
    setting: Setting<'_>,
    evaluation: &mut Evaluation,
) -> Option<Inversion> {
    match invert(recording, &Track::of(evaluator.design_for(recording)), setting).await {
        Ok(mut inversion) => {
            inversion.notes.splice(0..0, setting.diagnosis.map(with_physics));
            Some(inversion)
        }
        Err(error) => {
            let line = format!("no inversion: {error}");
            println_stderr(&line);
            evaluation.notes.push(line);
            None
        }
    }
}

/// Writes report and files of an evaluation.
fn write(
    page: &str,
    evaluation: &Evaluation,
    inversion: Option<&Inversion>,
    folder: &Path,
    force: Force,
) -> Result<(), FilesError> {
    let mut output = Output::begin(folder, Kind::Results, force.force)?;
    output.add(&FileName::new(PAGE)?, page.as_bytes())?;
    let picture = tracktwin_report::evaluation_chart(evaluation);
    output.add(&FileName::new(PICTURE)?, picture.as_bytes())?;
    evaluation.add_to(&mut output)?;
    if let Some(inversion) = inversion {
        inversion.add_to(&mut output, "inversion")?;
    }
    output.commit()
}

/// Stores an evaluation in the library.
async fn keep(library: &Library, evaluation: &Evaluation) {
    if let Err(error) = library.record_evaluation(provenance::evaluation(evaluation)).await {
        // The evaluation in the folder is complete, even if the library is read-only.
        tracing::warn!(
            error = &error as &dyn std::error::Error,
            "the files are complete, but the evaluation cannot be stored in the library"
        );
    }
}

/// Reports loss of contact and flags the affected sleepers.
fn flag(evaluation: &mut Evaluation, lost: &LossOfContact, passes: usize) {
    for sleeper in evaluation.sleepers.iter_mut().filter(|it| lost.sleepers.contains(&it.id)) {
        sleeper.flags.push(Flag::LossOfContact);
    }
    let line = format!("loss_of_contact: {}", lost.sentence(passes));
    println_stderr(&line);
    evaluation.notes.push(line);
}

/// An unreadable library is a failure; models that do not fit are wrong input.
pub(super) fn stop(error: EvaluatorError) -> Stop {
    match error {
        EvaluatorError::Library(_) => Stop::Failure(error.into()),
        EvaluatorError::Foreign(_) | EvaluatorError::Features(_) => Stop::Input(error.into()),
    }
}
