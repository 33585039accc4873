//! The command line of `tracktwin-worker`: arguments, signals, log and exit codes.

use crate::agent::{self, AgentError, Config};
use crate::slot::Slot;
use crate::{Credentials, LogFormat, Token, log_to_stderr};
use anyhow::Context;
use clap::Parser;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;
use tracktwin_parameters::QuantityError;
use tracktwin_parameters::quantity::{CORES, SECONDS};
use tracktwin_protocol::BadMessage;
use tracktwin_traces::{Export, ExportError};

/// Exit code for wrong arguments, and for a worker that its coordinator refuses.
const REFUSED: u8 = 2;

/// Exit code for a failure that may be temporary.
const FAILED: u8 = 3;

/// Time after which a worker with `--idle-exit` gives up a silent coordinator: longer than a
/// restart of a coordinator.
const SILENCE: Duration = Duration::from_mins(10);

/// Longest time that an obsolete computation may delay the exit.
const END: Duration = Duration::from_millis(100);

/// Worker of a tracktwin farm: leases cases from a coordinator, simulates them and reports their
/// features, until it is stopped (Ctrl-C or SIGTERM).
///
/// A worker can be started and stopped at any time: reported results are kept, and other cases go
/// to other workers. When stopped, it finishes or returns its cases within ten seconds.
#[derive(Parser)]
#[command(name = "tracktwin-worker", version, max_term_width = 100)]
#[command(after_help = "On one machine:
  tracktwin-worker --coordinator http://127.0.0.1:7700
On a cluster:
  tracktwin-worker --coordinator https://head:7700 --tls-ca certs/ca.pem \\
      --token-file certs/token --idle-exit 300 --give-up-after 3600

OpenTelemetry traces are sent to OTEL_EXPORTER_OTLP_ENDPOINT.

Exit codes, for batch systems:
  0  stopped by a signal, or no work for --idle-exit seconds: do not restart it
  2  wrong arguments, or refused by the coordinator (token, version, physics): correct this first
  3  failure, or no coordinator for --give-up-after seconds: a restart may help")]
struct Arguments {
    /// Address of the coordinator, http://HOST:PORT or https://HOST:PORT; separate several
    /// coordinators of one library by commas.
    #[arg(
        long = "coordinator",
        value_name = "URL",
        env = "TRACKTWIN_COORDINATOR",
        required = true,
        value_delimiter = ','
    )]
    coordinators: Vec<String>,
    /// Number of cores [default: all].
    #[arg(long, value_name = "N", env = "TRACKTWIN_CORES", value_parser = cores)]
    cores: Option<NonZeroUsize>,
    /// Name of the worker, unique in the farm and the same after a restart: quarantine and suspension
    /// belong to it [default: host name and number of the worker on its host].
    #[arg(long, value_name = "NAME", env = "TRACKTWIN_NAME", value_parser = name)]
    name: Option<String>,
    /// Exit with code 0 after this time without work [default: never].
    #[arg(long, value_name = "SECONDS", env = "TRACKTWIN_IDLE_EXIT", value_parser = seconds)]
    idle_exit: Option<u64>,
    /// Exit with code 3 after this time without a response from a coordinator [default: never; with
    /// --idle-exit: 600 or the value of --idle-exit, whichever is larger].
    #[arg(long, value_name = "SECONDS", env = "TRACKTWIN_GIVE_UP_AFTER", value_parser = seconds)]
    give_up_after: Option<u64>,
    /// File with the token of the farm.
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// Certificate of the farm's certificate authority (ca.pem), for https.
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TLS_CA")]
    tls_ca: Option<PathBuf>,
    /// Certificate of the worker (PEM), if the coordinator requires one.
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TLS_CERT", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Private key of the certificate (PEM).
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TLS_KEY", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Allow plain text over a network; only for a trusted network.
    #[arg(long, env = "TRACKTWIN_INSECURE")]
    insecure: bool,
    /// Serve /healthz and /metrics (Prometheus) on this address, e.g. 127.0.0.1:7701.
    #[arg(long, value_name = "ADDR", env = "TRACKTWIN_HEALTH")]
    health: Option<SocketAddr>,
    /// Format of the log; set its level with `RUST_LOG`.
    #[arg(long, value_enum, default_value_t = LogFormat::Text, env = "TRACKTWIN_LOG_FORMAT")]
    log_format: LogFormat,
}

fn cores(text: &str) -> Result<NonZeroUsize, QuantityError> {
    let cores = usize::try_from(CORES.parse_count(text)?).ok().and_then(NonZeroUsize::new);
    cores.ok_or(QuantityError::Range { value: 0.0, of: Box::new(CORES) })
}

fn name(text: &str) -> Result<String, BadMessage> {
    tracktwin_protocol::name("the name", text.to_owned())
}

