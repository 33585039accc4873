//! The gRPC service: it converts messages to library calls, and their results to messages.

mod hand_out;
mod take_in;

use super::Counts;
use super::audits::{Audits, LeaseKind};
use super::campaigns::{Campaigns, DispatchError};
use super::library_faults::{WorkerCall, unavailable};
use super::messages::{held, incompatibility, malformed};
use super::roster::{Roster, WorkerEligibility};
use super::settings::Settings;
use parking_lot::Mutex;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::time::Instant;
use tonic::{Request, Response, Status};
use tracktwin_library::{self as library, Held, Library, WorkerState};
use tracktwin_protocol::farm::farm_server::Farm;
use tracktwin_protocol::{BadMessage, CaseReport, Lease, Registration, farm, held_to_messages};
use tracktwin_traces::Step;

/// The gRPC service of the farm, for the campaigns of a library.
pub struct Dispatch {
    library: Library,
    settings: Settings,
    campaigns: Campaigns,
    roster: Roster,
    audits: Arc<Audits>,
    nothing_until: Mutex<Option<Instant>>,
    counts: Counts,
}

impl Dispatch {
    /// Creates a service that leases cases of `library` according to `settings`.
    pub fn new(library: Library, settings: Settings, counts: Counts) -> Self {
        Self {
            campaigns: Campaigns::new(library.clone()),
            audits: Arc::new(Audits::new(library.clone(), &settings)),
            roster: Roster::default(),
            nothing_until: Mutex::default(),
            library,
            settings,
            counts,
        }
    }

    /// Checks whether this version can simulate a campaign's experiment.
    ///
    /// # Errors
    /// Returns [`DispatchError`] if it cannot, or if the library cannot be read.
    pub async fn check(&self, campaign: &str) -> Result<(), DispatchError> {
        self.campaigns.of(campaign).await.map(drop)
    }

    fn now_unix_ms(&self) -> i64 {
        match &self.settings.clock {
            Some(clock) => clock(),
            None => self.library.now_unix_ms(),
        }
    }

    /// Eligibility of a worker; an error status if the worker is not registered.
    async fn eligibility(&self, worker: &str) -> Result<WorkerEligibility, Status> {
        let not_registered = || Status::unauthenticated("register first");
        let eligibility = self.roster.eligibility(worker).ok_or_else(not_registered)?;
        if !eligibility.to_be_noted {
            return Ok(eligibility);
        }
        self.note(worker).await?;
        self.roster.eligibility(worker).ok_or_else(not_registered)
    }

    /// Records in the library that a worker is alive, and reads whether it is in quarantine.
    async fn note(&self, worker: &str) -> Result<(), Status> {
        let known = self.library.heartbeat(worker, self.now_unix_ms()).await;
        if let Some(record) = self.settings.faults.note(WorkerCall::Heartbeat, known)? {
            self.roster.set_quarantine(worker, record.quarantine());
        }
        Ok(())
    }
}

#[tonic::async_trait]
impl Farm for Dispatch {
    async fn register(
        &self,
        request: Request<farm::RegisterRequest>,
    ) -> Result<Response<farm::RegisterResponse>, Status> {
        let registration =
            Registration::try_from(request.into_inner()).map_err(|error| malformed(&error))?;
        if let Some(reason) = incompatibility(&registration) {
            tracing::warn!("refused: {reason}");
            self.counts.incompatible.inc();
            return Err(Status::failed_precondition(reason));
        }
        let Registration { worker, code_version, model_hash, cores, .. } = registration.clone();
        let full = |_| Status::resource_exhausted("too many workers have registered");
        self.roster.add(registration).map_err(full)?;
        let now_unix_ms = self.now_unix_ms();
        tracing::info!(worker, code_version, cores, "worker registered");
        let registration = library::Registration {
            worker: worker.clone(),
            code_version,
            model_hash,
            cores,
            now_unix_ms,
        };
        let state = self.library.register_worker(registration).await;
        let state = self.settings.faults.note(WorkerCall::Register, state)?;
        if state == WorkerState::Quarantined {
            let record = self.library.worker(&worker).await.map_err(|error| unavailable(&error))?;
            let reason = record.and_then(library::WorkerRecord::quarantine);
            self.roster.set_quarantine(&worker, reason);
        }
        self.counts.registered.inc();
        let heartbeat_s = self.settings.timing.heartbeat.as_secs_f64();
        Ok(Response::new(farm::RegisterResponse { heartbeat_s }))
    }

