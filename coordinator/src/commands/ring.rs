//! `tracktwin ring`: the paper's test ring with known truth.

use super::files::{Force, make_folder};
use super::library_url::{open_or_create, open_whole};
use super::progress::Progress;
use super::{OrInput, Stop, evaluate, print_json, println_stdout};
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::ring::{RingStudy, RingStudyError, check_folder};
use clap::Args;
use parking_lot::Mutex;
use serde_json::json;
use std::path::PathBuf;
use tracktwin_experiment::CODE_VERSION;
use tracktwin_report::Origin;
use tracktwin_reproduction::ClaimVerdict;
use tracktwin_ring::{Plan, Ring, Statement, Stretch, Study};
use tracktwin_surrogate::Trained;

/// Arguments of `ring`.
#[derive(Args)]
#[command(after_help = "\
The ring of Shen et al. 2023 (section 2.1): 100 sleepers, four rails, four joints in different
condition, a clamp at every third or fourth sleeper, no railpad at SN91, no bolts at SN94, gaps in the
plywood, rails 1 and 3 rougher. The reference simulator records it; the recording is evaluated by
inversion as a whole, lap by lap and speed by speed, and with --models by Gaussian processes.

In DIR: recording/, truth.json, truth.csv, evaluations/, ring.csv (one row per sleeper), ring.json
(the statements) and report.html. Repeat the command to continue an interrupted study.

Examples:
  tracktwin ring --out ring
  tracktwin ring --out part --sleepers 84-100 --laps 1

Exit codes: 0 no statement differs, 1 one or more differ, 2 wrong input, 3 failure.")]
pub(super) struct Arguments {
    /// Output folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Seed of sleepers, surface and measuring chain.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Number of laps; each has a pass at every speed.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=20))]
    laps: u8,
    /// Speeds in km/h.
    #[arg(long, value_name = "KMH,...", value_delimiter = ',', default_value = "7,10,13")]
    speeds: Vec<f64>,
    /// Stretch of the ring that is recorded, FIRST-LAST.
    #[arg(long, value_name = "STRETCH", default_value_t = Stretch::WHOLE)]
    sleepers: Stretch,
    /// Folder of models trained on the library; also evaluates by Gaussian processes.
    #[arg(long, value_name = "DIR", requires = "library")]
    models: Option<PathBuf>,
    /// Library of the models, which also stores null simulations [default: sqlite:DIR/library.sqlite].
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY", hide_env_values = true)]
    library: Option<String>,
    /// Also diagnose each lap, and evaluate all passes again with what the first lap's diagnosis found;
    /// this takes several minutes per lap and 30 sleepers.
    #[arg(long)]
    diagnose: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let command = command(&arguments);
    let Arguments { out, force, seed, laps, speeds, sleepers, models, library, diagnose, json } =
        arguments;
    let plan = Plan::new(seed, usize::from(laps), speeds, sleepers).or_input()?;
    // Before anything is created.
    let trained = models.as_deref().map(Trained::load).transpose().or_input()?;
    check_folder(&out, force.force)?;
    make_folder(&out)?;
    let own = || format!("sqlite:{}", out.join("library.sqlite").display());
    let library = match (&trained, library) {
        (Some(_), Some(url)) => open_whole(&url).await?,
        (_, url) => open_or_create(&url.unwrap_or_else(own)).await?,
    };
    let models = match trained {
        Some(trained) => {
            let evaluator = Evaluator::new(trained, &library).await.map_err(evaluate::stop)?;
            evaluator.models().belongs_to(&evaluator.set().library_digest).or_input()?;
            Some(evaluator)
        }
        None => None,
    };
    let ring = Ring::new(plan);
    let origin = Origin {
        command: command.clone(),
        version: format!("tracktwin {CODE_VERSION}"),
        library: String::new(),
    };
    let study = RingStudy {
        ring: &ring,
        folder: &out,
        library: Some(&library),
        models: models.as_ref(),
        diagnose,
        page: &|diagnosis| tracktwin_report::diagnosis_page(diagnosis, &origin),
        force: force.force,
    };
    let progress = Mutex::new(Progress::begin("ring", 0, study.steps()));
    let ran = study.run(&|done, remark| progress.lock().at(done, remark)).await;
    progress.into_inner().end();
    let found = ran.map_err(stop)?;
    let page = study.write(&found, &tracktwin_report::ring_page(&found, &command))?;
    library.close().await;
    let statements = found.statements();
    if json {
        let report = page.display().to_string();
        print_json(&json!({ "plan": found.plan, "statements": statements, "report": report }));
    } else {
        print(&statements, &page.display().to_string());
    }
    let failed = Study::count(&statements, ClaimVerdict::Differs);
    if failed > 0 { Err(Stop::Negative) } else { Ok(()) }
}

/// Prints one line per statement, and the number of statements that hold.
fn print(statements: &[Statement], page: &str) {
    for row in statements {
        let Statement { figure, method, claim, found, verdict, .. } = row;
        println_stdout(&format!("{figure:11} {:11} {method}: {claim}: {found}", verdict.label()));
    }
    let count = |verdict| Study::count(statements, verdict);
    println_stdout(&format!(
        "{} hold, {} do not, {} cannot tell; page: {page}",
        count(ClaimVerdict::Reproduced),
        count(ClaimVerdict::Differs),
        count(ClaimVerdict::CannotTell)
    ));
}

fn stop(error: RingStudyError) -> Stop {
    if error.is_wrong_input() { Stop::Input(error.into()) } else { Stop::Failure(error.into()) }
}

/// The command line that repeats the study.
fn command(arguments: &Arguments) -> String {
    let speeds: Vec<String> = arguments.speeds.iter().map(ToString::to_string).collect();
    let mut command = format!(
        "tracktwin ring --out {} --seed {} --laps {} --speeds {} --sleepers {}",
        arguments.out.display(),
        arguments.seed,
        arguments.laps,
        speeds.join(","),
        arguments.sleepers
    );
    if let Some(models) = &arguments.models {
        command = format!("{command} --models {} --library URL", models.display());
    }
    if arguments.diagnose {
        command += " --diagnose";
    }
    command
}
