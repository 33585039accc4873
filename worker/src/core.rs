//! Main loop of one core: a lease at a time, a group of cases at a time.

use crate::counters::Counters;
use crate::error::AgentError;
use crate::finished::Finished;
use crate::outbox::Outbox;
use crate::session::Session;
use parking_lot::Mutex;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tracktwin_experiment::{Case, Experiment, Outcome, Prepare, Simulate};
use tracktwin_protocol::{CaseLease, CaseReport, Lease, LeasedCase, checksum};
use tracktwin_traces::{Step, Value};

/// Number of cases simulated together on one core: the lanes of the fast solver of the track model.
pub const GROUP: usize = 8;

/// Upper limit of the waiting time for work: that of a suspended worker.
const WAIT_MAX: Duration = Duration::from_mins(10);

/// One core's share of a worker.
pub(crate) struct Core {
    pub(crate) session: Arc<Session>,
    pub(crate) prepared: Arc<Prepared>,
    pub(crate) outbox: Outbox,
    pub(crate) counters: Arc<Counters>,
    pub(crate) idle_exit: Option<Duration>,
    pub(crate) inline: bool,
}

impl Core {
    /// Leases and simulates cases until the worker is stopped or was idle for too long.
    pub(crate) async fn run(self) -> Result<(), AgentError> {
        let mut told = None;
        while let Some(lease) = self.session.lease().await? {
            match lease {
                Lease::Cases(lease) => self.work(&lease).await?,
                Lease::NoneNow { retry_after_s, reason } => {
                    if reason.is_some() && reason != told {
                        tracing::warn!("no cases: {}", reason.as_deref().unwrap_or_default());
                    }
                    told = reason;
                    self.wait(retry_after_s).await;
                }
            }
        }
        Ok(())
    }

    /// Waits for work. Ends the worker if it has waited too long.
    async fn wait(&self, retry_after_s: f64) {
        let mut wait = Duration::try_from_secs_f64(retry_after_s).unwrap_or(WAIT_MAX).min(WAIT_MAX);
        if let Some(limit) = self.idle_exit {
            let idle = self.session.idle_for();
            if idle >= limit {
                tracing::info!("no work for {} s: exiting", idle.as_secs());
                self.session.shutdown.cancel();
            }
            wait = wait.min(limit.saturating_sub(idle));
        }
        tokio::select! {
            () = tokio::time::sleep(wait) => {}
            () = self.session.shutdown.cancelled() => {}
        }
    }

    /// Simulates and reports the leased cases. At shutdown it returns the cases not yet started.
    async fn work(&self, lease: &CaseLease) -> Result<(), AgentError> {
        let session = &self.session;
        let simulation = match self.prepare(lease).await {
            Ok(simulation) => simulation,
            Err(error) => {
                session.release(&lease.campaign, held(&lease.cases)).await;
                return Err(error);
            }
        };
        for (number, group) in lease.cases.chunks(GROUP).enumerate() {
            let rest = &lease.cases[number * GROUP..];
            if session.shutdown.is_cancelled() {
                session.release(&lease.campaign, held(rest)).await;
                break;
            }
            let ours =
                |it: &&LeasedCase| session.holdings.has(&lease.campaign, it.case.index, it.epoch);
            let group: Vec<LeasedCase> = group.iter().filter(ours).cloned().collect();
            if group.is_empty() {
                continue;
            }
            let step = Step::after("simulate", [&lease.traceparent]);
            step.tell("campaign_id", lease.campaign.clone());
            step.tell("sobol_index", indices(&group));
            let begun = Instant::now();
            let cases: Vec<Case> = group.iter().map(|leased| leased.case.clone()).collect();
            let outcomes = tokio::select! {
                outcomes = self.compute(simulation.clone(), cases) => outcomes,
                () = session.give_up.cancelled() => {
                    session.release(&lease.campaign, held(rest)).await;
                    break;
                }
            };
            let computing_s = begun.elapsed().as_secs_f64();
            self.counters.computing_s.inc_by(computing_s);
            let reports = reports(&group, outcomes, computing_s / group.len() as f64);
            let finished = Finished::new(lease, reports, step.traceparent());
            // Waiting for room in the outbox is no part of it.
            drop(step);
            self.put(finished).await;
        }
        Ok(())
    }

