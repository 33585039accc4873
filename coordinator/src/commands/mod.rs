//! What the program can be told to do: one file a subcommand, each load, compute, store, report.
//!
//! Files are read and written where a command stands, in asynchronous ones too: it has nothing else to do
//! meanwhile. Long computations go through `pipeline::compute`.

mod campaign;
mod certs;
mod contact;
mod continuity;
mod coordinator;
mod coverage;
mod diagnose;
mod evaluate;
mod extend;
mod files;
mod import;
mod inspect;
mod library;
mod library_url;
mod numbers;
mod progress;
mod receptance;
mod reproduce;
mod run;
mod signals;
mod simulate;
mod status;
mod stop;
mod train;
mod trial;

use stop::{OrInput, Stop};

use clap::{CommandFactory, Parser, Subcommand};
use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::OnceLock;
use tracing_subscriber::EnvFilter;
use tracktwin_worker::{LogFormat, log_to_stderr};

/// Digital twin of railway track: how stiff are railpad, sleeper and ballast, sleeper by sleeper,
/// from the vibration of a passing axle box.
///
/// `tracktwin run` simulates a small campaign, trains models on it and evaluates a sample
/// recording: the shortest way to see everything work.
#[derive(Parser)]
#[command(name = "tracktwin", version, propagate_version = true, max_term_width = 100)]
#[command(
    after_help = "Exit codes: 0 done, 1 a negative answer, 2 wrong input or usage, 3 failure."
)]
struct Program {
    #[command(subcommand)]
    command: Command,
    /// How log lines look; which ones appear, `RUST_LOG` says.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text,
          env = "TRACKTWIN_LOG_FORMAT")]
    log_format: LogFormat,
}

/// The subcommands.
#[derive(Subcommand)]
enum Command {
    /// Simulate a campaign, train models on it and evaluate a recording.
    Run(run::Arguments),
    /// Simulate a vehicle's passes over one track and write them as a recording.
    Simulate(simulate::Arguments),
    /// Work out how the track answers a force: receptance by frequency (hammer test).
    Receptance(receptance::Arguments),
    /// Train Gaussian-process models on a library that has at least 200 finished cases.
    Train(train::Arguments),
    /// Tell the track's parameters under a recording, sleeper by sleeper.
    Evaluate(evaluate::Arguments),
    /// Tell how often estimates hold and refusals are right, on simulated tracks nobody has seen.
    Coverage(coverage::Arguments),
    /// Find where a recording and the simulation differ, and what physics was left out.
    Diagnose(diagnose::Arguments),
    /// Write a campaign that has the physics a diagnosis found in its parameter space.
    Extend(extend::Arguments),
    /// Hide physics in recordings, diagnose them blindly and score the answers.
    Trial(trial::Arguments),
    /// Set the paper's results beside this program's, figure by figure.
    Reproduce(reproduce::Arguments),
    /// Make a recording of CSV, Parquet, NumPy or MATLAB files.
    Import(import::Arguments),
    /// Say what is in a recording and what it can be used for.
    Inspect(inspect::Arguments),
    /// Ask the model library.
    #[command(subcommand)]
    Library(library::Question),
    /// Serve campaigns to workers on this and other machines.
    Coordinator(coordinator::Arguments),
    /// Add campaigns to a library, pause, resume, cancel and retry them.
    #[command(subcommand)]
    Campaign(campaign::Action),
    /// Show how far a farm is: campaigns, rates, failures, workers.
    Status(status::Arguments),
    /// Make certificates and a token for a farm of several machines.
    Certs(certs::Arguments),
    /// Print a shell's completions for this program.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// Reads the command line, runs one command and turns its end into an exit code.
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

/// One line that says what is wrong.
fn report(error: &anyhow::Error, code: u8) -> ExitCode {
    let line = chain(error).replace('\n', " ");
    println_stderr(&format!("tracktwin: {line}"));
    ExitCode::from(code)
}

/// What is wrong and why, each thing said once: some errors tell their source themselves.
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
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Receptance(arguments) => receptance::run(&arguments),
        Command::Train(arguments) => asynchronously(train::run(arguments)),
        Command::Diagnose(arguments) => asynchronously(diagnose::run(arguments)),
        Command::Extend(arguments) => extend::run(arguments),
        Command::Trial(arguments) => asynchronously(trial::run(arguments)),
        Command::Evaluate(arguments) => asynchronously(evaluate::run(arguments)),
        Command::Coverage(arguments) => asynchronously(coverage::run(arguments)),
        Command::Reproduce(arguments) => asynchronously(reproduce::run(arguments)),
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
    }
}

/// Warnings, a service's course, or what `RUST_LOG` asks for.
fn filter(program: &Program) -> EnvFilter {
    // A statement over a whole library takes a second or more: that is no fault.
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

/// Says a line of the command's answer on standard output.
fn println_stdout(line: &str) {
    write_stdout(format!("{line}\n").as_bytes());
}

/// What kept an answer from being written; the program ends with it, once all else is wound up.
static UNWRITTEN: OnceLock<std::io::Error> = OnceLock::new();

/// Whether anybody reads: who did may have gone, as `head` does once it has its lines, and then nothing
/// is amiss.
fn write_stdout(text: &[u8]) -> bool {
    let mut out = std::io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Ok(()) => true,
        Err(error) if error.kind() == ErrorKind::BrokenPipe => false,
        Err(error) => {
            // The first one says it all.
            let _ = UNWRITTEN.set(error);
            false
        }
    }
}

/// Says a line beside the answer on standard error, if anybody reads that.
fn println_stderr(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_help_shows_what_the_environment_holds_of_a_library() {
        fn check(command: &clap::Command) {
            for argument in command.get_arguments().filter(|it| it.get_id() == "library") {
                assert!(argument.is_hide_env_values_set(), "{}", command.get_name());
            }
            command.get_subcommands().for_each(check);
        }
        check(&Program::command());
    }
}
