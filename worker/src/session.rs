//! Calls of a worker to its coordinators. Each call is repeated until there is a response.

use crate::config::Config;
use crate::coordinators::Coordinators;
use crate::counters::Counters;
use crate::error::AgentError;
use crate::finished::Finished;
use crate::holdings::Holdings;
use parking_lot::Mutex;
use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::RwLock;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::Code;
use tracktwin_experiment::{CODE_VERSION, Outcome};
use tracktwin_protocol::{Lease, PROTOCOL_VERSION, Registration, farm, held_to_messages};
use tracktwin_traces::Step;

/// Number of cases requested at a time. The coordinator leases fewer cases, according to their computing
/// time.
const CASES_ASKED: u32 = 1024;

/// Heartbeat interval until the coordinator states one.
const FIRST_HEARTBEAT: Duration = Duration::from_secs(1);

/// Limits of the heartbeat interval that a coordinator may request.
const HEARTBEATS_S: [f64; 2] = [0.05, 60.0];

/// Number of attempts for a message that is damaged in transmission. After that, results are
/// dropped and their leases expire; a sender of invalid messages is treated as another version.
const DAMAGED_MAX: u32 = 5;

/// Wait before the next attempt; it grows with the number of attempts.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

/// Time limit of a call after a stop: a scheduler allows ten seconds in all.
const RELEASE_TIMEOUT: Duration = Duration::from_millis(1500);

/// State that the tasks of a worker share.
pub(crate) struct Session {
    worker: String,
    cores: u32,
    model_hash: String,
    pub(crate) coordinators: Coordinators,
    pub(crate) holdings: Holdings,
    counters: Arc<Counters>,
    heartbeat: Mutex<Duration>,
    last_work: Mutex<Instant>,
    /// Registrations so far; held for writing while one is under way, so that one suffices for all.
    registrations: RwLock<u64>,
    /// After cancellation the worker takes no new work.
    pub(crate) shutdown: CancellationToken,
    /// After cancellation there are no more retries.
    pub(crate) give_up: CancellationToken,
}

impl Session {
    pub(crate) fn new(
        config: &Config,
        shutdown: CancellationToken,
        give_up: CancellationToken,
    ) -> Result<Self, AgentError> {
        Ok(Self {
            worker: config.worker.clone(),
            cores: u32::try_from(config.cores.get()).unwrap_or(u32::MAX),
            model_hash: config.seams.model_hash.clone(),
            coordinators: Coordinators::new(config, give_up.clone())?,
            holdings: config.holdings.clone(),
            counters: config.counters.clone(),
            heartbeat: Mutex::new(FIRST_HEARTBEAT),
            last_work: Mutex::new(Instant::now()),
            registrations: RwLock::new(0),
            shutdown,
            give_up,
        })
    }

    /// Registers the worker, unless another task has already registered it after `seen` registrations.
    pub(crate) async fn register(
        &self,
        seen: u64,
        end: &CancellationToken,
    ) -> Result<(), AgentError> {
        let mut registrations = self.registrations.write().await;
        if *registrations > seen {
            return Ok(());
        }
        let registration = Registration {
            worker: self.worker.clone(),
            code_version: CODE_VERSION.to_owned(),
            model_hash: self.model_hash.clone(),
            cores: self.cores,
            protocol_version: PROTOCOL_VERSION,
        };
        let request = farm::RegisterRequest::from(registration);
        let answer = self
            .coordinators
            .ask(end, |mut client| {
                let request = request.clone();
                async move { client.register(request).await }
            })
            .await?;
        let Some(answer) = answer else { return Ok(()) };
        let [shortest, longest] = HEARTBEATS_S;
        if answer.heartbeat_s.is_finite() {
            let heartbeat = Duration::from_secs_f64(answer.heartbeat_s.clamp(shortest, longest));
            *self.heartbeat.lock() = heartbeat;
        }
        *registrations += 1;
        Ok(())
    }