fn seconds(text: &str) -> Result<u64, QuantityError> {
    SECONDS.parse_count(text)
}

/// Reads the command line, runs the worker and returns the exit code.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    log_to_stderr(arguments.log_format, filter());
    let mut config = match config(&arguments) {
        Ok(config) => config,
        Err(error) => return report(&error, REFUSED),
    };
    let slot = if arguments.name.is_none() { Slot::take() } else { None };
    if let Some(name) = arguments.name.as_ref().or(slot.as_ref().map(|slot| &slot.name)) {
        config.worker.clone_from(name);
    }
    match serve(config, arguments.health) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let refused = error.downcast_ref::<AgentError>().is_some_and(|error| !error.may_pass())
                || error.is::<ExportError>();
            report(&error, if refused { REFUSED } else { FAILED })
        }
    }
}

fn report(error: &anyhow::Error, code: u8) -> ExitCode {
    let line = format!("{error:#}").replace('\n', " ");
    eprintln!("tracktwin-worker: {line}");
    ExitCode::from(code)
}

fn config(arguments: &Arguments) -> anyhow::Result<Config> {
    let cores = match arguments.cores {
        Some(cores) => cores,
        None => std::thread::available_parallelism()?,
    };
    let token = arguments.token_file.as_deref().map(token).transpose()?;
    let identity_pem = match (&arguments.tls_cert, &arguments.tls_key) {
        (Some(certificate), Some(key)) => Some([read(certificate)?, read(key)?]),
        _ => None,
    };
    Ok(Config {
        // A trailing comma gives an empty entry.
        coordinators: arguments.coordinators.iter().filter(|it| !it.is_empty()).cloned().collect(),
        credentials: Credentials {
            token,
            ca_pem: arguments.tls_ca.as_deref().map(read).transpose()?,
            identity_pem,
            insecure: arguments.insecure,
        },
        idle_exit: arguments.idle_exit.map(Duration::from_secs),
        give_up_after: give_up_time(arguments.idle_exit, arguments.give_up_after),
        ..Config::new(String::new(), cores)
    })
}

/// Time without a response from a coordinator after which the worker gives up: with `--idle-exit`
/// it must not wait for ever.
fn give_up_time(idle_exit: Option<u64>, give_up_after: Option<u64>) -> Option<Duration> {
    let idle = idle_exit.map(|idle| Duration::from_secs(idle).max(SILENCE));
    give_up_after.map(Duration::from_secs).or(idle)
}

fn token(path: &Path) -> anyhow::Result<Token> {
    let text = String::from_utf8_lossy(&read(path)?).into_owned();
    Token::new(&text).with_context(|| path.display().to_string())
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("{}: cannot be read", path.display()))
}

fn serve(config: Config, health: Option<SocketAddr>) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Runtime::new()?;
    let served = runtime.block_on(async {
        let _traces = Export::from_environment("tracktwin-worker")?;
        let shutdown = CancellationToken::new();
        stop_on_signals(shutdown.clone())?;
        let port = match health {
            Some(address) => {
                let port = TcpListener::bind(address).await;
                Some(port.with_context(|| format!("--health: cannot bind {address}"))?)
            }
            None => None,
        };
        tracing::info!(worker = config.worker, cores = config.cores, "worker started");
        Ok(agent::run_with_health(config, port, shutdown).await?)
    });
    // A returned group may still be computing; it is not waited for.
    runtime.shutdown_timeout(END);
    served
}

/// Cancels `shutdown` on the first Ctrl-C or SIGTERM; the second ends the process at once.
fn stop_on_signals(shutdown: CancellationToken) -> anyhow::Result<()> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::spawn(async move {
        loop {
            let kind = tokio::select! {
                _ = terminate.recv() => SignalKind::terminate(),
                _ = interrupt.recv() => SignalKind::interrupt(),
            };
            if shutdown.is_cancelled() {
                std::process::exit(128 + kind.as_raw_value());
            }
            tracing::info!("stopping: cases in progress are finished, the others are returned");
            shutdown.cancel();
        }
    });
    Ok(())
}

/// Warnings, or what `RUST_LOG` asks for.
fn filter() -> EnvFilter {
    EnvFilter::builder().with_default_directive(LevelFilter::WARN.into()).from_env_lossy()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_that_ends_when_idle_does_not_wait_for_ever_for_its_coordinator() {
        let seconds = |s| Some(Duration::from_secs(s));
        assert_eq!(give_up_time(None, None), None);
        assert_eq!(give_up_time(Some(30), None), seconds(600));
        assert_eq!(give_up_time(Some(900), None), seconds(900));
        assert_eq!(give_up_time(Some(900), Some(60)), seconds(60));
        assert_eq!(give_up_time(None, Some(0)), seconds(0));
    }
}
