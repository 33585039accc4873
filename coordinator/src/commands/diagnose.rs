//! `tracktwin diagnose`: differences between recording and model, and their causes.

use super::files::{Force, check, make_folder};
use super::library_url::{open_or_create, open_whole};
use super::progress::SectionStages;
use super::recording::RecordingArgument;
use super::shell::{quoted, quoted_path};
use super::track::TrackOption;
use super::{OrInput, Stop, evaluate, print_json, println_stderr, println_stdout};
use crate::pipeline;
use crate::pipeline::diagnose::Setting;
use crate::pipeline::diagnose_sections::{
    At, DIAGNOSIS, PAGE, SectionOutput, SectionsError, add_to, diagnose_sections,
};
use crate::pipeline::evaluate::{design_for, no_campaign};
use crate::pipeline::provenance;
use clap::Args;
use clap::builder::PossibleValuesParser;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tracktwin_diagnosis::{Confirmation, ConfirmedSpeed, Diagnosis, Verdict, check_track};
use tracktwin_experiment::CODE_VERSION;
use tracktwin_files::{Kind, Output};
use tracktwin_library::{Library, without_password};
use tracktwin_parameters::{Track, TrackDesign};
use tracktwin_report::Origin;
use tracktwin_signal::recording::Recording;
use tracktwin_surrogate::Trained;
use tracktwin_track::extension;

/// Arguments of `diagnose`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin diagnose ride --library sqlite:null.sqlite --out diagnosis

Without --models the recording is compared with the track of --track, or with the one that
recording.json states under `nominal`. With --library, null simulations are stored and used again.

A recording of more than 48 sleepers is diagnosed in overlapping sections of 30, each with its
own page in DIR/sections. The same command continues an interrupted diagnosis.

Next: `tracktwin extend CAMPAIGN.toml --from diagnosis/diagnosis.json`

Exit codes: 0 consistent, 1 left-out physics or a measuring-chain fault was found, 2 wrong input,
3 failure.")]
pub(super) struct Arguments {
    #[command(flatten)]
    recording: RecordingArgument,
    /// Folder of trained models, written by `train` or `run`; their campaign defines the track.
    #[arg(long, value_name = "DIR", requires = "library", conflicts_with = "track")]
    models: Option<PathBuf>,
    /// Library that stores null simulations and diagnoses, created if missing: sqlite:PATH or
    /// postgres://...
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Output folder for diagnosis.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    track: TrackOption,
    #[command(flatten)]
    force: Force,
    /// Withhold the last pass of each speed that has two or more passes; compare these passes with time-domain
    /// simulations without and with the physics found.
    #[arg(long)]
    confirm: bool,
    /// Leave this kind of physics out of the catalogue; may be repeated.
    #[arg(long, value_name = "PHYSICS", value_parser = PossibleValuesParser::new(names()))]
    without: Vec<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Arguments {
    /// A diagnosis of a recording, with a library for null simulations.
    pub(super) fn of(
        recording: &RecordingArgument,
        library: &str,
        out: &Path,
        track: &TrackOption,
        force: Force,
        confirm: bool,
    ) -> Self {
        Self {
            recording: recording.clone(),
            models: None,
            library: Some(library.to_owned()),
            out: out.to_owned(),
            track: track.clone(),
            force,
            confirm,
            without: Vec::new(),
            json: false,
        }
    }
}

/// Names of the catalogue.
fn names() -> impl Iterator<Item = &'static str> {
    extension::Kind::all().map(|kind| kind.physics)
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let origin = origin(&arguments);
    let Arguments { recording, models, library, track, out, force, confirm, without, json } =
        arguments;
    let recording = recording.open().or_input()?;
    check(&out, Kind::Results, force, &[PAGE, DIAGNOSIS])?;
    recording.doubts.iter().for_each(|doubt| println_stderr(doubt));
    let library = match library {
        // The library of models must exist.
        Some(url) if models.is_some() => Some(open_whole(&url).await?),
        Some(url) => Some(open_or_create(&url).await?),
        None => None,
    };
    let (track, mut assumed) = match of_models(models, library.as_ref(), &recording).await? {
        Some(track) => (track, Vec::new()),
        None => track.of(&recording)?,
    };
    assumed.extend(uncalibrated(&track));
    for note in &assumed {
        println_stderr(note);
    }
    check_track(&recording, &track.design).or_input()?;
    make_folder(&out)?;
    let setting =
        Setting { track: &track, library: library.as_ref(), without: &without, shuffle: None };
    let page = |section: &Diagnosis| tracktwin_report::diagnosis_page(section, &origin);
    let output = SectionOutput { folder: &out, force: force.force, page: &page };
    let shown = SectionStages::default();
    let watch = |at: At<'_>| shown.at(at);
    let diagnosed = diagnose_sections(&recording, setting, confirm, &output, &watch).await;
    shown.end();
    let mut diagnosis = diagnosed.map_err(stop)?;
    diagnosis.notes.splice(..0, recording.doubts.iter().cloned().chain(assumed));
    write(&diagnosis, &origin, &out, force, library.as_ref()).await?;
    let report = out.join("report.html").display().to_string();
    if json {
        print_json(&summary(&diagnosis, &report));
    } else {
        println_stdout(&diagnosis.sentence);
        if confirm {
            println_stdout(&confirmed(diagnosis.confirmation.as_ref()));
        }
        println_stdout(&format!("report: {report}"));
    }
    match diagnosis.verdict {
        Verdict::Consistent => Ok(()),
        _ => Err(Stop::Negative),
    }
}