    async fn lease(
        &self,
        request: Request<farm::LeaseRequest>,
    ) -> Result<Response<farm::LeaseResponse>, Status> {
        let (begun, begun_at) = (Instant::now(), SystemTime::now());
        let farm::LeaseRequest { worker, cases_max } = request.into_inner();
        if cases_max == 0 {
            return Err(malformed(&BadMessage::Missing { field: "cases_max" }));
        }
        let eligibility = self.eligibility(&worker).await?;
        let mut lease = match eligibility.exclusion {
            Some((wait, reason)) => {
                Lease::NoneNow { retry_after_s: wait.as_secs_f64(), reason: Some(reason) }
            }
            None if eligibility.on_trial => self.hand_out(&worker, cases_max.min(1)).await?,
            None => self.hand_out(&worker, cases_max).await?,
        };
        if let Lease::Cases(lease) = &mut lease {
            // Whoever gets nothing is no trace.
            let step = Step::first("lease", begun_at);
            step.tell("campaign_id", lease.campaign.clone());
            step.tell("worker", worker);
            step.count("cases", lease.cases.len());
            lease.traceparent = step.traceparent();
        }
        self.counts.lease_s.observe(begun.elapsed().as_secs_f64());
        Ok(Response::new(lease.into()))
    }

    async fn renew(
        &self,
        request: Request<farm::RenewRequest>,
    ) -> Result<Response<farm::RenewResponse>, Status> {
        // Leases outlive a restart of the coordinator, so they are renewed before the worker registers again.
        let farm::RenewRequest { worker, campaign_id, cases } = request.into_inner();
        let [worker, campaign_id] = names(worker, campaign_id)?;
        let (audits, held) = audits_and_cases(cases)?;
        if !audits.is_empty() {
            let renewed = self.audits.renew(&worker, &campaign_id, audits).await;
            renewed.map_err(|error| unavailable(&error))?;
        }
        let until = self.now_unix_ms().saturating_add(unix_ms(self.settings.timing.lease));
        let lost = self.library.renew(&campaign_id, &worker, held, until).await;
        let lost = self.settings.faults.note(WorkerCall::Renew, lost)?;
        self.eligibility(&worker).await?;
        let lost = held_to_messages(lost.into_iter().map(|held| (held.index, held.epoch)));
        Ok(Response::new(farm::RenewResponse { lost }))
    }

    async fn report(
        &self,
        request: Request<farm::ReportRequest>,
    ) -> Result<Response<farm::ReportResponse>, Status> {
        let begun = Instant::now();
        let farm::ReportRequest { worker, campaign_id, experiment_hash, cases, traceparent } =
            request.into_inner();
        let [worker, campaign_id] = names(worker, campaign_id)?;
        let step = Step::after("report", [&traceparent]);
        let eligibility = self.eligibility(&worker).await?;
        let indices: Vec<u32> = cases.iter().map(|case| case.sobol_index).collect();
        let served = match self.campaigns.of(&campaign_id).await {
            Ok(served) => Some(served).filter(|it| it.record.experiment_hash == experiment_hash),
            Err(DispatchError::Library(
                library::LibraryError::UnknownCampaign { .. }
                | library::LibraryError::OtherModel { .. },
            )) => None,
            Err(error) => return Err(Status::unavailable(error.to_string())),
        };
        let verdicts = if let Some(served) = served {
            let reports = CaseReport::all_checked(cases, &served.shape).map_err(|error| {
                tracing::warn!(worker, "report refused: {error}");
                self.counts.malformed.inc();
                malformed(&error)
            })?;
            self.take_in(&worker, eligibility, &served, reports, &step).await?
        } else {
            self.counts.refused.inc_by(indices.len() as u64);
            vec![farm::Verdict::Refused; indices.len()]
        };
        let receipts = indices
            .into_iter()
            .zip(verdicts)
            .map(|(sobol_index, verdict)| farm::Receipt { sobol_index, verdict: verdict.into() });
        self.counts.report_s.observe(begun.elapsed().as_secs_f64());
        Ok(Response::new(farm::ReportResponse { receipts: receipts.collect() }))
    }

    async fn release(
        &self,
        request: Request<farm::ReleaseRequest>,
    ) -> Result<Response<farm::ReleaseResponse>, Status> {
        let farm::ReleaseRequest { worker, campaign_id, cases } = request.into_inner();
        let [worker, campaign_id] = names(worker, campaign_id)?;
        let (audits, held) = audits_and_cases(cases)?;
        if !audits.is_empty() {
            let released = self.library.release_audits(&campaign_id, &worker, audits).await;
            released.map_err(|error| unavailable(&error))?;
        }
        let released = self.library.release(&campaign_id, &worker, held).await;
        released.map_err(|error| unavailable(&error))?;
        Ok(Response::new(farm::ReleaseResponse {}))
    }
}

/// The indices of the audits among these leases, and the leases of cases.
fn audits_and_cases(messages: Vec<farm::HeldCase>) -> Result<(Vec<u32>, Vec<Held>), Status> {
    let is_audit = |held: &Held| LeaseKind::of(held.epoch) == LeaseKind::Audit;
    let (audits, cases): (Vec<_>, Vec<_>) = held(messages)?.into_iter().partition(is_audit);
    Ok((audits.into_iter().map(|held| held.index).collect(), cases))
}

/// Checks the names of a worker and of a campaign in a message, and returns both.
fn names(worker: String, campaign_id: String) -> Result<[String; 2], Status> {
    let checked = |field, text| tracktwin_protocol::name(field, text).map_err(|it| malformed(&it));
    Ok([checked("worker", worker)?, checked("campaign_id", campaign_id)?])
}

fn unix_ms(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}
