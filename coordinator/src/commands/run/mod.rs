//! `tracktwin run`: simulates a campaign, trains models and evaluates a recording.

mod room;
mod sample;

use super::accepted::diagnosis_of;
use super::campaign::add_cases;
use super::files::{Force, make_folder};
use super::library_url::open_or_create;
use super::numbers::{cores, count};
use super::progress::{Progress, TrainingBar};
use super::recording::{self, Channel, RecordingArgument};
use super::signals::stop_on_signal;
use super::track::{preset_parser, read};
use super::{OrInput, Stop, continuity, evaluate, print_json, println_stderr, println_stdout};
use crate::commands::contact::contact_sentence;
use crate::pipeline::evaluate::design_for;
use crate::pipeline::lack::check_for_training;
use crate::pipeline::models;
use crate::pipeline::train::features_hz;
use anyhow::anyhow;
use clap::Args;
use sample::Sample;
use serde_json::{Value, json};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use tracktwin_evaluation::{Evaluation, check_recording};
use tracktwin_farm::campaign::{Campaign, DEFAULT};
use tracktwin_farm::embedded::Task;
use tracktwin_library::{Library, Status};
use tracktwin_parameters::quantity::CASES;
use tracktwin_parameters::{Preset, Track};
use tracktwin_signal::SAMPLES_A_PERIOD;
use tracktwin_signal::recording::Recording;

/// Name of the models' folder inside the output folder.
const MODELS: &str = "models";

/// Arguments of `run`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tracktwin run --out out
  tracktwin run --preset 60E1-concrete --out line
  tracktwin run mine.toml --cases 1000 --out mine

In the output folder: library.sqlite, models/, sample/ (a bundled recording), report.html and the
files of `tracktwin evaluate`. Repeat the command to continue an interrupted run.

Next: `tracktwin evaluate RIDE --models out/models --library sqlite:out/library.sqlite --out DIR`

Exit codes: 0 done, 1 done, but the estimates of most sleepers are not valid, 2 wrong input,
3 failure or interruption.")]
pub(super) struct Arguments {
    /// Campaign file (TOML) [default: a small campaign over the paper's Table D1].
    campaign: Option<PathBuf>,
    /// Preset whose track the built-in campaign is of.
    #[arg(long, value_name = "NAME", value_parser = preset_parser(), conflicts_with_all = ["campaign", "track"])]
    preset: Option<Preset>,
    /// Description of track and vehicle, as `tracktwin new` writes it, that the built-in campaign is of.
    #[arg(long, value_name = "FILE", conflicts_with = "campaign")]
    track: Option<PathBuf>,
    /// Number of cases; overrides the number in the campaign file; at least 200, unless --no-train
    /// is given.
    #[arg(long, value_name = "N", value_parser = count::<u32>(CASES))]
    cases: Option<u32>,
    /// Library for the results: `sqlite:PATH` or `postgres://USER@HOST/DATABASE`; a campaign that
    /// it holds in part is continued [default: sqlite:OUT/library.sqlite].
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Output folder for models and report.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Simulate only; do not train models.
    #[arg(long)]
    no_train: bool,
    /// Recording to evaluate [default: a bundled sample, of V-Track or of 60E1-concrete].
    #[arg(long, value_name = "DIR", conflicts_with = "no_train")]
    recording: Option<PathBuf>,
    #[command(flatten)]
    channel: Channel,
    /// Number of cores for the simulation [default: all].
    #[arg(long, value_name = "N", value_parser = cores)]
    cores: Option<NonZeroUsize>,
    /// Print the built-in campaign file, as a template, and exit.
    #[arg(long)]
    print_campaign: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Diagnosis of the recording, whose accepted physics is part of the inversion's model.
    #[arg(skip)]
    diagnosis: Option<PathBuf>,
}

impl Arguments {
    /// Arguments for a campaign file whose models evaluate a recording, beside an inversion with what a
    /// diagnosis accepted.
    pub(super) fn of(
        campaign: PathBuf,
        recording: &RecordingArgument,
        library: &str,
        out: PathBuf,
        cores: Option<NonZeroUsize>,
        force: Force,
        diagnosis: Option<PathBuf>,
    ) -> Self {
        Self {
            campaign: Some(campaign),
            preset: None,
            track: None,
            cases: None,
            library: Some(library.to_owned()),
            out,
            force,
            no_train: false,
            recording: Some(recording.folder().to_owned()),
            channel: recording.channel().clone(),
            cores,
            print_campaign: false,
            json: false,
            diagnosis,
        }
    }