    /// The simulator of the lease's experiment. Its preparation delays neither heartbeats nor
    /// reports.
    async fn prepare(&self, lease: &CaseLease) -> Result<Arc<dyn Simulate>, AgentError> {
        if self.inline {
            return self.prepared.of(lease);
        }
        let (prepared, lease) = (self.prepared.clone(), lease.clone());
        let preparing = tokio::task::spawn_blocking(move || prepared.of(&lease));
        preparing.await.expect("preparing does not panic")
    }

    async fn compute(&self, simulation: Arc<dyn Simulate>, cases: Vec<Case>) -> Vec<Outcome> {
        if self.inline {
            return guarded(simulation.as_ref(), &cases);
        }
        let computed = tokio::task::spawn_blocking(move || guarded(simulation.as_ref(), &cases));
        computed.await.expect("what is computed is caught when it panics")
    }

    /// Puts results into the outbox; waits while it is full.
    async fn put(&self, finished: Finished) {
        self.session.worked();
        let count = i64::try_from(finished.reports.len()).unwrap_or(i64::MAX);
        self.counters.unsent.inc_by(count);
        if self.outbox.send(finished).await.is_err() {
            // It ended with an error, which ends the worker; the leases expire.
            self.counters.unsent.dec_by(count);
        }
    }
}

fn indices(cases: &[LeasedCase]) -> Value {
    let indices: Vec<i64> = cases.iter().map(|it| it.case.index.into()).collect();
    Value::Array(indices.into())
}

fn held(cases: &[LeasedCase]) -> Vec<(u32, u32)> {
    cases.iter().map(|it| (it.case.index, it.epoch)).collect()
}

fn reports(group: &[LeasedCase], outcomes: Vec<Outcome>, duration_s: f64) -> Vec<CaseReport> {
    assert_eq!(group.len(), outcomes.len(), "one outcome a case");
    let report = |(leased, outcome): (&LeasedCase, Outcome)| {
        let parameter_hash = leased.case.parameter_hash();
        CaseReport {
            index: leased.case.index,
            epoch: leased.epoch,
            duration_s,
            checksum: checksum(leased.case.index, &parameter_hash, &outcome),
            parameter_hash,
            outcome,
        }
    };
    group.iter().zip(outcomes).map(report).collect()
}

/// Simulates cases. A case that panics counts as failed and does not affect the other cases of its
/// group.
fn guarded(simulation: &dyn Simulate, cases: &[Case]) -> Vec<Outcome> {
    match catch_unwind(AssertUnwindSafe(|| simulation.simulate(cases))) {
        Ok(outcomes) => outcomes,
        Err(_) if cases.len() > 1 => {
            cases.chunks(1).flat_map(|case| guarded(simulation, case)).collect()
        }
        Err(panic) => {
            let message = panic.downcast_ref::<String>().map(String::as_str);
            let message = message.or_else(|| panic.downcast_ref::<&str>().copied());
            let reason =
                format!("the program panicked: {}", message.unwrap_or("without a message"));
            vec![Outcome::Failed { reason }; cases.len()]
        }
    }
}

/// The simulation of the latest experiment: campaigns seldom change.
pub(crate) struct Prepared {
    prepare: Prepare,
    latest: Mutex<Option<(String, Arc<dyn Simulate>)>>,
}

impl Prepared {
    pub(crate) fn new(prepare: Prepare) -> Self {
        Self { prepare, latest: Mutex::default() }
    }

    fn of(&self, lease: &CaseLease) -> Result<Arc<dyn Simulate>, AgentError> {
        let mut latest = self.latest.lock();
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
