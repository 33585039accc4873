//! The gRPC service: messages in, library calls, messages out.

use super::audits::{self, Audits, Found};
use super::campaigns::{Campaigns, DispatchError, Served};
use super::messages::{held, library_report, malformed, unavailable, unfit, verdict_message};
use super::roster::{Roster, Standing};
use super::settings::Settings;
use super::{Counts, SUSPECT_AFTER, after_attempt};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};
use tokio::time::Instant;
use tonic::{Request, Response, Status};
use tracktwin_library::{self as library, LeaseRequest, Library, Report, Verdict, WorkerState};
use tracktwin_protocol::farm::farm_server::Farm;
use tracktwin_protocol::{
    CaseLease, CaseReport, Lease, LeasedCase, Outcome, Registration, farm, held_to_messages,
};
use tracktwin_traces::Step;

/// After the library had no case to give, it is not asked again for so long.
const NOTHING: Duration = Duration::from_millis(100);

/// Workers without work that may ask once a second all together.
const IDLE_CALLS_S: f64 = 400.0;

/// The farm's service, for the campaigns of a library.
pub struct Dispatch {
    library: Library,
    settings: Settings,
    campaigns: Campaigns,
    roster: Roster,
    audits: Audits,
    nothing_until: Mutex<Option<Instant>>,
    counts: Counts,
}

impl Dispatch {
    /// A service that hands out what `settings` say of a library.
    pub fn new(library: Library, settings: Settings, counts: Counts) -> Self {
        Self {
            campaigns: Campaigns::new(library.clone()),
            audits: Audits::new(library.clone(), &settings),
            roster: Roster::default(),
            nothing_until: Mutex::default(),
            library,
            settings,
            counts,
        }
    }

    /// Whether this version can do a campaign's experiment.
    ///
    /// # Errors
    /// [`DispatchError`] when it can't, or the library can't be read.
    pub async fn check(&self, campaign: &str) -> Result<(), DispatchError> {
        self.campaigns.of(campaign).await.map(drop)
    }

    fn now_unix_ms(&self) -> i64 {
        match &self.settings.clock {
            Some(clock) => clock(),
            None => self.library.now_unix_ms(),
        }
    }

    /// How a worker stands; one that has not registered is told to.
    async fn standing(&self, worker: &str) -> Result<Standing, Status> {
        let stranger = || Status::unauthenticated("register first");
        let standing = self.roster.standing(worker).ok_or_else(stranger)?;
        if !standing.to_be_noted {
            return Ok(standing);
        }
        let known = self.library.heartbeat(worker, self.now_unix_ms()).await;
        if let Some(record) = known.map_err(|error| unavailable(&error))? {
            self.roster.quarantine(worker, record.state, record.reason);
        }
        self.roster.standing(worker).ok_or_else(stranger)
    }

    /// Cases for a worker that is to have some.
    async fn hand_out(&self, worker: &str, cases_max: u32) -> Result<Lease, Status> {
        let failed = |error: &DispatchError| {
            tracing::error!("no cases can be handed out: {error:?}");
            Status::unavailable(error.to_string())
        };
        let audit = self.audits.lease(worker, &self.campaigns).await;
        if let Some(lease) = audit.map_err(|error| failed(&error))? {
            return Ok(Lease::Cases(lease));
        }
        if self.had_nothing() {
            return Ok(self.none_now());
        }
        let scope = self.settings.scope.as_ref();
        let request = LeaseRequest {
            campaign: scope.map(|scope| scope.campaign.clone()),
            indices_below: scope.map_or(u32::MAX, |scope| scope.cases),
            worker: worker.to_owned(),
            cases_max: cases_max.min(self.campaigns.cases_per_lease(self.roster.present().1)),
            now_unix_ms: self.now_unix_ms(),
            lease_ms: unix_ms(self.settings.timing.lease),
            after_loss: after_attempt,
            alone_after: SUSPECT_AFTER,
        };
        let leased = self.library.lease(request).await.map_err(|error| unavailable(&error))?;
        let Some(leased) = leased else {
            let mut until = self.nothing_until.lock().expect("nobody panics while holding it");
            *until = Some(Instant::now() + NOTHING.min(self.settings.timing.retry));
            return Ok(self.none_now());
        };
        match self.campaigns.of(&leased.campaign).await {
            Ok(served) => {
                self.campaigns.leased(&served);
                self.counts.leased.inc_by(leased.cases.len() as u64);
                let cases = leased.cases.into_iter();
                let cases = cases.map(|it| LeasedCase { case: it.case, epoch: it.epoch });
                Ok(Lease::Cases(served.lease(cases.collect(), self.settings.timing.lease)))
            }
            Err(error) => {
                self.give_up_campaign(worker, &leased).await;
                Err(failed(&error))
            }
        }
    }