    /// The track that replaces V-Track; `None` if no track is given.
    fn track(&self) -> Result<Option<Track>, Stop> {
        match (&self.track, self.preset) {
            (Some(path), _) => read(path).map(Some),
            (None, preset) => Ok(preset.map(Preset::track)),
        }
    }
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    if arguments.print_campaign {
        println_stdout(DEFAULT.trim_end());
        return Ok(());
    }
    let campaign = match &arguments.campaign {
        Some(path) => Campaign::read(path, arguments.cases),
        None => match arguments.track()? {
            Some(track) => Campaign::built_in_on(&track, arguments.cases),
            None => Campaign::built_in(arguments.cases),
        },
    }
    .or_input()?;
    // Check the recording before the simulation.
    let given = arguments.recording.as_deref();
    let given = given.map(|folder| recording::open(folder, &arguments.channel)).transpose()?;
    if let Some(recording) = &given {
        check(recording, &campaign).or_input()?;
    }
    let trains = !arguments.no_train;
    if trains {
        let lack = check_for_training(&campaign);
        lack.map_err(|lack| anyhow!("{lack}, or `--no-train` to simulate only")).or_input()?;
    }
    let out = &arguments.out;
    if trains {
        models::check_files(&out.join(MODELS), arguments.force.force)?;
        let sample = Sample::nearest(&campaign.definition.experiment.design);
        sample.check_files(&out.join("sample"), arguments.force)?;
        evaluate::check_files(out, arguments.force)?;
    }
    make_folder(out)?;
    if trains {
        make_folder(&out.join(MODELS))?;
    }
    let recording = match given {
        None if trains => sample_for(&campaign, out, arguments.force)?,
        given => given,
    };
    let highest_hz = recording.as_ref().filter(|_| trains).map(|it| highest_hz(it, &campaign));
    let highest_hz = highest_hz.transpose().or_input()?;
    let url = arguments.library.clone().unwrap_or_else(|| default_library(out));
    let library = open_or_create(&url).await?;
    let made = chain(&library, &campaign, recording, highest_hz, &arguments).await;
    let name = library.name();
    // Closing leaves the library in one file, which can be copied.
    library.close().await;
    made?.conclude(&name, &arguments)
}

/// Results of a run in addition to the library: none, models, or models and an evaluation.
#[derive(Default)]
struct Made {
    models: Option<PathBuf>,
    evaluation: Option<Evaluation>,
}

impl Made {
    /// Prints the results. Returns a negative result if the estimates of most sleepers are not valid.
    fn conclude(&self, library: &str, Arguments { out, json, .. }: &Arguments) -> Result<(), Stop> {
        if *json {
            print_json(&self.json(library, out));
        } else {
            println_stdout(&self.line(library, out));
            self.evaluation.iter().for_each(evaluate::print_outside);
        }
        self.evaluation.as_ref().map_or(Ok(()), evaluate::conclude)
    }

    fn line(&self, library: &str, out: &Path) -> String {
        match (&self.models, &self.evaluation) {
            (None, _) => format!("library: {library}"),
            (Some(models), None) => format!(
                "models: {}; evaluate a recording with `tracktwin evaluate`",
                models.display()
            ),
            (Some(_), Some(_)) => format!("report: {}", evaluate::report(out)),
        }
    }

    fn json(&self, library: &str, out: &Path) -> Value {
        let models = self.models.as_ref().map(|models| models.display().to_string());
        let evaluation = self.evaluation.as_ref().map(|made| evaluate::summary(made, out));
        json!({ "library": library, "models": models, "evaluation": evaluation })
    }
}

/// Simulates, trains and evaluates.
async fn chain(
    library: &Library,
    campaign: &Campaign,
    recording: Option<Recording>,
    highest_hz: Option<f64>,
    arguments: &Arguments,
) -> Result<Made, Stop> {
    simulate(library, campaign, arguments.cores.unwrap_or_else(all_cores)).await?;
    if arguments.no_train {
        return Ok(Made::default());
    }
    let Arguments { out, force, .. } = arguments;
    let record = library.campaign(&campaign.id()).await?;
    let folder = out.join(MODELS);
    let bar = TrainingBar::default();
    let watch = |at: tracktwin_surrogate::Progress<'_>| bar.at(&at);
    let force_models = force.force;
    let trained =
        models::train_into(&folder, force_models, library, &record, 0, highest_hz, &watch).await?;
    bar.end();
    let evaluation = match recording {
        Some(it) => {
            let path = arguments.diagnosis.as_deref();
            let found = path.map(|path| diagnosis_of(&it, path)).transpose()?;
            let found = found.as_ref();
            Some(evaluate::evaluate(&it, library, trained, out, *force, true, found).await?)
        }
        None => None,
    };
    Ok(Made { models: Some(folder), evaluation })
}

