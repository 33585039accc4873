//! The farm in one process: a coordinator and a worker that communicate as on a cluster.

use crate::dispatch::{
    Counts, Dispatch, DispatchError, LibraryFaults, Scope, Settings, Timing, WorkerCall,
};
use crate::security::{Security, random_token};
use crate::serve::{ServeError, serve};
use std::collections::HashMap;
use std::net::Ipv4Addr;
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinHandle};
use tokio_util::sync::{CancellationToken, DropGuard};
use tracktwin_experiment::{Prepare, prepare_simulation};
use tracktwin_library::{CampaignState, Claim, Library, LibraryError, Status};
use tracktwin_worker::agent::{self, AgentError};
use tracktwin_worker::{Credentials, Holdings, Token};

/// Interval of reading the counts of cases; short enough for a progress bar.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Maximum outage of a library, as for a blind trial. A longer outage ends the run.
const OUTAGE_MAX: Duration = Duration::from_mins(10);

/// An error this long after the last one begins another outage.
const RESPONDED_AFTER: Duration = Duration::from_mins(1);

/// Errors that end an embedded farm.
#[derive(Debug, thiserror::Error)]
pub enum FarmError {
    /// The library returned an error.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The campaign cannot be dispatched.
    #[error(transparent)]
    Dispatch(#[from] DispatchError),
    /// Somebody paused or cancelled the campaign, or a coordinator did so because it cannot dispatch it.
    #[error(
        "campaign {campaign} was {} meanwhile; its results are kept, and the same command continues it",
        .state.name()
    )]
    NotRunning {
        /// Id of the campaign.
        campaign: String,
        /// Its state.
        state: CampaignState,
    },
    /// The worker ended with an error.
    #[error("the workers stopped: {0}")]
    Worker(#[from] AgentError),
    /// The gRPC service failed.
    #[error(transparent)]
    Service(#[from] ServeError),
    /// No port can be bound.
    #[error("the farm's service cannot bind a port")]
    Port(#[from] std::io::Error),
}

/// The cases to simulate, and how to simulate them.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// Id of the campaign.
    pub campaign: &'a str,
    /// Number of cases, counted from index 0.
    pub cases: u32,
    /// Number of groups of cases that are simulated in parallel.
    pub cores: NonZeroUsize,
    /// Length of the leases, and the derived intervals.
    pub timing: Timing,
    /// Creates the simulator: the track model or, in tests of the farm, a stand-in.
    pub prepare: Prepare,
}

impl<'a> Task<'a> {
    /// The first `cases` cases of a campaign, simulated with the track model.
    pub fn new(campaign: &'a str, cases: u32, cores: NonZeroUsize) -> Self {
        let timing = Timing::default();
        Self { campaign, cases, cores, timing, prepare: prepare_simulation }
    }
}

/// Claims the right to lease the cases of a library, and checks that the library can be written. The holder
/// of the claim may also add cases.
///
/// # Errors
/// Returns [`LibraryError::InUse`] if another process has the claim, or [`LibraryError::NotWritable`].
pub async fn claim(library: &Library) -> Result<Claim, FarmError> {
    let claim = library.claim()?;
    library.check_writable().await?;
    Ok(claim)
}

/// Calls [`claim`] and then [`run_claimed`].
///
/// # Errors
/// The errors of both functions.
pub async fn run_embedded(
    library: &Library,
    task: Task<'_>,
    shutdown: CancellationToken,
    progress: impl FnMut(Status),
) -> Result<Status, FarmError> {
    let claim = claim(library).await?;
    run_claimed(library, &claim, task, shutdown, progress).await
}

/// Simulates the missing cases of a claimed library in this process, until every case is finished or given
/// up, or until `shutdown` is cancelled. A later call continues the run. Finished cases are stored even if
/// the process is killed. Calls to an unavailable library are retried for a limited time.
///
/// `progress` is called regularly with the counts of cases by state.
///
/// # Errors
/// Returns [`FarmError`] if the library, the dispatch, the worker or the service fails.
pub async fn run_claimed(
    library: &Library,
    claim: &Claim,
    task: Task<'_>,
    shutdown: CancellationToken,
    mut progress: impl FnMut(Status),
) -> Result<Status, FarmError> {
    let own = agent::Config::new(String::new(), task.cores);
    let faults = LibraryFaults::default();
    let dispatch = dispatch(library, claim, &task, own.holdings.clone(), faults.clone()).await?;
    let config = agent::Config { prepare: task.prepare, ..own };
    let mut farm = Running::begin(dispatch, config, &shutdown).await?;
    let watched = farm.watch(library, &task, &faults, &shutdown, &mut progress).await;
    if let Err(error @ FarmError::NotRunning { .. }) = watched {
        // The results of what is in work are stored.
        farm.end(None).await?;
        return Err(error);
    }
    farm.end(watched?).await?;
    let status = library.status_of(task.campaign, task.cases).await?;
    progress(status);
    Ok(status)
}

/// Checks that the cases of a campaign are leased. A library that is away is not an error here.
async fn check_running(library: &Library, campaign: &str) -> Result<(), FarmError> {
    match library.campaign_state(campaign).await {
        Ok(state) if state != CampaignState::Running => {
            Err(FarmError::NotRunning { campaign: campaign.to_owned(), state })
        }
        _ => Ok(()),
    }
}

/// Result of the worker's task.
type Ended = Result<Result<(), AgentError>, JoinError>;

/// The tasks of the service and of its worker. Both tasks stop when this value is dropped.
struct Running {
    worker: JoinHandle<Result<(), AgentError>>,
    server: JoinHandle<Result<(), ServeError>>,
    stop_working: DropGuard,
    stop_serving: DropGuard,
}

impl Running {
    /// Starts the service on a free port of this machine, and the worker.
    async fn begin(
        dispatch: Dispatch,
        config: agent::Config,
        shutdown: &CancellationToken,
    ) -> Result<Self, FarmError> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let coordinators = vec![format!("http://{}", listener.local_addr()?)];
        // Other users of the machine reach the port as well.
        let token = random_token()?.to_string();
        let credentials = Credentials {
            token: Some(Token::new(&token).expect("hexadecimal digits are fit for a token")),
            ..Credentials::default()
        };
        let security = Security { token: Some(token), ..Security::default() };
        let (stop_working, stop_serving) = (shutdown.child_token(), CancellationToken::new());
        let stop = stop_serving.clone();
        let server = tokio::spawn(async move { serve(listener, dispatch, &security, stop).await });
        let config = agent::Config { credentials, coordinators, ..config };
        let worker = tokio::spawn(agent::run(config, stop_working.clone()));
        let (stop_working, stop_serving) = (stop_working.drop_guard(), stop_serving.drop_guard());
        Ok(Self { worker, server, stop_working, stop_serving })
    }

    /// Reads the counts until every case is done or `shutdown` is cancelled; then returns `None`. If the
    /// worker ends earlier, returns the worker's result. `faults` has the outcomes of the worker's calls.
    async fn watch(
        &mut self,
        library: &Library,
        task: &Task<'_>,
        faults: &LibraryFaults,
        shutdown: &CancellationToken,
        progress: &mut impl FnMut(Status),
    ) -> Result<Option<Ended>, FarmError> {
        let mut outages = Outages::default();
        loop {
            library.takes_writes()?;
            for (call, error) in faults.take() {
                outages.note(Some(call), error)?;
            }
            match library.status_of(task.campaign, task.cases).await {
                Ok(status) => {
                    outages.note(None, None)?;
                    progress(status);
                    if status.done() == status.total() {
                        return Ok(None);
                    }
                    check_running(library, task.campaign).await?;
                }
                Err(error) => outages.note(None, Some(error))?,
            }
            if shutdown.is_cancelled() {
                return Ok(None);
            }
            tokio::select! {
                () = tokio::time::sleep(LOOK_EVERY) => {}
                () = shutdown.cancelled() => {}
                ended = &mut self.worker => return Ok(Some(ended)),
            }
        }
    }

    /// Stops the worker, unless its result is given in `ended`; then stops the service.
    async fn end(self, ended: Option<Ended>) -> Result<(), FarmError> {
        // The worker hands in what it has begun, so it must end before the service.
        drop(self.stop_working);
        let ended = match ended {
            Some(ended) => ended,
            None => self.worker.await,
        };
        drop(self.stop_serving);
        self.server.await.expect("the service does not panic")?;
        ended.expect("a worker does not panic: what it computes is caught")?;
        Ok(())
    }
}

