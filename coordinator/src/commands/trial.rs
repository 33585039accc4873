//! `tracktwin trial`: blind trial of the diagnosis.

use super::files::{Force, make_folder};
use super::library_url::open_or_create;
use super::progress::Progress;
use super::track::parser_of;
use super::{OrInput, Stop, evaluate, print_json, println_stderr, println_stdout};
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::trial::{Trial, TrialError, check_folder};
use anyhow::anyhow;
use clap::Args;
use std::path::{Path, PathBuf};
use tracktwin_library::Library;
use tracktwin_parameters::Preset;
use tracktwin_signal::recording::compare_designs;
use tracktwin_surrogate::Trained;
use tracktwin_trial::Summary;

/// Arguments of `trial`.
#[derive(Args)]
#[command(
    after_help = "In DIR: recordings/, sealed/ (the truth), seals.sha256 (check it with `sha256sum -c`), \
diagnoses/, scores.jsonl, summary.json, and trial.md with the tables, written again after every case. Repeat the \
command to continue an interrupted trial. Started on several machines with the same --library, it distributes the \
cases; the case of a machine that fails goes to another within a minute.\n\nExit codes: 0 all goals reached, 1 some are not, 2 wrong input, 3 failure."
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command")]
pub(super) struct Arguments {
    /// Track of the recordings: the test rig, or a line.
    #[arg(long, value_name = "NAME", default_value = Preset::VTrack.name(), value_parser = parser_of(|preset| preset != Preset::RealScale))]
    preset: Preset,
    /// Number of recordings.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=9999))]
    cases: u32,
    /// Seed of the hidden physics.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Output folder of this machine.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Library that stores scores and null simulations [default: sqlite:DIR/library.sqlite].
    /// Machines that share a library share the trial.
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Knock-out test: repeat the diagnosis of every recording with one extension, with its kind
    /// left out of the catalogue; "unknown" is expected.
    #[arg(long)]
    knock_out: bool,
    /// Shuffle test: repeat the diagnosis of every recording in which a local extension was found,
    /// with the sleepers of each speed shuffled; no physics should be accepted.
    #[arg(long)]
    shuffle: bool,
    /// Folder of models trained on the library; also tests whether the paper's method flags the
    /// recordings.
    #[arg(long, value_name = "DIR", requires = "library")]
    models: Option<PathBuf>,
    /// Delete the passes of a recording after scoring; its seal and diagnosis are kept.
    #[arg(long)]
    discard_recordings: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let Arguments {
        preset,
        cases,
        seed,
        out,
        force,
        library,
        knock_out,
        shuffle,
        models,
        discard_recordings,
        json,
    } = arguments;
    let own = || format!("sqlite:{}", out.join("library.sqlite").display());
    let url = library.unwrap_or_else(own);
    // Before anything is created.
    let models = models.as_deref().map(Trained::load).transpose().or_input()?;
    check_folder(&out, force.force)?;
    make_folder(&out)?;
    let library = open_or_create(&url).await?;
    let paper = paper(models, preset, &library).await?;
    let node = tracktwin_worker::agent::unique_name();
    let trial = Trial {
        preset,
        seed,
        cases,
        folder: out,
        library,
        node,
        knock_out,
        shuffle,
        paper,
        discard_recordings,
        force: force.force,
    };
    // With --json, standard output is for the summary.
    let tell = if json { println_stderr } else { println_stdout };
    let digest = trial.begin().await.map_err(stop)?;
    tell(&format!("sealed: {cases} truths, SHA-256 of seals.sha256 {digest}"));
    let done = trial.answered().await.map_err(stop)?;
    let (id, library) = (trial.id(), trial.library.name());
    tell(&format!("trial {id} in {library}: {done} of {cases} scored"));

    let mut progress = Progress::begin("diagnosing", done, u64::from(cases));
    let answered = trial.answer(|done, remark| progress.at(done, remark)).await;
    progress.end();
    let summary = answered.map_err(stop)?;
    if json {
        print_json(&summary);
    } else {
        print(&summary, &trial.folder);
    }
    let missed = summary.rows.iter().any(|row| row.reached == Some(false));
    if missed { Err(Stop::Negative) } else { Ok(()) }
}

/// Prints one line per measure, and the path of the tables.
fn print(summary: &Summary, folder: &Path) {
    for row in &summary.rows {
        let goal = row.goal.as_ref().map_or(String::new(), |goal| format!(" ({goal})"));
        println_stdout(&format!("{}: {}{goal}", row.measure, row.value));
    }
    println_stdout(&format!("tables: {}", folder.join("trial.md").display()));
}

/// Evaluator for the paper's method; checks that the models are of the trial's track.
async fn paper(
    models: Option<Trained>,
    preset: Preset,
    library: &Library,
) -> Result<Option<Evaluator>, Stop> {
    let Some(models) = models else { return Ok(None) };
    let evaluator = Evaluator::new(models, library).await.map_err(evaluate::stop)?;
    check_models(&evaluator, preset).or_input()?;
    Ok(Some(evaluator))
}

/// Checks that the models are of the trial's track.
fn check_models(evaluator: &Evaluator, preset: Preset) -> anyhow::Result<()> {
    let name = match preset {
        Preset::VTrack => "V-Track",
        line => line.name(),
    };
    compare_designs(evaluator.design(), &preset.design()).map_err(|other| {
        anyhow!(
            "--models: their track is another than the trial's, which is {name} ({} {}, that of {name} {}); \
             train models of {name}",
            other.quantity,
            other.found(),
            other.known()
        )
    })
}

fn stop(error: TrialError) -> Stop {
    match error {
        TrialError::Other { .. }
        | TrialError::OtherPreset { .. }
        | TrialError::OtherFormat { .. }
        | TrialError::Seal(_) => Stop::Input(error.into()),
        TrialError::Files(ref reason) if reason.is_wrong_input() => Stop::Input(error.into()),
        TrialError::Library(ref reason) if reason.is_wrong_input() => Stop::Input(error.into()),
        _ => Stop::Failure(error.into()),
    }
}
