//! `tracktwin trial`: how often a diagnosis is right, on recordings whose truth it does not know.

use super::progress::Progress;
use super::{OrInput, Stop, say};
use crate::evaluating::Evaluator;
use crate::trial::{Trial, TrialError};
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use tracktwin_library::Library;
use tracktwin_surrogate::Trained;

/// What `trial` is told.
#[derive(Args)]
#[command(
    after_help = "In DIR: recordings/, sealed/ (the truth), seals.sha256 (check it with `sha256sum -c`), \
diagnoses/, scores/, and trial.md with the tables. The same command on the same folder goes on where it was \
interrupted.\n\nExit codes: 0 all goals reached, 1 some are not, 2 wrong input, 3 failure."
)]
pub(super) struct Arguments {
    /// How many recordings are made and diagnosed.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=9999))]
    cases: u32,
    /// Decides what is hidden in which case.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Folder of the trial.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The library that keeps null simulations; by default one in DIR.
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY")]
    library: Option<String>,
    /// Diagnose every single effect once more with its kind left out of the catalogue: the answer
    /// should then be "unknown".
    #[arg(long)]
    knock_out: bool,
    /// Diagnose every local effect that was found once more with the sleepers of each speed shuffled:
    /// no physics should then be named.
    #[arg(long)]
    shuffle: bool,
    /// Folder of models trained on the library: asks the paper's own pipeline too whether it looks
    /// content with each recording.
    #[arg(long, value_name = "DIR", requires = "library")]
    models: Option<PathBuf>,
    /// Remove a recording's passes once it is scored; its seal and diagnosis stay.
    #[arg(long)]
    discard_recordings: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let Arguments { cases, seed, out, library, knock_out, shuffle, models, discard_recordings } =
        arguments;
    let own = || format!("sqlite:{}", out.join("library.sqlite").display());
    let url = library.unwrap_or_else(own);
    std::fs::create_dir_all(&out)
        .with_context(|| format!("{}: the folder cannot be made", out.display()))
        .or_input()?;
    let library = Library::open_or_create(&url).await.or_input()?;
    let paper = match models {
        Some(folder) => {
            let models = Trained::load(&folder).or_input()?;
            Some(Evaluator::new(models, &library).await.or_input()?)
        }
        None => None,
    };
    let trial = Trial { seed, cases, folder: out, knock_out, shuffle, paper, discard_recordings };
    trial.begin().map_err(stop)?;

    let mut progress = Progress::begin("hiding", 0, u64::from(cases));
    let digest = trial.hide(|done, remark| progress.at(done, remark)).map_err(stop)?;
    progress.end();
    say(&format!("sealed: {cases} truths, SHA-256 of seals.sha256 {digest}"));

    let mut progress = Progress::begin("diagnosing", trial.scored(), u64::from(cases));
    let answered = trial.answer(&library, |done, remark| progress.at(done, remark)).await;
    progress.end();
    let summary = answered.map_err(stop)?;
    summary
        .rows
        .iter()
        .for_each(|row| say(&format!("{}: {} ({})", row.measure, row.value, row.goal)));
    say(&format!("tables: {}", trial.folder.join("trial.md").display()));
    let missed = summary.rows.iter().any(|row| row.reached == Some(false));
    if missed { Err(Stop::Negative) } else { Ok(()) }
}

fn stop(error: TrialError) -> Stop {
    match error {
        TrialError::Other { .. } | TrialError::Seal(_) => Stop::Input(error.into()),
        _ => Stop::Failure(error.into()),
    }
}
