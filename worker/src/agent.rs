//! The worker's main loop: register, lease, simulate, report, until it is stopped.

pub use crate::config::{Config, Dial, Seams, unique_name};
pub use crate::core::GROUP;
pub use crate::error::AgentError;

use crate::core::{Core, Prepared};
use crate::health;
use crate::outbox::{outbox, send};
use crate::session::Session;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// Time limit of the cases in progress after a worker is stopped.
///
/// Batch systems kill a process ten seconds after the stop signal. The remaining time is for returning
/// cases.
const GRACE: Duration = Duration::from_secs(8);

/// Runs a worker until `shutdown`. Cases in progress are then finished and reported within eight
/// seconds; the others are returned.
///
/// # Errors
/// [`AgentError`] if the coordinator rejects the worker or sends invalid messages. Calls to an
/// unreachable coordinator are retried until `shutdown`, or for the configured time.
pub async fn run(config: Config, shutdown: CancellationToken) -> Result<(), AgentError> {
    run_with_health(config, None, shutdown).await
}

/// Runs a worker like [`run`], and serves its state on a port for monitoring.
///
/// # Errors
/// The errors of [`run`].
pub async fn run_with_health(
    config: Config,
    port: Option<TcpListener>,
    shutdown: CancellationToken,
) -> Result<(), AgentError> {
    // One core that fails stops the others, but not the caller.
    let shutdown = shutdown.child_token();
    let give_up = CancellationToken::new();
    let session = Arc::new(Session::new(&config, shutdown.clone(), give_up.clone())?);

    // Dropped, and with it ended, when this function returns.
    let mut side_tasks = JoinSet::new();
    if let Some(port) = port {
        side_tasks.spawn(health::answer(port, session.clone(), config.counters.clone()));
    }
    let asked = shutdown.clone();
    side_tasks.spawn(async move {
        asked.cancelled().await;
        tokio::time::sleep(GRACE).await;
        give_up.cancel();
    });
    session.register(0, &shutdown).await?;
    let alive = session.clone();
    side_tasks.spawn(async move { alive.keep_alive().await });

    let prepared = Arc::new(Prepared::new(config.prepare));
    let (outbox, finished) = outbox();
    let mut tasks = JoinSet::new();
    tasks.spawn(send(session.clone(), finished));
    for _ in 0..config.cores.get() {
        let core = Core {
            session: session.clone(),
            prepared: prepared.clone(),
            outbox: outbox.clone(),
            counters: config.counters.clone(),
            idle_exit: config.idle_exit,
            inline: config.seams.inline,
        };
        tasks.spawn(core.run());
    }
    drop(outbox);
    let mut outcome = Ok(());
    while let Some(ended) = tasks.join_next().await {
        let ended = ended.expect("a worker's task does not panic: what it computes is caught");
        if ended.is_err() {
            shutdown.cancel();
            outcome = outcome.and(ended);
        }
    }
    outcome
}
