//! `tracktwin coordinator`: serves campaigns to workers on other machines.

use super::campaign::add_cases_told;
use super::files::read;
use super::library_url::LibraryUrl;
use super::numbers::count;
use super::signals::stop_on_signal;
use super::{OrInput, Stop, continuity};
use anyhow::Context;
use clap::Args;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracktwin_farm::campaign::Campaign;
use tracktwin_farm::coordinator::{Coordinator, CoordinatorError};
use tracktwin_farm::dispatch::{Settings, Timing};
use tracktwin_farm::security::Security;
use tracktwin_library::Library;
use tracktwin_parameters::quantity::CASES;
use tracktwin_traces::Export;
use tracktwin_worker::Token;

/// Interval of the log lines while cases are added.
const TELL_EVERY: Duration = Duration::from_secs(10);

/// Arguments of `coordinator`.
#[derive(Args)]
#[command(after_help = "On one machine:
  tracktwin coordinator --campaign mine.toml --library sqlite:library.sqlite
  tracktwin-worker --coordinator http://127.0.0.1:7700
On a cluster:
  tracktwin certs certs --host head
  tracktwin coordinator --library postgres://... --listen 0.0.0.0:7700 --dashboard 127.0.0.1:7780 \\
      --tls-cert certs/coordinator.pem --tls-key certs/coordinator-key.pem --token-file certs/token

Several coordinators can serve one PostgreSQL library; a SQLite library only one at a time.
A coordinator can be killed and restarted at any time: workers wait and continue.
OpenTelemetry traces are sent to OTEL_EXPORTER_OTLP_ENDPOINT.

Exit codes: 0 stopped by a signal, or done with --exit-when-done; 2 wrong input; 3 failure.")]
pub(super) struct Arguments {
    /// Campaign file (TOML) to add at start; may be repeated. `tracktwin campaign add` adds
    /// campaigns later. Without this option the coordinator serves the campaigns in the library.
    #[arg(long = "campaign", value_name = "FILE")]
    campaigns: Vec<PathBuf>,
    /// Number of cases; overrides the number in the campaign files.
    #[arg(long, value_name = "N", requires = "campaigns", value_parser = count::<u32>(CASES))]
    cases: Option<u32>,
    #[command(flatten)]
    library: LibraryUrl,
    /// Address that workers connect to, as IP:PORT; if other machines reach it, --tls-cert and
    /// --token-file (or --tls-client-ca) are required, or --insecure.
    #[arg(long, value_name = "ADDR", value_parser = address, env = "TRACKTWIN_LISTEN", default_value = "127.0.0.1:7700")]
    listen: SocketAddr,
    /// Address of the web dashboard, as IP:PORT; it serves /, /metrics (Prometheus) and /healthz
    /// as plain HTTP. If other machines reach it, --insecure-dashboard is required.
    #[arg(long, value_name = "ADDR", value_parser = address, env = "TRACKTWIN_DASHBOARD")]
    dashboard: Option<SocketAddr>,
    /// Exit when every running campaign is done; given-up cases count as done.
    #[arg(long)]
    exit_when_done: bool,
    /// Share of cases that a second worker simulates again for comparison, e.g. 1%.
    #[arg(long, value_name = "SHARE", value_parser = share, default_value = "0%")]
    audit: f64,
    /// Length of a lease in seconds; a worker without a heartbeat for this time loses its cases.
    #[arg(long, value_name = "SECONDS", value_parser = lease, default_value = "12")]
    lease: Duration,
    /// File with the token that workers must present.
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// Certificate of the coordinator (PEM).
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TLS_CERT", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Private key of the certificate (PEM).
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TLS_KEY", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Require worker certificates signed by this authority (mutual TLS).
    #[arg(long, value_name = "FILE", env = "TRACKTWIN_TLS_CLIENT_CA", requires = "tls_cert")]
    tls_client_ca: Option<PathBuf>,
    /// Allow plain text and missing tokens at --listen on a network address; only for a trusted
    /// network.
    #[arg(long, env = "TRACKTWIN_INSECURE")]
    insecure: bool,
    /// Allow --dashboard on a network address. Everybody there can read the pages and, without
    /// --token-file and --tls-client-ca, use their actions; only for a trusted network.
    #[arg(long, env = "TRACKTWIN_INSECURE_DASHBOARD")]
    insecure_dashboard: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let security = arguments.security().or_input()?;
    // Check the arguments before anything is opened.
    security.check(arguments.listen).context("--listen").or_input()?;
    security.acceptor().or_input()?;
    check_dashboard(arguments.dashboard, arguments.insecure_dashboard).or_input()?;
    let _traces = Export::from_environment("tracktwin-coordinator").or_input()?;
    let campaigns = arguments.campaigns.iter().map(|path| Campaign::read(path, arguments.cases));
    let campaigns = campaigns.collect::<Result<Vec<_>, _>>().or_input()?;
    let listener = bind("--listen", arguments.listen).await.or_input()?;
    let dashboard = match arguments.dashboard {
        Some(address) => Some(bind("--dashboard", address).await.or_input()?),
        None => None,
    };
    let library = arguments.library.open_or_create().await?;
    // A coordinator that cannot serve the library must not add campaigns to it.
    let claim = tracktwin_farm::embedded::claim(&library).await?;
    let stop = stop_on_signal("stopping: running calls are finished, leases are kept")?;
    add(&library, &campaigns, &stop).await?;
    let coordinator = Coordinator {
        library: library.clone(),
        claim,
        listener,
        dashboard,
        security,
        settings: Settings {
            timing: Timing::of_lease(arguments.lease),
            audit_share: arguments.audit,
            ..Settings::default()
        },
        exit_when_done: arguments.exit_when_done,
    };
    let ended = coordinator.run(stop).await;
    library.close().await;
    ended.map_err(|error| match error {
        CoordinatorError::Library(error) if error.is_wrong_input() => Stop::Input(error.into()),
        CoordinatorError::Security(error) => Stop::Input(error.into()),
        error => Stop::Failure(error.into()),
    })
}