/// The bundled recording nearest to the campaign's track, if models of the campaign can evaluate it;
/// otherwise a line states that nothing will be evaluated.
fn sample_for(campaign: &Campaign, out: &Path, force: Force) -> Result<Option<Recording>, Stop> {
    let sample = Sample::nearest(&campaign.definition.experiment.design);
    let recording = sample.open(&out.join("sample"), force)?;
    match check(&recording, campaign) {
        Ok(()) => Ok(Some(recording)),
        Err(other) => {
            println_stderr(&format!(
                "models will be trained, but the sample recording will not be evaluated: it is of \
                     another kind ({other}); `--recording DIR` evaluates one of your own"
            ));
            Ok(None)
        }
    }
}

/// The highest frequency in Hz that the sample rate of a recording leaves to models, if the campaign has features
/// below it. A line states it if features of the campaign lie above it.
fn highest_hz(recording: &Recording, campaign: &Campaign) -> Result<f64, anyhow::Error> {
    let highest_hz = (recording.sample_rate_hz / SAMPLES_A_PERIOD).floor();
    let experiment = &campaign.definition.experiment;
    if features_hz(experiment, Some(highest_hz)).is_empty() {
        return Err(anyhow!(
            "the recording has a sample rate of {} Hz, which suffices for features up to {highest_hz} Hz, but the \
             campaign has none there; record at a higher rate",
            recording.sample_rate_hz
        ));
    }
    let usual_hz = features_hz(experiment, None).last().copied();
    if usual_hz.is_some_and(|usual_hz| highest_hz < usual_hz) {
        println_stderr(&format!(
            "the recording has a sample rate of {} Hz: models use features up to {highest_hz} Hz",
            recording.sample_rate_hz
        ));
    }
    Ok(highest_hz)
}

/// Whether models of the campaign can evaluate the recording.
pub(super) fn check(
    recording: &Recording,
    campaign: &Campaign,
) -> Result<(), tracktwin_evaluation::Error> {
    let experiment = &campaign.definition.experiment;
    check_recording(recording, &design_for(experiment, recording), &experiment.speeds_km_h)
}

pub(super) fn default_library(out: &Path) -> String {
    format!("sqlite:{}", out.join("library.sqlite").display())
}

fn all_cores() -> NonZeroUsize {
    std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN)
}

/// Simulates the missing cases of a campaign; Ctrl-C interrupts it, and a later run continues it.
async fn simulate(library: &Library, campaign: &Campaign, cores: NonZeroUsize) -> Result<(), Stop> {
    continuity::check(library, campaign, println_stderr).await?;
    // A rejected campaign adds nothing to the library.
    let claim = tracktwin_farm::embedded::claim(library).await?;
    room::check(library, campaign).await?;
    tracktwin_farm::campaign::insert_campaign(library, campaign).await?;
    let id = campaign.id();
    let shutdown = stop_on_signal("stopping: cases in progress are returned to the library")?;
    let _nothing_left_to_wind_up = shutdown.clone().drop_guard();
    add_cases(library, campaign, &shutdown).await?;
    let stopped = shutdown.clone();
    let mut progress = None::<Progress>;
    let task = Task::new(&id, campaign.cases, cores);
    let status =
        tracktwin_farm::embedded::run_claimed(library, &claim, task, shutdown, |status: Status| {
            let (done, total) = (u64::from(status.done()), u64::from(status.total()));
            let bar = progress.get_or_insert_with(|| Progress::begin("simulating", done, total));
            let remark = match status.failed {
                0 => String::new(),
                failed => format!("({failed} given up)"),
            };
            bar.at(done, &remark);
        })
        .await?;
    progress.into_iter().for_each(Progress::end);
    if stopped.is_cancelled() || status.done() < status.total() {
        let left = status.total() - status.done();
        return Err(
            anyhow!("interrupted with {left} cases left; repeat the command to continue").into()
        );
    }
    println_stderr(&contact_sentence(library.contact_loss(&id).await?, status.finished));
    if status.failed > 0 {
        println_stderr(&format!(
            "{} cases were given up (reasons: `tracktwin library status`); continuing without them",
            status.failed
        ));
    }
    Ok(())
}