    /// A campaign that this version can't do must not hold up the others.
    async fn give_up_campaign(&self, worker: &str, leased: &library::Lease) {
        let held = leased.cases.iter();
        let held = held.map(|it| library::Held { index: it.case.index, epoch: it.epoch });
        let released = self.library.release(&leased.campaign, worker, held.collect()).await;
        let paused = self.library.pause(&leased.campaign).await;
        tracing::error!("campaign {} is paused: {released:?}, {paused:?}", leased.campaign);
    }

    fn had_nothing(&self) -> bool {
        let until = self.nothing_until.lock().expect("nobody panics while holding it");
        until.is_some_and(|until| until > Instant::now())
    }

    /// The more workers have nothing to do, the less often each asks.
    fn none_now(&self) -> Lease {
        let (workers, cores) = self.roster.present();
        let crowd = f64::from(cores).max(workers as f64) / IDLE_CALLS_S;
        let retry_after_s = self.settings.timing.retry.as_secs_f64().max(crowd);
        Lease::NoneNow { retry_after_s, reason: None }
    }

    /// Stores checked reports; those of audits are compared instead.
    async fn store(
        &self,
        worker: &str,
        standing: Standing,
        served: &Arc<Served>,
        reports: Vec<CaseReport>,
        step: &Step,
    ) -> Result<Vec<Verdict>, Status> {
        let mut verdicts = vec![Verdict::Refused; reports.len()];
        let mut places = Vec::new();
        let mut ordinary = Vec::new();
        for (place, report) in reports.into_iter().enumerate() {
            if report.epoch == audits::EPOCH {
                verdicts[place] = self.audited(worker, served, &report).await?;
            } else {
                places.push(place);
                ordinary.push(report);
            }
        }
        if ordinary.is_empty() {
            return Ok(verdicts);
        }
        let failed: Vec<bool> =
            ordinary.iter().map(|it| matches!(it.outcome, Outcome::Failed { .. })).collect();
        let durations_s: Vec<f64> = ordinary.iter().map(|it| it.duration_s).collect();
        let step = Step::after("store", [&step.traceparent()]);
        let report = Report {
            campaign: served.record.id.clone(),
            worker: worker.to_owned(),
            code_version: standing.code_version,
            model_hash: standing.model_hash,
            experiment_hash: served.record.experiment_hash.clone(),
            speeds_km_h: served.shape.speeds_km_h.clone(),
            cases: ordinary.into_iter().map(library_report).collect(),
            now_unix_ms: self.now_unix_ms(),
            after_failure: after_attempt,
            audit_share: self.settings.audit_share,
        };
        let stored = self.library.report(report).await.map_err(|error| {
            step.fail(&error.to_string());
            unavailable(&error)
        })?;
        let rows = stored.iter().filter(|it| matches!(it, Verdict::Stored)).count();
        step.count("cases_stored", rows);
        drop(step);
        served.measured(durations_s);
        if self.settings.put_aside && self.roster.reported(worker, &failed) {
            tracing::warn!(worker, "put aside: it fails where other workers don't");
            self.counts.put_aside.inc();
        }
        for (place, verdict) in places.into_iter().zip(stored) {
            verdicts[place] = verdict;
        }
        Ok(verdicts)
    }

    async fn audited(
        &self,
        worker: &str,
        served: &Arc<Served>,
        report: &CaseReport,
    ) -> Result<Verdict, Status> {
        let found = self.audits.report(worker, served, report).await;
        Ok(match found.map_err(|error| unavailable(&error))? {
            None => Verdict::Refused,
            Some(Found::Agreement) => {
                self.counts.audited.inc();
                Verdict::Duplicate
            }
            Some(Found::Wrong { worker, reason }) => {
                self.counts.audited.inc();
                self.counts.differed.inc();
                self.roster.quarantine(&worker, WorkerState::Quarantined, Some(reason));
                Verdict::Duplicate
            }
        })
    }

