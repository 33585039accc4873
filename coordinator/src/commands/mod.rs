//! What the program can be told to do: one file a subcommand, each load, compute, store, report.

mod evaluate;
mod library;
mod receptance;
mod run;
mod simulate;
mod stop;
mod train;

pub use stop::{OrInput, Stop};

use clap::Subcommand;

/// The subcommands.
#[derive(Subcommand)]
pub enum Command {
    /// Simulate a campaign, train models on it and evaluate a recording.
    Run(run::Arguments),
    /// Simulate a vehicle's passes over one track and write them as a recording.
    Simulate(simulate::Arguments),
    /// Work out how the track answers a force: receptance by frequency (hammer test).
    Receptance(receptance::Arguments),
    /// Train Gaussian-process models on a library.
    Train(train::Arguments),
    /// Tell the track's parameters under a recording, sleeper by sleeper.
    Evaluate(evaluate::Arguments),
    /// Ask the model library.
    #[command(subcommand)]
    Library(library::Question),
    /// Print a shell's completions for this program.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// Runs one command to its end.
///
/// # Errors
/// [`Stop`] tells wrong input from failure.
pub fn run(command: Command) -> Result<(), Stop> {
    match command {
        Command::Run(arguments) => asynchronously(run::run(arguments)),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Receptance(arguments) => receptance::run(&arguments),
        Command::Train(arguments) => asynchronously(train::run(arguments)),
        Command::Evaluate(arguments) => asynchronously(evaluate::run(arguments)),
        Command::Library(question) => asynchronously(library::run(question)),
        Command::Completions { shell } => {
            completions(shell);
            Ok(())
        }
    }
}

/// Sends warnings, or what `RUST_LOG` asks for, to standard error.
pub fn log_to_stderr() {
    let filter = tracing_subscriber::EnvFilter::builder()
        .with_default_directive(tracing_subscriber::filter::LevelFilter::WARN.into())
        .from_env_lossy();
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}

fn asynchronously(work: impl Future<Output = Result<(), Stop>>) -> Result<(), Stop> {
    tokio::runtime::Runtime::new()?.block_on(work)
}

fn completions(shell: clap_complete::Shell) {
    let mut program = Command::augment_subcommands(clap::Command::new("tracktwin"));
    clap_complete::generate(shell, &mut program, "tracktwin", &mut std::io::stdout());
}