/// Writes the document and the page, and stores the document in the library.
async fn write(
    diagnosis: &Diagnosis,
    origin: &Origin,
    out: &Path,
    force: Force,
    library: Option<&Library>,
) -> Result<(), Stop> {
    let page = tracktwin_report::diagnosis_page(diagnosis, origin);
    let mut output = Output::begin(out, Kind::Results, force.force)?;
    let document = add_to(&mut output, diagnosis, &page)?;
    output.commit()?;
    if let Some(library) = library {
        let record = provenance::diagnosis(diagnosis, document);
        if let Err(error) = library.record_diagnosis(record).await {
            // The diagnosis in the folder is complete nevertheless.
            tracing::warn!(
                error = &error as &dyn std::error::Error,
                "the files are complete, but the diagnosis cannot be stored in the library"
            );
        }
    }
    Ok(())
}

/// JSON with the verdict, the accepted hypotheses, and the path of the report.
fn summary(diagnosis: &Diagnosis, report: &str) -> Value {
    let accepted = diagnosis.hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
    json!({
        "recording": diagnosis.recording, "verdict": diagnosis.verdict,
        "sentence": diagnosis.sentence, "nothing_left_out": diagnosis.nothing_left_out,
        "accepted": accepted.collect::<Vec<_>>(), "confirmation": diagnosis.confirmation,
        "report": report,
    })
}

/// Text on the comparison with the withheld passes.
fn confirmed(confirmation: Option<&Confirmation>) -> String {
    let Some(Confirmation { speeds, gain_nats, is_confirmed, .. }) = confirmation else {
        return "Withheld passes were not compared: nothing was accepted, or a wheel defect or a fault of the measuring chain."
            .to_owned();
    };
    let of_speed = |speed: &ConfirmedSpeed| {
        let ConfirmedSpeed { speed_km_h, before_db, after_db } = speed;
        format!("{before_db:.1} dB before and {after_db:.1} dB after at {speed_km_h:.0} km/h")
    };
    let speeds: Vec<String> = speeds.iter().map(of_speed).collect();
    let verb = if *is_confirmed { "confirm" } else { "do not confirm" };
    format!(
        "Withheld passes {verb} it: simulations in time differ from them by {} ({gain_nats:.0} nats).",
        speeds.join(", ")
    )
}

/// Converts an error: an unsuitable recording is wrong input, everything else is a failure.
fn stop(error: SectionsError) -> Stop {
    if error.is_wrong_input() { Stop::Input(error.into()) } else { Stop::Failure(error.into()) }
}

/// Provenance of the diagnosis, with the command that repeats it.
fn origin(arguments: &Arguments) -> Origin {
    let Arguments { recording, models, library, track, out, confirm, without, .. } = arguments;
    let mut command = vec![format!("tracktwin diagnose {}", recording.typed())];
    command.extend(models.as_ref().map(|models| format!("--models {}", quoted_path(models))));
    let track = track.track.as_ref();
    command.extend(track.map(|file| format!("--track {}", quoted_path(file))));
    let library = library.as_deref().map(without_password);
    command.extend(library.as_ref().map(|library| format!("--library {}", quoted(library))));
    command.extend(without.iter().map(|physics| format!("--without {physics}")));
    command.extend(confirm.then(|| "--confirm".to_owned()));
    command.push(format!("--out {}", quoted_path(out)));
    Origin {
        command: command.join(" "),
        version: format!("tracktwin {CODE_VERSION}"),
        library: library.unwrap_or_default(),
    }
}

/// Note for a track other than V-Track, for which the diagnosis was not calibrated.
fn uncalibrated(track: &Track) -> Option<String> {
    (track.design != TrackDesign::v_track()).then(|| {
        "the error rates of diagnoses are measured on V-Track only: on any other track the \
         probabilities are not calibrated, so check a finding on site"
            .to_owned()
    })
}

/// Track of the models' campaign that is most similar to that of the recording; `None` without models.
async fn of_models(
    models: Option<PathBuf>,
    library: Option<&Library>,
    recording: &Recording,
) -> Result<Option<Track>, Stop> {
    let (Some(models), Some(library)) = (models, library) else {
        return Ok(None);
    };
    let models = Trained::load(&models).or_input()?;
    let campaign = library.campaign(models.campaign()).await.map_err(no_campaign);
    let campaign = campaign.map_err(evaluate::stop)?;
    let experiment = pipeline::train::experiment(&campaign).or_input()?;
    Ok(Some(Track::of(design_for(&experiment, recording))))
}