    fn count(&self, verdicts: &[Verdict]) {
        for verdict in verdicts {
            match verdict {
                Verdict::Stored => self.counts.stored.inc(),
                Verdict::Duplicate => self.counts.duplicates.inc(),
                Verdict::Late => self.counts.late.inc(),
                Verdict::Refused => self.counts.refused.inc(),
            };
        }
    }
}

impl Served {
    /// These cases, for a while.
    pub(crate) fn lease(&self, cases: Vec<LeasedCase>, lease: Duration) -> CaseLease {
        CaseLease {
            campaign: self.record.id.clone(),
            experiment_json: self.record.experiment_json.clone(),
            experiment_hash: self.record.experiment_hash.clone(),
            lease_s: lease.as_secs_f64(),
            cases,
            traceparent: String::new(),
        }
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
        if let Some(reason) = unfit(&registration) {
            tracing::warn!("refused: {reason}");
            self.counts.unfit.inc();
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
        if state.map_err(|error| unavailable(&error))? == WorkerState::Quarantined {
            let record = self.library.worker(&worker).await.map_err(|error| unavailable(&error))?;
            let reason = record.and_then(|record| record.reason);
            self.roster.quarantine(&worker, WorkerState::Quarantined, reason);
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
        let standing = self.standing(&worker).await?;
        let mut lease = match standing.aside {
            Some((wait, reason)) => {
                Lease::NoneNow { retry_after_s: wait.as_secs_f64(), reason: Some(reason) }
            }
            None if standing.on_trial => self.hand_out(&worker, cases_max.min(1)).await?,
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
        // Without registration too: leases outlive a restart of the coordinator.
        let farm::RenewRequest { worker, campaign_id, cases } = request.into_inner();
        let until = self.now_unix_ms().saturating_add(unix_ms(self.settings.timing.lease));
        // Audits are not leases of the library, and long enough.
        let held = held(cases)?.into_iter().filter(|held| held.epoch != audits::EPOCH).collect();
        let lost = self.library.renew(&campaign_id, &worker, held, until).await;
        let lost = lost.map_err(|error| unavailable(&error))?;
        if self.roster.standing(&worker).is_some_and(|standing| standing.to_be_noted) {
            let noted = self.library.heartbeat(&worker, self.now_unix_ms()).await;
            noted.map_err(|error| unavailable(&error))?;
        }
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
        let step = Step::after("report", [&traceparent]);
        let standing = self.standing(&worker).await?;
        let indices: Vec<u32> = cases.iter().map(|case| case.sobol_index).collect();
        let served = match self.campaigns.of(&campaign_id).await {
            Ok(served) => Some(served).filter(|it| it.record.experiment_hash == experiment_hash),
            Err(DispatchError::Library(library::LibraryError::UnknownCampaign { .. })) => None,
            Err(error) => return Err(Status::unavailable(error.to_string())),
        };
        let verdicts = match served {
            Some(served) => {
                let reports = CaseReport::all_checked(cases, &served.shape).map_err(|error| {
                    tracing::warn!(worker, "report refused: {error}");
                    self.counts.malformed.inc();
                    malformed(&error)
                })?;
                self.store(&worker, standing, &served, reports, &step).await?
            }
            None => vec![Verdict::Refused; indices.len()],
        };
        self.count(&verdicts);
        let receipts = indices.into_iter().zip(verdicts).map(|(sobol_index, verdict)| {
            farm::Receipt { sobol_index, verdict: verdict_message(verdict).into() }
        });
        self.counts.report_s.observe(begun.elapsed().as_secs_f64());
        Ok(Response::new(farm::ReportResponse { receipts: receipts.collect() }))
    }

    async fn release(
        &self,
        request: Request<farm::ReleaseRequest>,
    ) -> Result<Response<farm::ReleaseResponse>, Status> {
        let farm::ReleaseRequest { worker, campaign_id, cases } = request.into_inner();
        self.library
            .release(&campaign_id, &worker, held(cases)?)
            .await
            .map_err(|error| unavailable(&error))?;
        Ok(Response::new(farm::ReleaseResponse {}))
    }
}

fn unix_ms(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}
