//! `tracktwin run`: the whole chain, from a campaign to an evaluated recording.

mod sample;

use super::files::make_folder;
use super::library_url::open_or_create;
use super::progress::Progress;
use super::signals::stop_on_signal;
use super::{OrInput, Stop, evaluate, note, say, train};
use crate::campaign::{Campaign, DEFAULT};
use crate::farm::{self, Task};
use anyhow::anyhow;
use clap::Args;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use tracktwin_evaluation::{Evaluation, check_recording};
use tracktwin_library::{Library, Status};
use tracktwin_signal::recording::Recording;
use tracktwin_surrogate::ENTRIES_MIN;

/// What `run` is told.
#[derive(Args)]
pub(super) struct Arguments {
    /// Campaign file (TOML) [default: a small campaign over the paper's Table D1].
    campaign: Option<PathBuf>,
    /// How many cases, instead of the campaign's own number.
    #[arg(long, value_name = "N")]
    cases: Option<u32>,
    /// Library to fill: `sqlite:PATH` or `postgres://USER@HOST/DATABASE`; one that holds part of the
    /// campaign is gone on with [default: sqlite:OUT/library.sqlite].
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Folder for models and report.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Simulate only.
    #[arg(long)]
    no_train: bool,
    /// Recording to evaluate [default: a bundled sample].
    #[arg(long, value_name = "DIR", conflicts_with = "no_train")]
    recording: Option<PathBuf>,
    /// Cores to simulate on [default: all].
    #[arg(long, value_name = "N")]
    cores: Option<NonZeroUsize>,
    /// Print the built-in campaign file and do nothing: a start for one's own.
    #[arg(long)]
    print_campaign: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    if arguments.print_campaign {
        say(DEFAULT.trim_end());
        return Ok(());
    }
    let campaign = match &arguments.campaign {
        Some(path) => Campaign::read(path, arguments.cases),
        None => Campaign::built_in(arguments.cases),
    }
    .or_input()?;
    // A recording that can't be used should not be found out after the simulation.
    let given = arguments.recording.as_ref().map(Recording::open).transpose().or_input()?;
    if let Some(recording) = &given {
        check(recording, &campaign).or_input()?;
    }
    if !arguments.no_train && (campaign.cases as usize) < ENTRIES_MIN {
        return Err(Stop::Input(anyhow!(
            "{} cases are too few to train on: `--cases {ENTRIES_MIN}` or more, or `--no-train` to \
             simulate only",
            campaign.cases
        )));
    }
    let out = &arguments.out;
    make_folder(out).or_input()?;
    let url = arguments.library.clone().unwrap_or_else(|| default_library(out));
    let library = open_or_create(&url).await?;
    let said = chain(&library, &campaign, given, &arguments).await;
    // What the library holds is then in one file, fit to be copied.
    library.close().await;
    let (line, evaluation) = said?;
    say(&line);
    evaluation.map_or(Ok(()), |evaluation| evaluate::conclude(&evaluation))
}

/// Simulates, trains and evaluates; says what was made of it.
async fn chain(
    library: &Library,
    campaign: &Campaign,
    recording: Option<Recording>,
    arguments: &Arguments,
) -> Result<(String, Option<Evaluation>), Stop> {
    simulate(library, campaign, arguments.cores.unwrap_or_else(all_cores)).await?;
    if arguments.no_train {
        return Ok((format!("library: {}", library.name()), None));
    }
    let out = &arguments.out;
    let record = library.campaign(&campaign.id()).await?;
    let models = train::train(library, &record, 0, &out.join("models")).await?;
    let recording = match recording {
        Some(recording) => recording,
        None => sample::open(&out.join("sample"))?,
    };
    if let Err(other) = check(&recording, campaign) {
        note(&format!("the sample recording is of another kind: {other}"));
        let models = out.join("models");
        let line = format!("models: {}; `tracktwin evaluate` takes a recording", models.display());
        return Ok((line, None));
    }
    let evaluation = evaluate::evaluate(&recording, library, models, out).await?;
    Ok((format!("report: {}", out.join("report.html").display()), Some(evaluation)))
}

/// Whether models of the campaign can evaluate the recording.
fn check(recording: &Recording, campaign: &Campaign) -> Result<(), tracktwin_evaluation::Error> {
    let experiment = &campaign.definition.experiment;
    check_recording(recording, &experiment.design, &experiment.speeds_km_h)
}

fn default_library(out: &Path) -> String {
    format!("sqlite:{}", out.join("library.sqlite").display())
}

fn all_cores() -> NonZeroUsize {
    std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN)
}

/// Simulates what the library lacks of a campaign; Ctrl-C leaves it to be gone on with.
async fn simulate(library: &Library, campaign: &Campaign, cores: NonZeroUsize) -> Result<(), Stop> {
    farm::prepare(library, campaign).await?;
    let id = campaign.id();
    let shutdown = stop_on_signal("stopping: cases that are begun go back to the library")?;
    let _nothing_left_to_wind_up = shutdown.clone().drop_guard();
    let stopped = shutdown.clone();
    let mut progress = None::<Progress>;
    let task = Task::new(&id, campaign.cases, cores);
    let status = farm::embedded(library, task, shutdown, |status: Status| {
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
        return Err(anyhow!("interrupted with {left} cases left; the same command goes on").into());
    }
    if status.failed > 0 {
        note(&format!(
            "{} cases were given up; `tracktwin library status` says why; going on without them",
            status.failed
        ));
    }
    Ok(())
}
