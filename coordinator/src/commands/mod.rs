//! The subcommands, one file each: load, compute, store, report.
//!
//! Commands read and write files synchronously, even in asynchronous functions, because nothing else runs
//! at that time. Long computations go through `pipeline::compute`.

mod accepted;
mod campaign;
mod certs;
mod check;
mod contact;
mod continuity;
mod coordinator;
mod coverage;
mod diagnose;
mod evaluate;
mod extend;
mod files;
mod hammer;
mod import;
mod improve;
mod inspect;
mod library;
mod library_url;
mod manual;
mod models;
mod new;
mod numbers;
mod progress;
mod receptance;
mod recording;
mod reproduce;
mod ring;
mod run;
mod shell;
mod signals;
mod simulate;
mod status;
mod stop;
mod stream;
mod track;
mod train;
mod trial;

use stop::{OrInput, Stop};

use clap::{CommandFactory, Parser, Subcommand};
use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::OnceLock;
use tracing_subscriber::EnvFilter;
use tracktwin_worker::{LogFormat, log_to_stderr};

/// Digital twin of railway track: estimates the stiffness of railpad, sleeper and ballast at every
/// sleeper from axle-box acceleration.
///
/// Start with `tracktwin run`: it simulates a small campaign, trains models on it and evaluates a
/// sample recording.
#[derive(Parser)]
#[command(name = "tracktwin", version, propagate_version = true, max_term_width = 100)]
#[command(after_help = "Exit codes: 0 done, 1 negative result, 2 wrong input or usage, 3 failure.")]
struct Program {
    #[command(subcommand)]
    command: Command,
    /// Format of the log; set its level with `RUST_LOG`.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text,
          env = "TRACKTWIN_LOG_FORMAT")]
    log_format: LogFormat,
}

/// The subcommands.
#[derive(Subcommand)]
enum Command {
    /// Simulate a campaign, train models on it and evaluate a recording.
    Run(run::Arguments),
    /// Write the description of a track, to be changed and passed on with --track.
    New(new::Arguments),
    /// Check the description of a track: stiffness, resonances, surface, contact.
    Check(check::Arguments),
    /// Simulate a vehicle's passes over one track and write them as a recording.
    Simulate(simulate::Arguments),
    /// Compute the receptance of the track by frequency (hammer test).
    Receptance(receptance::Arguments),
    /// Estimate the stiffness under every sleeper from a hammer test, or simulate one.
    #[command(subcommand)]
    Hammer(hammer::Action),
    /// Train Gaussian-process models on a library that has at least 200 finished cases.
    Train(train::Arguments),
    /// Estimate the track parameters at every sleeper from a recording.
    Evaluate(evaluate::Arguments),
    /// Estimate the track parameters at every sleeper while a pass is recorded.
    Stream(stream::Arguments),
    /// Measure coverage and false alarms of the evaluation on simulated tracks.
    Coverage(coverage::Arguments),
    /// Find where a recording differs from the track model, and which left-out physics explains it.
    Diagnose(diagnose::Arguments),
    /// Write a campaign that includes the physics found by a diagnosis.
    Extend(extend::Arguments),
    /// Find physics that the track model lacks, add it to the model, and evaluate the recording again.
    Improve(improve::Arguments),
    /// Run a blind trial: hide physics in recordings, diagnose them and score the diagnoses.
    Trial(trial::Arguments),
    /// Compare the results with the paper's, figure by figure.
    Reproduce(reproduce::Arguments),
    /// Record the paper's test ring with known truth, evaluate it and check the paper's statements.
    Ring(ring::Arguments),
    /// Convert CSV, Parquet, NumPy or MATLAB files to a recording.
    Import(import::Arguments),
    /// Check a recording and list its content, defects and possible uses.
    Inspect(inspect::Arguments),
    /// Query, copy and verify a library.
    #[command(subcommand)]
    Library(library::Question),
    /// Serve campaigns to workers on this and other machines.
    Coordinator(coordinator::Arguments),
    /// Add, pause, resume, cancel and retry campaigns of a library.
    #[command(subcommand)]
    Campaign(campaign::Action),
    /// Show the progress of a farm: campaigns, rates, failures, workers.
    Status(status::Arguments),
    /// Create certificates and a token for a farm of several machines.
    Certs(certs::Arguments),
    /// Print shell completions.
    #[command(after_help = "\
Example:
  tracktwin completions bash > ~/.local/share/bash-completion/completions/tracktwin")]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write manual pages.
    Manual(manual::Arguments),
}