    /// Requests cases to simulate. The result has cases, or the time of the next request; `None` at
    /// shutdown.
    pub(crate) async fn lease(&self) -> Result<Option<Lease>, AgentError> {
        let mut damaged = 0;
        loop {
            let seen = *self.registrations.read().await;
            let request =
                farm::LeaseRequest { worker: self.worker.clone(), cases_max: CASES_ASKED };
            let answer = self
                .coordinators
                .ask(&self.shutdown, |mut client| {
                    let request = request.clone();
                    async move { client.lease(request).await }
                })
                .await;
            match answer {
                Ok(None) => return Ok(None),
                Ok(Some(message)) => {
                    let held = message.cases.iter().map(|it| (it.sobol_index, it.epoch)).collect();
                    let campaign = message.campaign_id.clone();
                    match Lease::try_from(message) {
                        Ok(lease) => {
                            if let Lease::Cases(lease) = &lease {
                                self.holdings.take(lease);
                                self.worked();
                            }
                            return Ok(Some(lease));
                        }
                        Err(error) => {
                            self.release(&campaign, held).await;
                            let what = format!("a lease was damaged in transmission ({error})");
                            if !goes_again(&mut damaged, &what).await {
                                return Err(error.into());
                            }
                        }
                    }
                }
                // The coordinator was restarted, or is another one; it knows no worker.
                Err(AgentError::Unknown) => self.register(seen, &self.shutdown).await?,
                Err(error) => return Err(error),
            }
        }
    }

    /// Reports results. After shutdown the call is retried only until the worker gives up.
    pub(crate) async fn report(&self, finished: Finished) -> Result<(), AgentError> {
        let Finished { campaign, experiment_hash, reports, traceparents } = finished;
        let step = Step::after("hand in", &traceparents);
        let held: Vec<_> = reports.iter().map(|report| (report.index, report.epoch)).collect();
        let failed = reports.iter().filter(|it| matches!(it.outcome, Outcome::Failed { .. }));
        let failed: Vec<u32> = failed.map(|report| report.index).collect();
        let mut request = farm::ReportRequest {
            worker: self.worker.clone(),
            campaign_id: campaign.clone(),
            experiment_hash,
            cases: reports.into_iter().map(Into::into).collect(),
            traceparent: step.traceparent(),
        };
        let mut damaged = 0;
        loop {
            let seen = *self.registrations.read().await;
            let answer = self
                .coordinators
                .ask(&self.give_up, |mut client| {
                    let request = request.clone();
                    async move { client.report(request).await }
                })
                .await;
            match answer {
                Err(AgentError::Unknown) => self.register(seen, &self.give_up).await?,
                Err(error) => {
                    if let AgentError::NotUnderstood { reason } = &error
                        && goes_again(&mut damaged, reason).await
                    {
                        continue;
                    }
                    step.fail(&error.to_string());
                    return Err(error);
                }
                Ok(None) => {
                    step.fail("no response");
                    tracing::warn!("{} results could not be reported", held.len());
                    break;
                }
                Ok(Some(answer)) => {
                    self.count(&answer, &failed);
                    keep_unsettled(&mut request.cases, &answer);
                    if request.cases.is_empty() {
                        break;
                    }
                    let what = format!("{} results arrived damaged", request.cases.len());
                    if !goes_again(&mut damaged, &what).await {
                        step.fail(&what);
                        break;
                    }
                }
            }
        }
        self.counters.unsent.dec_by(i64::try_from(held.len()).unwrap_or(i64::MAX));
        self.holdings.let_go(&campaign, held);
        Ok(())
    }

    /// Counts accepted results and logs a warning for rejected results.
    fn count(&self, answer: &farm::ReportResponse, failed: &[u32]) {
        let refused = |it: &&farm::Receipt| it.verdict() == farm::Verdict::Refused;
        let settled = answer.receipts.iter().filter(|it| is_settled(**it));
        let (refused, taken): (Vec<&farm::Receipt>, Vec<_>) = settled.partition(refused);
        if !refused.is_empty() {
            tracing::warn!(
                "{} results refused: the coordinator does not know these leases, or their cases have other \
                     parameters in the library (`tracktwin library status` lists those)",
                refused.len()
            );
        }
        let of_failures = taken.iter().filter(|it| failed.contains(&it.sobol_index)).count();
        self.counters.failed.inc_by(of_failures as u64);
        self.counters.finished.inc_by((taken.len() - of_failures) as u64);
    }

