//! Life cycle of a coordinator: it claims the library, serves workers, monitors the campaigns, and ends.

mod watch;

use crate::dashboard::{self, Dashboard};
use crate::dispatch::{Counts, Dispatch, Settings};
use crate::security::{Security, SecurityError};
use crate::serve::{ServeError, serve};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracktwin_library::{Claim, Library, LibraryError};
use watch::watch;

/// Configuration of a coordinator.
pub struct Coordinator {
    /// The library to serve.
    pub library: Library,
    /// The claim on this library.
    pub claim: Claim,
    /// The listening port for workers.
    pub listener: TcpListener,
    /// The listening port for the dashboard, if there is one.
    pub dashboard: Option<TcpListener>,
    /// Certificates and token of both ports.
    pub security: Security,
    /// Settings of the dispatch of cases.
    pub settings: Settings,
    /// Whether the coordinator ends when every running campaign is done.
    pub exit_when_done: bool,
}

/// Errors that stop a coordinator.
#[derive(Debug, thiserror::Error)]
pub enum CoordinatorError {
    /// The library returned an error.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The gRPC service failed.
    #[error(transparent)]
    Serve(#[from] ServeError),
    /// A port would be reachable from other machines without protection.
    #[error(transparent)]
    Security(#[from] SecurityError),
    /// The address of a listening port cannot be determined.
    #[error("a listening port failed")]
    Port(#[from] std::io::Error),
}

impl Coordinator {
    /// Serves until `stop` is cancelled or, with `exit_when_done`, until every running campaign is done.
    /// Leases stay valid: the next coordinator of the library continues with them.
    ///
    /// # Errors
    /// Returns [`CoordinatorError`] if the library, the service or a port fails.
    pub async fn run(self, stop: CancellationToken) -> Result<(), CoordinatorError> {
        let address = self.listener.local_addr()?;
        raise_descriptors();
        self.security.check(address)?;
        let _claim = self.claim;
        let stop = stop.child_token();
        // All tasks end with this function.
        let _guard = stop.clone().drop_guard();
        let counts = Counts::default();
        let dispatch = Dispatch::new(self.library.clone(), self.settings, counts.clone());
        if let Some(listener) = self.dashboard {
            let dashboard_address = listener.local_addr()?;
            let dashboard =
                Dashboard::new(self.library.clone(), counts, &self.security, dashboard_address);
            tracing::info!(%dashboard_address, "the dashboard is at http://{dashboard_address}/");
            tokio::spawn(dashboard::serve(listener, dashboard, stop.clone()));
        }
        tracing::info!(%address, library = self.library.name(), "coordinator started");
        let watch = tokio::spawn(watch(self.library, self.exit_when_done, stop.clone()));
        let served = serve(self.listener, dispatch, &self.security, stop.clone()).await;
        stop.cancel();
        let watched = watch.await.expect("watching does not panic");
        tracing::info!("coordinator stopped");
        served?;
        Ok(watched?)
    }
}

/// Raises the limit of open file descriptors to its maximum. Each connection needs one descriptor, and the
/// usual limit is 1024.
fn raise_descriptors() {
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    if let Err(error) = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum }) {
        tracing::warn!("the limit of open files cannot be raised: {error}");
    }
}