/// Parses the command line, runs one command and returns its exit code.
pub fn main() -> ExitCode {
    let program = Program::parse();
    log_to_stderr(program.log_format, filter(&program));
    let ended = run(program.command);
    if let Some(error) = UNWRITTEN.get() {
        println_stderr(&format!("tracktwin: standard output: {error}"));
        return ExitCode::from(3);
    }
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(Stop::Negative) => ExitCode::from(1),
        Err(Stop::Input(error)) => report(&error, 2),
        Err(Stop::Failure(error)) => report(&error, 3),
    }
}

/// Prints the error as one line.
fn report(error: &anyhow::Error, code: u8) -> ExitCode {
    let line = chain(error).replace('\n', " ");
    println_stderr(&format!("tracktwin: {line}"));
    ExitCode::from(code)
}

/// The error and its sources in one text. A source that is already in the text is not repeated.
fn chain(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for part in error.chain().map(ToString::to_string) {
        if line.is_empty() {
            line = part;
        } else if !line.contains(&part) {
            line = format!("{line}: {part}");
        }
    }
    line
}

fn run(command: Command) -> Result<(), Stop> {
    match command {
        Command::Run(arguments) => asynchronously(run::run(arguments)),
        Command::New(arguments) => new::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Receptance(arguments) => receptance::run(&arguments),
        Command::Hammer(action) => hammer::run(&action),
        Command::Train(arguments) => asynchronously(train::run(arguments)),
        Command::Diagnose(arguments) => asynchronously(diagnose::run(arguments)),
        Command::Extend(arguments) => extend::run(arguments),
        Command::Improve(arguments) => asynchronously(improve::run(arguments)),
        Command::Trial(arguments) => asynchronously(trial::run(arguments)),
        Command::Evaluate(arguments) => asynchronously(evaluate::run(arguments)),
        Command::Stream(arguments) => asynchronously(stream::run(arguments)),
        Command::Coverage(arguments) => asynchronously(coverage::run(arguments)),
        Command::Reproduce(arguments) => asynchronously(reproduce::run(arguments)),
        Command::Ring(arguments) => asynchronously(ring::run(arguments)),
        Command::Import(arguments) => import::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Library(question) => asynchronously(library::run(question)),
        Command::Coordinator(arguments) => asynchronously(coordinator::run(arguments)),
        Command::Campaign(action) => asynchronously(campaign::run(action)),
        Command::Status(arguments) => asynchronously(status::run(arguments)),
        Command::Certs(arguments) => certs::run(&arguments),
        Command::Completions { shell } => {
            completions(shell);
            Ok(())
        }
        Command::Manual(arguments) => manual::run(&arguments),
    }
}

/// Level of the log: warnings, and information of the coordinator, unless `RUST_LOG` is set.
fn filter(program: &Program) -> EnvFilter {
    // A statement over a whole library takes a second or more, which needs no warning.
    let usual = match program.command {
        Command::Coordinator(_) => "warn,tracktwin=info,sqlx::query=error",
        _ => "warn,sqlx::query=error",
    };
    EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(usual))
}

fn asynchronously(work: impl Future<Output = Result<(), Stop>>) -> Result<(), Stop> {
    tokio::runtime::Runtime::new()?.block_on(work)
}

fn completions(shell: clap_complete::Shell) {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Program::command(), "tracktwin", &mut script);
    write_stdout(&script);
}

/// Prints a line of the result on standard output.
fn println_stdout(line: &str) {
    write_stdout(format!("{line}\n").as_bytes());
}

/// Prints a result as JSON on standard output.
fn print_json(result: &impl Serialize) {
    println_stdout(&serde_json::to_string_pretty(result).expect("results are plain data"));
}

/// First error of standard output; the program ends with it after clean-up.
static UNWRITTEN: OnceLock<std::io::Error> = OnceLock::new();

/// Writes to standard output. Returns `false` if the reader has closed it, as `head` does, which is
/// no error.
fn write_stdout(text: &[u8]) -> bool {
    let mut out = std::io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Ok(()) => true,
        Err(error) if error.kind() == ErrorKind::BrokenPipe => false,
        Err(error) => {
            // Only the first error is kept.
            let _ = UNWRITTEN.set(error);
            false
        }
    }
}

/// Prints a line on standard error; errors are ignored.
fn println_stderr(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_help_shows_the_library_of_the_environment() {
        fn check(command: &clap::Command) {
            for argument in command.get_arguments().filter(|it| it.get_id() == "library") {
                assert!(argument.is_hide_env_values_set(), "{}", command.get_name());
            }
            command.get_subcommands().for_each(check);
        }
        check(&Program::command());
    }
}
