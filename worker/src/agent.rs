//! A worker's life: register, lease, simulate, report, until told to stop.

use crate::core::{Core, Prepared};
use crate::counters::Counters;
use crate::credentials::{Credentials, CredentialsError};
use crate::health;
use crate::holdings::Holdings;
use crate::outbox::{outbox, send};
use crate::session::Session;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tonic::transport::{Channel, Endpoint};
use tracktwin_experiment::{ExperimentError, Prepare, prepare_simulation};
use tracktwin_protocol::BadMessage;

/// Cases simulated side by side on one core: the lanes of the track model's fast solver.
pub const GROUP: usize = 8;

/// How long a worker that is told to stop goes on with what it has begun.
///
/// Batch systems kill ten seconds after they ask; giving back takes what remains.
const GRACE: Duration = Duration::from_secs(8);

/// How a line to a coordinator is made.
pub type Dial = fn(&Endpoint) -> Channel;

/// What a worker is told at its start.
#[derive(Clone, Debug)]
pub struct Config {
    /// Addresses of coordinators that serve one library; `http://HOST:PORT` or `https://HOST:PORT`.
    /// When one does not answer, the next is asked.
    pub coordinators: Vec<String>,
    /// Groups of cases simulated at a time.
    pub cores: NonZeroUsize,
    /// The worker's name, unique among workers; see [`unique_name`].
    pub worker: String,
    /// How it and its coordinators trust each other.
    pub credentials: Credentials,
    /// How long to try while no coordinator answers; for ever if none.
    pub give_up_after: Option<Duration>,
    /// How long to wait for work before it ends; for ever if none.
    pub idle_exit: Option<Duration>,
    /// What simulates: [`prepare_simulation`], or a stand-in where the farm is tested.
    pub prepare: Prepare,
    /// Hash of the physics to register with, where it isn't this program's.
    pub model_hash: Option<String>,
    /// [`Endpoint::connect_lazy`], or a simulated network's.
    pub dial: Dial,
    /// Whether to simulate on the task that leases, rather than on a thread of its own: where
    /// network and time are simulated, nothing may run beside them.
    pub inline: bool,
    /// What it counts.
    pub counters: Arc<Counters>,
    /// What it holds.
    pub holdings: Holdings,
}

impl Config {
    /// A worker that simulates with the track model for a coordinator on this machine.
    pub fn new(coordinator: String, cores: NonZeroUsize) -> Self {
        let counters = Arc::<Counters>::default();
        let holdings = Holdings::new(&counters);
        Self {
            coordinators: vec![coordinator],
            cores,
            worker: unique_name(),
            credentials: Credentials::default(),
            give_up_after: None,
            idle_exit: None,
            prepare: prepare_simulation,
            model_hash: None,
            dial: Endpoint::connect_lazy,
            inline: false,
            counters,
            holdings,
        }
    }
}

/// Why a worker ends before it is told to.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// No address at all.
    #[error("no coordinator is named; write --coordinator URL")]
    NoCoordinator,
    /// The address or the certificates can't be used.
    #[error("coordinator {url}: cannot be called")]
    Address {
        /// The address.
        url: String,
        /// What is wrong with it.
        source: tonic::transport::Error,
    },
    /// Address and credentials don't go together.
    #[error(transparent)]
    Credentials(#[from] CredentialsError),
    /// The coordinator refuses the worker, or what it says.
    #[error("refused by the coordinator: {reason}")]
    Refused {
        /// Why.
        reason: String,
    },
    /// The coordinator can't make sense of what the worker says.
    #[error("the coordinator does not understand this worker: {reason}")]
    NotUnderstood {
        /// What it says.
        reason: String,
    },
    /// No coordinator has answered for longer than was asked for.
    #[error("no coordinator answered for {silent_s} s: {reason}")]
    GaveUp {
        /// For how long, in s.
        silent_s: u64,
        /// What the last try came to.
        reason: String,
    },
    /// The coordinator does not know the worker (any more).
    #[error("the coordinator does not know this worker")]
    Unknown,
    /// The coordinator says what this worker does not understand.
    #[error("the coordinator's message makes no sense here: {0}")]
    BadMessage(#[from] BadMessage),
    /// The experiment can't be done here.
    #[error("the campaign's experiment cannot be done: {0}")]
    Experiment(#[from] ExperimentError),
    /// The experiment is not the one whose hash came with it.
    #[error("the campaign's experiment does not have the hash that came with it")]
    ExperimentHash,
}

impl AgentError {
    /// Whether the same worker might succeed when it is started again.
    pub const fn may_pass(&self) -> bool {
        matches!(self, Self::GaveUp { .. })
    }
}

/// Works for a coordinator until `shutdown`; then what has begun is finished and handed in within
/// a grace of eight seconds, and the rest is given back. `health` answers how it is, if given.
///
/// # Errors
/// [`AgentError`] when the coordinator refuses the worker or can't be understood. An unreachable
/// coordinator is tried again until `shutdown`, or for as long as the worker was told to.
pub async fn run(config: Config, shutdown: CancellationToken) -> Result<(), AgentError> {
    run_with_health(config, None, shutdown).await
}

/// [`run`], and answers on a port how it is.
///
/// # Errors
/// As [`run`].
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
            inline: config.inline,
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

/// A name that no other worker has: host, process, and chance.
pub fn unique_name() -> String {
    let host = std::fs::read_to_string("/etc/hostname").unwrap_or_default();
    let host = if host.trim().is_empty() { "worker" } else { host.trim() };
    let chance = (crate::backoff::random_unit() * f64::from(u32::MAX)) as u32;
    format!("{host}-{}-{chance:08x}", std::process::id())
}
