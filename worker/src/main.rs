//! The program `tracktwin-worker`: serves a coordinator with this machine's cores.

use clap::Parser;
use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracktwin_worker::agent::{self, AgentError, Config};

/// Exit code for a worker that is of no use to its coordinator.
const REFUSED: u8 = 2;

/// Exit code when something failed.
const FAILED: u8 = 3;

/// How long a computation that no longer matters may hold up the end.
const END: Duration = Duration::from_millis(100);

/// Worker of a tracktwin campaign: leases cases from a coordinator, simulates them and hands in
/// their features, until it is stopped (Ctrl-C or SIGTERM).
///
/// It may come and go at any time: what it has handed in stays, what it has not is given to others.
#[derive(Parser)]
#[command(name = "tracktwin-worker", version, max_term_width = 100)]
#[command(after_help = "Exit codes: 0 stopped as asked, 2 refused by the coordinator, 3 failure.")]
struct Arguments {
    /// Address of the coordinator: `http://HOST:PORT`.
    #[arg(long, value_name = "URL", env = "TRACKTWIN_COORDINATOR")]
    coordinator: String,
    /// Cores to use [default: all].
    #[arg(long, value_name = "N", env = "TRACKTWIN_CORES")]
    cores: Option<NonZeroUsize>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    log_to_stderr();
    match serve(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tracktwin-worker: {error:#}");
            ExitCode::from(if error.is::<AgentError>() { REFUSED } else { FAILED })
        }
    }
}

fn serve(arguments: Arguments) -> anyhow::Result<()> {
    let cores = match arguments.cores {
        Some(cores) => cores,
        None => std::thread::available_parallelism()?,
    };
    let runtime = tokio::runtime::Runtime::new()?;
    let served = runtime.block_on(async {
        let shutdown = CancellationToken::new();
        stop_on_signals(shutdown.clone())?;
        Ok(agent::run(Config::new(arguments.coordinator, cores), shutdown).await?)
    });
    // A group given back at the end may still be computing; nobody waits for it.
    runtime.shutdown_timeout(END);
    served
}

/// Cancels `shutdown` on the first Ctrl-C or SIGTERM.
fn stop_on_signals(shutdown: CancellationToken) -> anyhow::Result<()> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::spawn(async move {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
        tracing::info!("stopping: what has begun is finished, the rest given back");
        shutdown.cancel();
    });
    Ok(())
}

/// Sends warnings, or what `RUST_LOG` asks for, to standard error.
fn log_to_stderr() {
    let filter = tracing_subscriber::EnvFilter::builder()
        .with_default_directive(tracing_subscriber::filter::LevelFilter::WARN.into())
        .from_env_lossy();
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}
