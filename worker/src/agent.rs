//! A worker's life: register, lease, simulate, report, until told to stop.

use crate::session::Session;
use crate::simulate::{Prepare, Simulate};
use crate::{Case, Experiment, ExperimentError, Outcome, prepare_simulation};
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracktwin_protocol::{BadMessage, CaseLease, CaseReport, Lease, LeasedCase};

/// Cases simulated side by side on one core: the lanes of the track model's fast solver.
pub const GROUP: usize = 8;

/// How long a worker that is told to stop goes on with what it has begun.
///
/// Batch systems kill ten seconds after they ask; giving back takes what remains.
const GRACE: Duration = Duration::from_secs(8);

/// What a worker is told at its start.
#[derive(Clone, Debug)]
pub struct Config {
    /// Address of the coordinator: `http://HOST:PORT`.
    pub coordinator: String,
    /// Groups of cases simulated at a time.
    pub cores: NonZeroUsize,
    /// The worker's name, unique among workers; see [`unique_name`].
    pub worker: String,
    /// What simulates: [`prepare_simulation`], or a stand-in where the farm is tested.
    pub prepare: Prepare,
    /// Hash of the physics to register with, where it isn't this program's.
    pub model_hash: Option<String>,
}

impl Config {
    /// A worker on this machine that simulates with the track model.
    pub fn new(coordinator: String, cores: NonZeroUsize) -> Self {
        let worker = unique_name();
        Self { coordinator, cores, worker, prepare: prepare_simulation, model_hash: None }
    }
}