/// Present outages of the library: of a worker's call, or of reading the counts (`None`).
#[derive(Default)]
struct Outages(HashMap<Option<WorkerCall>, Outage>);

#[derive(Clone, Copy)]
struct Outage {
    since: Instant,
    last: Instant,
}

impl Outages {
    /// Notes the outcome of a call. Returns `Ok` if the library may respond later. The workers keep their
    /// results until then.
    ///
    /// # Errors
    /// Returns `error` if waiting does not help, or if the outage is longer than [`OUTAGE_MAX`].
    fn note(
        &mut self,
        call: Option<WorkerCall>,
        error: Option<LibraryError>,
    ) -> Result<(), LibraryError> {
        let Some(error) = error else {
            self.0.remove(&call);
            return Ok(());
        };
        // What is written to a removed file is lost.
        if !error.is_temporary() || matches!(error, LibraryError::FileGone { .. }) {
            return Err(error);
        }
        let now = Instant::now();
        if self.0.is_empty() {
            tracing::warn!("{error}; waiting for up to {} minutes", OUTAGE_MAX.as_secs() / 60);
        }
        let known = self.0.get(&call);
        let known = known.filter(|it| now.duration_since(it.last) < RESPONDED_AFTER);
        let since = known.map_or(now, |outage| outage.since);
        self.0.insert(call, Outage { since, last: now });
        if now.duration_since(since) < OUTAGE_MAX { Ok(()) } else { Err(error) }
    }
}

