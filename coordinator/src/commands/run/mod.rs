//! `tracktwin run`: the whole chain, from a campaign to an evaluated recording.

mod sample;

use super::progress::Progress;
use super::signals::stop_on_signal;
use super::{OrInput, Stop, evaluate, note, say, train};
use crate::campaign::{Campaign, DEFAULT};
use crate::farm::{self, Task};
use anyhow::{Context, anyhow};
use clap::Args;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use tracktwin_evaluation::check_track;
use tracktwin_library::{Library, Status};
use tracktwin_signal::recording::Recording;

/// What `run` is told.
#[derive(Args)]
pub(super) struct Arguments {
    /// Campaign file (TOML) [default: a small campaign over the paper's Table D1].
    campaign: Option<PathBuf>,
    /// How many cases, instead of the campaign's own number.
    #[arg(long, value_name = "N")]
    cases: Option<u32>,
    /// Library to fill: sqlite:PATH; one that holds part of the campaign is gone on with
    /// [default: sqlite:OUT/library.sqlite].
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
    let design = &campaign.definition.experiment.design;
    if let Some(recording) = &given {
        check_track(recording, design).or_input()?;
    }
    let out = &arguments.out;
    std::fs::create_dir_all(out)
        .with_context(|| format!("{}: the folder cannot be made", out.display()))
        .or_input()?;
    let url = arguments.library.clone().unwrap_or_else(|| default_library(out));
    let library = Library::open_or_create(&url).await.map_err(Stop::from_library)?;
    simulate(&library, &campaign, arguments.cores.unwrap_or_else(all_cores)).await?;
    if arguments.no_train {
        let name = library.name();
        library.close().await;
        say(&format!("library: {name}"));
        return Ok(());
    }

    let record = library.campaign(&campaign.id()).await?;
    let models = train::train(&library, &record, 0, &out.join("models")).await?;
    let recording = match given {
        Some(recording) => recording,
        None => sample::open(&out.join("sample"))?,
    };
    if let Err(other) = check_track(&recording, design) {
        library.close().await;
        note(&format!("the sample recording is of another track: {other}"));
        let models = out.join("models");
        say(&format!("models: {}; `tracktwin evaluate` takes a recording", models.display()));
        return Ok(());
    }
    evaluate::evaluate(&recording, &library, models, out).await?;
    // What the library holds is then in one file, fit to be copied.
    library.close().await;
    say(&format!("report: {}", out.join("report.html").display()));
    Ok(())
}

fn default_library(out: &Path) -> String {
    format!("sqlite:{}", out.join("library.sqlite").display())
}

fn all_cores() -> NonZeroUsize {
    std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN)
}

/// Simulates what the library lacks of a campaign; Ctrl-C leaves it to be gone on with.
async fn simulate(library: &Library, campaign: &Campaign, cores: NonZeroUsize) -> Result<(), Stop> {
    farm::prepare(library, campaign).await.map_err(Stop::from_farm)?;
    let id = campaign.id();
    let shutdown = stop_on_signal("stopping: cases that are begun go back to the library")?;
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
    .await
    .map_err(Stop::from_farm)?;
    progress.into_iter().for_each(Progress::end);
    if status.done() < status.total() {
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