    /// Returns cases that were not simulated. If the call fails, their leases expire soon.
    pub(crate) async fn release(&self, campaign: &str, held: Vec<(u32, u32)>) {
        self.holdings.let_go(campaign, held.iter().copied());
        let request = farm::ReleaseRequest {
            worker: self.worker.clone(),
            campaign_id: campaign.to_owned(),
            cases: held_to_messages(held),
        };
        let release = |mut client: crate::connection::Client| {
            let request = request.clone();
            async move { client.release(request).await }
        };
        let released = tokio::time::timeout(RELEASE_TIMEOUT, self.coordinators.once(release)).await;
        let failed = match &released {
            Ok(Ok(_)) => return,
            Ok(Err(status)) => status.message(),
            Err(_) => "no response",
        };
        tracing::warn!("cases not returned; their leases will expire: {failed}");
    }

    /// Renews the leases in a separate task, so that computations and slow reports do not delay
    /// heartbeats.
    pub(crate) async fn keep_alive(&self) {
        loop {
            let heartbeat = *self.heartbeat.lock();
            tokio::time::sleep(heartbeat).await;
            for request in self.holdings.renewals(&self.worker) {
                let campaign = request.campaign_id.clone();
                let (cases, sent) = (request.cases.len(), Instant::now());
                tracing::debug!(campaign, cases, "heartbeat sent");
                let renew = |mut client: crate::connection::Client| {
                    let request = request.clone();
                    async move { client.renew(request).await }
                };
                match self.coordinators.once(renew).await {
                    Ok(answer) => {
                        let (after_s, lost) = (sent.elapsed().as_secs_f64(), answer.lost.len());
                        tracing::debug!(campaign, cases, lost, after_s, "heartbeat acknowledged");
                        self.lose(&campaign, &answer.lost);
                    }
                    // The leases are renewed, but the coordinator was restarted, or is another one.
                    Err(status) if status.code() == Code::Unauthenticated => {
                        self.register_again(heartbeat).await;
                    }
                    Err(status) => tracing::info!("heartbeat failed: {}", status.message()),
                }
            }
        }
    }

    /// Registers the worker again, unless it takes longer than `time`: heartbeats must go on.
    async fn register_again(&self, time: Duration) {
        let registered = async {
            let seen = *self.registrations.read().await;
            self.register(seen, &self.shutdown).await
        };
        if let Ok(Err(error)) = tokio::time::timeout(time, registered).await {
            tracing::warn!("not registered again: {error}");
        }
    }

    /// Removes cases whose leases have ended. Those not yet started are skipped.
    fn lose(&self, campaign: &str, lost: &[farm::HeldCase]) {
        // Cases reported or returned during the heartbeat are not counted as lost.
        let lost = self.holdings.let_go(campaign, lost.iter().map(|it| (it.sobol_index, it.epoch)));
        if lost > 0 {
            tracing::warn!("{lost} leases have ended: they expired, or the campaign was cancelled");
            self.counters.lost.inc_by(lost as u64);
        }
    }

    /// Records that the worker has work.
    pub(crate) fn worked(&self) {
        *self.last_work.lock() = Instant::now();
    }

    /// Time since the worker last had work.
    pub(crate) fn idle_for(&self) -> Duration {
        if !self.holdings.is_empty() {
            return Duration::ZERO;
        }
        self.last_work.lock().elapsed()
    }
}

/// Waits before repeating a damaged message; an error after too many attempts.
async fn goes_again(damaged: &mut u32, what: &str) -> bool {
    *damaged += 1;
    tracing::warn!("{what}: {damaged} of {DAMAGED_MAX} times");
    if *damaged >= DAMAGED_MAX {
        return false;
    }
    tokio::time::sleep(AGAIN_AFTER * *damaged).await;
    true
}

/// Whether a case need not be sent again.
fn is_settled(receipt: farm::Receipt) -> bool {
    !matches!(receipt.verdict(), farm::Verdict::Unspecified | farm::Verdict::Damaged)
}

/// Keeps the cases that must be sent again. A case whose index was damaged has no receipt.
fn keep_unsettled(cases: &mut Vec<farm::CaseReport>, answer: &farm::ReportResponse) {
    let settled: HashSet<u32> =
        answer.receipts.iter().filter(|it| is_settled(**it)).map(|it| it.sobol_index).collect();
    cases.retain(|case| !settled.contains(&case.sobol_index));
}