/// Adds all campaigns; if one of them is refused, adds none.
async fn add(
    library: &Library,
    campaigns: &[Campaign],
    stop: &CancellationToken,
) -> Result<(), Stop> {
    let tell = |line: &str| tracing::warn!("{line}");
    for campaign in campaigns {
        continuity::check(library, campaign, tell).await?;
        continuity::tell_what_training_lacks(campaign, tell);
    }
    for campaign in campaigns {
        tracktwin_farm::campaign::insert_campaign(library, campaign).await?;
        add_cases(library, campaign, stop).await?;
    }
    Ok(())
}

/// Adds the cases of a campaign, with log lines of the progress.
async fn add_cases(
    library: &Library,
    campaign: &Campaign,
    stop: &CancellationToken,
) -> Result<(), Stop> {
    let id = campaign.id();
    let mut next = Instant::now();
    let tell = |cases: u32, total: u32| {
        if cases == total || next <= Instant::now() {
            next = Instant::now() + TELL_EVERY;
            tracing::info!(campaign = id, cases, total, "adding cases");
        }
    };
    add_cases_told(library, campaign, stop, tell).await
}

impl Arguments {
    fn security(&self) -> anyhow::Result<Security> {
        let identity_pem = match (&self.tls_cert, &self.tls_key) {
            (Some(certificate), Some(key)) => Some([read(certificate)?, read(key)?]),
            _ => None,
        };
        let token = self.token_file.as_deref().map(token).transpose()?;
        let client_ca_pem = self.tls_client_ca.as_deref().map(read).transpose()?;
        Ok(Security { identity_pem, client_ca_pem, token, insecure: self.insecure })
    }
}

fn token(path: &Path) -> anyhow::Result<String> {
    let text = String::from_utf8_lossy(&read(path)?).trim().to_owned();
    anyhow::ensure!(
        !text.is_empty(),
        "{}: the file is empty; create a token with `tracktwin certs`",
        path.display()
    );
    // No worker could present such a token.
    Token::new(&text).with_context(|| path.display().to_string())?;
    Ok(text)
}

/// Returns an error if other machines can reach the dashboard and this is not allowed.
fn check_dashboard(address: Option<SocketAddr>, insecure: bool) -> anyhow::Result<()> {
    let Some(address) = address.filter(|it| !it.ip().is_loopback()) else { return Ok(()) };
    anyhow::ensure!(
        insecure,
        "--dashboard: {address} is reachable from other machines, and the pages are plain HTTP; use 127.0.0.1 with \
         a proxy or `ssh -L`, or --insecure-dashboard on a trusted network"
    );
    Ok(())
}

async fn bind(argument: &str, address: SocketAddr) -> anyhow::Result<TcpListener> {
    let bound = TcpListener::bind(address).await;
    bound.with_context(|| format!("{argument}: cannot bind {address}"))
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let remedy = "write IP:PORT, for example 127.0.0.1:7700, or 0.0.0.0:7700 for all addresses of this machine";
    text.parse().map_err(|_| remedy.to_owned())
}

/// Parses a share, such as `1%` or `0.01`.
fn share(text: &str) -> Result<f64, String> {
    let (number, divisor) = match text.strip_suffix('%') {
        Some(percent) => (percent, 100.0),
        None => (text, 1.0),
    };
    let share = number.trim().parse::<f64>().map(|number| number / divisor);
    match share {
        // A bare 1 could mean 1 or 1%.
        Ok(share) if (0.0..=1.0).contains(&share) && (divisor > 1.0 || share < 1.0) => Ok(share),
        _ => Err("write a share from 0% to 100%, for example 1%".to_owned()),
    }
}

/// Parses the length of a lease in s.
fn lease(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.5..=3600.0).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("write a number of seconds from 0.5 to 3600".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_written_as_percent_or_as_numbers() {
        assert_eq!(share("1%").unwrap(), 0.01);
        assert_eq!(share("0.5").unwrap(), 0.5);
        for wrong in ["", "-1%", "200%", "1", "NaN", "some"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn pages_that_other_machines_reach_need_an_argument_of_their_own() {
        let address = |text: &str| Some(text.parse().unwrap());
        assert!(check_dashboard(None, false).is_ok());
        assert!(check_dashboard(address("127.0.0.1:7780"), false).is_ok());
        assert!(check_dashboard(address("0.0.0.0:7780"), true).is_ok());
        let error = check_dashboard(address("0.0.0.0:7780"), false).unwrap_err().to_string();
        assert!(error.contains("--insecure-dashboard"), "{error}");
    }

    #[test]
    fn leases_are_neither_shorter_than_a_heartbeat_nor_endless() {
        assert_eq!(lease("1.5").unwrap(), Duration::from_millis(1500));
        for wrong in ["0", "0.1", "1e9", "NaN", "soon"] {
            assert!(lease(wrong).is_err(), "{wrong}");
        }
    }
}
