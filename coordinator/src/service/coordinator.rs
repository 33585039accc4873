//! A coordinator's life: it claims the library, serves workers, watches, and ends.

use super::{Security, SecurityError, ServeError, serve};
use crate::dashboard::{self, Dashboard};
use crate::dispatch::{Counts, Dispatch, Settings};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracktwin_library::{CampaignState, Library, LibraryError};

/// How often the campaigns are looked at.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Between two lines of the log about how far it is.
const TELL_EVERY: Duration = Duration::from_mins(1);

/// A worker heard of within this many ms is there.
const PRESENT_MS: i64 = 60_000;

/// What a coordinator is started with.
pub struct Coordinator {
    /// The library it serves.
    pub library: Library,
    /// The port for workers.
    pub listener: TcpListener,
    /// The port for people, if any.
    pub dashboard: Option<TcpListener>,
    /// What it demands of those who call it.
    pub security: Security,
    /// How it hands out cases.
    pub settings: Settings,
    /// Whether it ends when every running campaign is done.
    pub exit_when_done: bool,
}

/// Why a coordinator ends before it is told to.
#[derive(Debug, thiserror::Error)]
pub enum CoordinatorError {
    /// The library fails or refuses.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The service fails.
    #[error(transparent)]
    Serve(#[from] ServeError),
    /// A port would be open to anybody.
    #[error(transparent)]
    Security(#[from] SecurityError),
    /// A port has no address.
    #[error("a port was lost")]
    Port(#[from] std::io::Error),
}

impl Coordinator {
    /// Serves until told to stop, or until everything is done where that was asked for. Leases stay
    /// with their workers: whoever serves the library next goes on where this ended.
    ///
    /// # Errors
    /// [`CoordinatorError`]; [`LibraryError::InUse`] where another process serves the library and
    /// its database admits only one.
    pub async fn run(self, stop: CancellationToken) -> Result<(), CoordinatorError> {
        let address = self.listener.local_addr()?;
        self.security.check(address)?;
        let _claim = self.library.claim()?;
        let stop = stop.child_token();
        // However this ends, nothing goes on behind its back.
        let _guard = stop.clone().drop_guard();
        let counts = Counts::default();
        let dispatch = Dispatch::new(self.library.clone(), self.settings, counts.clone());
        if let Some(listener) = self.dashboard {
            let dashboard_address = listener.local_addr()?;
            let dashboard = Dashboard::new(
                self.library.clone(),
                counts,
                self.security.token.as_deref(),
                dashboard_address,
            );
            tracing::info!(%dashboard_address, "the dashboard is at http://{dashboard_address}/");
            tokio::spawn(dashboard::serve(listener, dashboard, stop.clone()));
        }
        tracing::info!(%address, library = self.library.name(), "coordinator serves");
        let watch = tokio::spawn(watch(self.library, self.exit_when_done, stop.clone()));
        let served = serve(self.listener, dispatch, &self.security, stop.clone()).await;
        stop.cancel();
        watch.await.expect("watching does not panic");
        tracing::info!("coordinator ends");
        Ok(served?)
    }
}

/// Looks at the campaigns until told to stop, or until there is nothing left to do.
async fn watch(library: Library, exit_when_done: bool, stop: CancellationToken) {
    let mut told = None::<tokio::time::Instant>;
    while !stop.is_cancelled() {
        match left(&library).await {
            Ok(left) => {
                if told.is_none_or(|told| told.elapsed() >= TELL_EVERY) {
                    told = Some(tokio::time::Instant::now());
                    tracing::info!(left = left.cases, "cases left");
                }
                if left.is_done() && exit_when_done {
                    match left.audits {
                        0 => tracing::info!("everything is done"),
                        audits => tracing::warn!(
                            audits,
                            "done but for audits that no other worker is there for"
                        ),
                    }
                    stop.cancel();
                }
            }
            Err(error) => tracing::error!("the library does not answer: {error}"),
        }
        tokio::select! {
            () = tokio::time::sleep(LOOK_EVERY) => {}
            () = stop.cancelled() => {}
        }
    }
}

/// What is left to be simulated, in campaigns that run.
#[derive(Default)]
struct Left {
    cases: u64,
    /// Open audits.
    audits: u64,
    /// Those of them that a worker who is there could do.
    audits_to_do: u64,
}

impl Left {
    const fn is_done(&self) -> bool {
        self.cases + self.audits_to_do == 0
    }
}

async fn left(library: &Library) -> Result<Left, LibraryError> {
    let mut left = Left::default();
    let since_unix_ms = library.now_unix_ms() - PRESENT_MS;
    for campaign in library.overview().await? {
        if campaign.state == CampaignState::Running {
            left.cases += u64::from(campaign.status.total() - campaign.status.done());
            left.audits += u64::from(library.audits(&campaign.id).await?.open);
            let to_do = library.audits_to_do(&campaign.id, since_unix_ms).await?;
            left.audits_to_do += u64::from(to_do);
        }
    }
    Ok(left)
}