/// Why a worker ends before it is told to.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// The address is none.
    #[error("coordinator {url}: not an address; write http://HOST:PORT")]
    Address {
        /// The address.
        url: String,
        /// What is wrong with it.
        source: tonic::transport::Error,
    },
    /// The coordinator refuses the worker, or what it says.
    #[error("refused by the coordinator: {reason}")]
    Refused {
        /// Why.
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

/// Works for a coordinator until `shutdown`; then what has begun is finished and handed in within
/// a grace of eight seconds, and the rest is given back.
///
/// # Errors
/// [`AgentError`] when the coordinator refuses the worker or can't be understood. An unreachable
/// coordinator is no error: it is tried again until `shutdown`.
pub async fn run(config: Config, shutdown: CancellationToken) -> Result<(), AgentError> {
    // One core that fails stops the others, but not the caller.
    let shutdown = shutdown.child_token();
    let give_up = CancellationToken::new();
    let session = Arc::new(Session::new(&config, shutdown.clone(), give_up.clone())?);
    session.register(0).await?;

    let mut side_tasks = JoinSet::new();
    let alive = session.clone();
    side_tasks.spawn(async move { alive.keep_alive().await });
    let asked = shutdown.clone();
    side_tasks.spawn(async move {
        asked.cancelled().await;
        tokio::time::sleep(GRACE).await;
        give_up.cancel();
    });

    let prepared = Arc::new(Prepared { prepare: config.prepare, latest: Mutex::default() });
    let mut cores = JoinSet::new();
    for _ in 0..config.cores.get() {
        cores.spawn(core(session.clone(), prepared.clone()));
    }
    let mut outcome = Ok(());
    while let Some(ended) = cores.join_next().await {
        let ended = ended.expect("a core's task does not panic: what it computes is caught");
        if ended.is_err() {
            shutdown.cancel();
            outcome = outcome.and(ended);
        }
    }
    outcome
}

/// What one core does: a lease at a time, a group of cases at a time.
async fn core(session: Arc<Session>, prepared: Arc<Prepared>) -> Result<(), AgentError> {
    while let Some(lease) = session.lease().await? {
        match lease {
            Lease::Cases(lease) => work(&session, &prepared, &lease).await?,
            Lease::NoneNow { retry_after_s } => {
                let wait = Duration::try_from_secs_f64(retry_after_s).unwrap_or(Duration::MAX);
                tokio::select! {
                    () = tokio::time::sleep(wait) => {}
                    () = session.shutdown.cancelled() => {}
                }
            }
        }
    }
    Ok(())
}

/// Simulates and reports what was leased, or gives back what is left at shutdown.
async fn work(session: &Session, prepared: &Prepared, lease: &CaseLease) -> Result<(), AgentError> {
    let held = |cases: &[LeasedCase]| cases.iter().map(|it| (it.case.index, it.epoch)).collect();
    let simulation = match prepared.of(lease) {
        Ok(simulation) => simulation,
        Err(error) => {
            session.release(lease, held(&lease.cases)).await;
            return Err(error);
        }
    };
    for (number, group) in lease.cases.chunks(GROUP).enumerate() {
        let rest = &lease.cases[number * GROUP..];
        if session.shutdown.is_cancelled() {
            session.release(lease, held(rest)).await;
            break;
        }
        let simulation = simulation.clone();
        let cases: Vec<Case> = group.iter().map(|leased| leased.case.clone()).collect();
        let begun = Instant::now();
        let computed = tokio::task::spawn_blocking(move || guarded(simulation.as_ref(), &cases));
        let outcomes = tokio::select! {
            outcomes = computed => outcomes.expect("what is computed is caught when it panics"),
            () = session.give_up.cancelled() => {
                session.release(lease, held(rest)).await;
                break;
            }
        };
        let duration_s = begun.elapsed().as_secs_f64() / group.len() as f64;
        session.report(lease, reports(group, outcomes, duration_s)).await?;
    }
    Ok(())
}

fn reports(group: &[LeasedCase], outcomes: Vec<Outcome>, duration_s: f64) -> Vec<CaseReport> {
    assert_eq!(group.len(), outcomes.len(), "one outcome a case");
    let report = |(leased, outcome): (&LeasedCase, Outcome)| CaseReport {
        index: leased.case.index,
        epoch: leased.epoch,
        parameter_hash: leased.case.parameter_hash(),
        duration_s,
        outcome,
    };
    group.iter().zip(outcomes).map(report).collect()
}

/// Simulates; a case that panics is a case that fails, and leaves its group alone.
fn guarded(simulation: &dyn Simulate, cases: &[Case]) -> Vec<Outcome> {
    match catch_unwind(AssertUnwindSafe(|| simulation.simulate(cases))) {
        Ok(outcomes) => outcomes,
        Err(_) if cases.len() > 1 => {
            cases.chunks(1).flat_map(|case| guarded(simulation, case)).collect()
        }
        Err(panic) => {
            let message = panic.downcast_ref::<String>().map(String::as_str);
            let message = message.or_else(|| panic.downcast_ref::<&str>().copied());
            let reason = format!("the program panicked: {}", message.unwrap_or("without words"));
            vec![Outcome::Failed { reason }; cases.len()]
        }
    }
}

/// The simulation of the latest experiment: campaigns seldom change.
struct Prepared {
    prepare: Prepare,
    latest: Mutex<Option<(String, Arc<dyn Simulate>)>>,
}

impl Prepared {
    fn of(&self, lease: &CaseLease) -> Result<Arc<dyn Simulate>, AgentError> {
        let mut latest = self.latest.lock().expect("preparing does not panic");
        if let Some((hash, simulation)) = latest.as_ref()
            && *hash == lease.experiment_hash
        {
            return Ok(simulation.clone());
        }
        let experiment = Experiment::from_json(&lease.experiment_json)?;
        if experiment.hash() != lease.experiment_hash {
            return Err(AgentError::ExperimentHash);
        }
        let simulation: Arc<dyn Simulate> = (self.prepare)(&experiment)?.into();
        *latest = Some((lease.experiment_hash.clone(), simulation.clone()));
        Ok(simulation)
    }
}

/// A name that no other worker has: host, process, and chance.
pub fn unique_name() -> String {
    let host = std::fs::read_to_string("/etc/hostname").unwrap_or_default();
    let host = if host.trim().is_empty() { "worker" } else { host.trim() };
    let chance = (crate::backoff::random_unit() * f64::from(u32::MAX)) as u32;
    format!("{host}-{}-{chance:08x}", std::process::id())
}
