//! A coordinator's life: it claims the library, serves workers, watches, and ends.

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
    /// The library it serves.
    pub library: Library,
    /// The right to do so.
    pub claim: Claim,
    /// The port for workers.
    pub listener: TcpListener,
    /// The port for people, if any.
    pub dashboard: Option<TcpListener>,
    /// Certificates and token.
    pub security: Security,
    /// How it hands out cases.
    pub settings: Settings,
    /// Whether it ends when every running campaign is done.
    pub exit_when_done: bool,
}

/// Errors that stop a coordinator.
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
    #[error("a listening port failed")]
    Port(#[from] std::io::Error),
}

impl Coordinator {
    /// Serves until it is stopped, or until everything is done if requested. Leases stay with their
    /// workers: the next coordinator of the library continues from here.
    ///
    /// # Errors
    /// [`CoordinatorError`].
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

/// Lets this process have as many descriptors as it may: each connection takes one, and the usual bound is
/// 1024.
fn raise_descriptors() {
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    if let Err(error) = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum }) {
        tracing::warn!("the limit of open files cannot be raised: {error}");
    }
}