/// Creates the dispatch of a campaign's cases.
async fn dispatch(
    library: &Library,
    claim: &Claim,
    task: &Task<'_>,
    own: Holdings,
    faults: LibraryFaults,
) -> Result<Dispatch, FarmError> {
    if claim.is_exclusive() {
        // Whoever held these died with the process that served it.
        library.release_all(task.campaign).await?;
    }
    // Running a paused or cancelled campaign resumes it.
    library.resume(task.campaign).await?;
    let settings = Settings {
        timing: task.timing,
        scope: Some(Scope { campaign: task.campaign.to_owned(), cases: task.cases }),
        // There is no other machine to turn to.
        suspends_failing: false,
        own: Some(own),
        faults,
        ..Settings::default()
    };
    let dispatch = Dispatch::new(library.clone(), settings, Counts::default());
    dispatch.check(task.campaign).await?;
    Ok(dispatch)
}

#[cfg(test)]
mod tests {
    use super::*;

    const REPORT: Option<WorkerCall> = Some(WorkerCall::Report);

    /// Outages with one of reports that began and was last noticed at these times before now.
    fn outages(began: Duration, noticed: Duration) -> Outages {
        let before = |time| Instant::now().checked_sub(time).unwrap();
        let outage = Outage { since: before(began), last: before(noticed) };
        Outages(HashMap::from([(REPORT, outage)]))
    }

    #[test]
    fn results_that_cannot_be_stored_end_a_run_after_the_time_limit() {
        let mut fresh = Outages::default();
        fresh.note(REPORT, Some(LibraryError::DiskFull)).unwrap();
        let mut long = outages(OUTAGE_MAX, Duration::from_secs(4));
        // The counts can be read all the time, and leases be written.
        long.note(None, None).unwrap();
        long.note(Some(WorkerCall::Lease), None).unwrap();
        let error = long.note(REPORT, Some(LibraryError::DiskFull)).unwrap_err();
        assert!(matches!(error, LibraryError::DiskFull));
        // Somebody freed space meanwhile, or there was nothing to store for a time.
        let mut over = outages(OUTAGE_MAX, Duration::from_secs(4));
        over.note(REPORT, None).unwrap();
        over.note(REPORT, Some(LibraryError::DiskFull)).unwrap();
        let mut another = outages(OUTAGE_MAX, 2 * RESPONDED_AFTER);
        another.note(REPORT, Some(LibraryError::DiskFull)).unwrap();
    }

    #[test]
    fn what_waiting_does_not_mend_ends_a_run_at_once() {
        let gone = LibraryError::FileGone { library: "l".to_owned() };
        for error in [gone, LibraryError::Closed] {
            assert!(Outages::default().note(REPORT, Some(error)).is_err());
        }
    }
}
