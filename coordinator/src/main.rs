//! The program `tracktwin`: reads the command line, runs one command, turns its end into an exit code.

use clap::Parser;
use std::process::ExitCode;
use tracktwin::commands::{self, Command, Stop};

/// Digital twin of railway track: how stiff are railpad, sleeper and ballast, sleeper by sleeper,
/// from the vibration of a passing axle box.
///
/// `tracktwin run` simulates a small campaign, trains models on it and evaluates a sample
/// recording: the shortest way to see everything work.
#[derive(Parser)]
#[command(version, propagate_version = true, max_term_width = 100)]
#[command(after_help = "Exit codes: 0 done, 1 a negative answer, 2 wrong input or usage, 3 failure.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    commands::log_to_stderr();
    match commands::run(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Stop::Negative) => ExitCode::from(1),
        Err(Stop::Input(error)) => report(&error, 2),
        Err(Stop::Failure(error)) => report(&error, 3),
    }
}

/// One line that says what is wrong.
fn report(error: &anyhow::Error, code: u8) -> ExitCode {
    let line = format!("{error:#}").replace('\n', " ");
    eprintln!("tracktwin: {line}");
    ExitCode::from(code)
}
