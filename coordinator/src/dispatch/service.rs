//! The gRPC service: messages in, library calls, messages out.

use super::{Pace, after_attempt};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tonic::{Request, Response, Status};
use tracktwin_library::{
    self as library, CampaignRecord, Held, LeaseRequest, Library, LibraryError, Report, Verdict,
};
use tracktwin_protocol::farm::farm_server::Farm;
use tracktwin_protocol::{
    BadMessage, CaseLease, CaseReport, Lease, LeasedCase, Outcome, PROTOCOL_VERSION, Registration,
    Shape, farm, held_from_messages, held_to_messages,
};
use tracktwin_worker::{CODE_VERSION, Experiment, ExperimentError, MODEL_HASH};

/// A worker that was not heard of for so long is forgotten; if it comes back, it registers anew.
const FORGET_AFTER: Duration = Duration::from_mins(10);

/// How long leases last, and what follows from it.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// A lease that is not renewed for so long has lost its worker.
    pub lease: Duration,
    /// How often workers renew.
    pub heartbeat: Duration,
    /// When a worker that got no cases asks again.
    pub retry: Duration,
}

impl Default for Timing {
    /// Three heartbeats may be lost; a dead worker's cases go to others within 12 s.
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(12),
            heartbeat: Duration::from_secs(3),
            retry: Duration::from_millis(500),
        }
    }
}

/// Why a campaign can't be dispatched.
#[derive(Debug, thiserror::Error)]
pub enum DispatchError {
    /// The library can't be read.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// Its experiment can't be done by this version.
    #[error("campaign {campaign}: {source}")]
    Experiment {
        /// The campaign.
        campaign: String,
        /// Why not.
        source: ExperimentError,
    },
}

/// The farm's service, for one campaign of a library.
pub struct Dispatch {
    library: Library,
    campaign: CampaignRecord,
    /// Only cases with a smaller index.
    cases: u32,
    shape: Shape,
    timing: Timing,
    pace: Mutex<Pace>,
    workers: Mutex<HashMap<String, Worker>>,
}

/// A registered worker.
struct Worker {
    code_version: String,
    model_hash: String,
    heard_of: Instant,
}

impl Dispatch {
    /// The service that hands out the first `cases` cases of a campaign.
    ///
    /// # Errors
    /// [`DispatchError`] when the campaign is not there, or this version can't do its experiment.
    pub async fn new(
        library: Library,
        campaign: &str,
        cases: u32,
        timing: Timing,
    ) -> Result<Self, DispatchError> {
        let campaign = library.campaign(campaign).await?;
        let experiment = Experiment::from_json(&campaign.experiment_json).map_err(|source| {
            DispatchError::Experiment { campaign: campaign.id.clone(), source }
        })?;
        let shape = Shape {
            bins: experiment.features.frequencies_hz().len(),
            speeds_km_h: experiment.speeds_km_h,
        };
        let (pace, workers) = (Mutex::default(), Mutex::default());
        Ok(Self { library, campaign, cases, shape, timing, pace, workers })
    }

    fn workers(&self) -> MutexGuard<'_, HashMap<String, Worker>> {
        self.workers.lock().expect("nobody panics while holding it")
    }

    fn pace(&self) -> MutexGuard<'_, Pace> {
        self.pace.lock().expect("nobody panics while holding it")
    }

    /// Version and model hash of a worker; one that has not registered is told to.
    fn known(&self, worker: &str) -> Result<(String, String), Status> {
        match self.workers().get_mut(worker) {
            Some(known) => {
                known.heard_of = Instant::now();
                Ok((known.code_version.clone(), known.model_hash.clone()))
            }
            None => Err(Status::unauthenticated("register first")),
        }
    }

    /// Stores checked reports of this campaign.
    async fn store(
        &self,
        worker: String,
        provenance: (String, String),
        reports: Vec<CaseReport>,
    ) -> Result<Vec<Verdict>, Status> {
        let (code_version, model_hash) = provenance;
        let report = Report {
            campaign: self.campaign.id.clone(),
            worker,
            code_version,
            model_hash,
            experiment_hash: self.campaign.experiment_hash.clone(),
            speeds_km_h: self.shape.speeds_km_h.clone(),
            cases: reports.into_iter().map(library_report).collect(),
            now_unix_ms: self.library.now_unix_ms(),
            after_failure: after_attempt,
            audit_share: 0.0,
        };
        self.library.report(report).await.map_err(|error| unavailable(&error))
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
        let Registration { worker, code_version, model_hash, protocol_version, .. } = registration;
        if protocol_version != PROTOCOL_VERSION {
            tracing::warn!("worker {worker} (version {code_version}) refused: other protocol");
            return Err(Status::failed_precondition(other_protocol(
                &worker,
                &code_version,
                protocol_version,
            )));
        }
        if model_hash != MODEL_HASH {
            tracing::warn!("worker {worker} (version {code_version}) refused: other physics");
            return Err(Status::failed_precondition(format!(
                "worker {worker} simulates other physics than this coordinator: its model hash is \
                 {model_hash} (version {code_version}), here it is {MODEL_HASH} (version \
                 {CODE_VERSION}); install the coordinator's version"
            )));
        }
        let mut workers = self.workers();
        workers.retain(|_, worker| worker.heard_of.elapsed() < FORGET_AFTER);
        workers.insert(worker, Worker { code_version, model_hash, heard_of: Instant::now() });
        let heartbeat_s = self.timing.heartbeat.as_secs_f64();
        Ok(Response::new(farm::RegisterResponse { heartbeat_s }))
    }

    async fn lease(
        &self,
        request: Request<farm::LeaseRequest>,
    ) -> Result<Response<farm::LeaseResponse>, Status> {
        let farm::LeaseRequest { worker, cases_max } = request.into_inner();
        self.known(&worker)?;
        let cases_max = cases_max.min(self.pace().cases_per_lease());
        let request = LeaseRequest {
            campaign: Some(self.campaign.id.clone()),
            indices_below: self.cases,
            worker,
            cases_max,
            now_unix_ms: self.library.now_unix_ms(),
            lease_ms: unix_ms(self.timing.lease),
            after_loss: after_attempt,
        };
        let leased = self.library.lease(request).await.map_err(|error| unavailable(&error))?;
        let lease = match leased {
            None => Lease::NoneNow { retry_after_s: self.timing.retry.as_secs_f64(), reason: None },
            Some(library::Lease { campaign, cases }) => Lease::Cases(CaseLease {
                campaign,
                experiment_json: self.campaign.experiment_json.clone(),
                experiment_hash: self.campaign.experiment_hash.clone(),
                lease_s: self.timing.lease.as_secs_f64(),
                cases: cases
                    .into_iter()
                    .map(|library::Leased { case, epoch }| LeasedCase { case, epoch })
                    .collect(),
            }),
        };
        Ok(Response::new(lease.into()))
    }

    async fn renew(
        &self,
        request: Request<farm::RenewRequest>,
    ) -> Result<Response<farm::RenewResponse>, Status> {
        // Without registration too: leases outlive a restart of the coordinator.
        let farm::RenewRequest { worker, campaign_id, cases } = request.into_inner();
        let until = self.library.now_unix_ms().saturating_add(unix_ms(self.timing.lease));
        let lost = self
            .library
            .renew(&campaign_id, &worker, held(cases)?, until)
            .await
            .map_err(|error| unavailable(&error))?;
        let lost = held_to_messages(lost.into_iter().map(|held| (held.index, held.epoch)));
        Ok(Response::new(farm::RenewResponse { lost }))
    }

    async fn report(
        &self,
        request: Request<farm::ReportRequest>,
    ) -> Result<Response<farm::ReportResponse>, Status> {
        let farm::ReportRequest { worker, campaign_id, experiment_hash, cases } =
            request.into_inner();
        let provenance = self.known(&worker)?;
        let indices: Vec<u32> = cases.iter().map(|case| case.sobol_index).collect();
        let ours =
            campaign_id == self.campaign.id && experiment_hash == self.campaign.experiment_hash;
        let verdicts = if ours {
            let reports = CaseReport::all_checked(cases, &self.shape);
            let reports = reports.map_err(|error| malformed(&error))?;
            let durations: Vec<f64> = reports.iter().map(|report| report.duration_s).collect();
            let verdicts = self.store(worker, provenance, reports).await?;
            for case_s in durations {
                self.pace().measured(case_s);
            }
            verdicts
        } else {
            vec![Verdict::Refused; indices.len()]
        };
        let receipts = indices.into_iter().zip(verdicts).map(|(sobol_index, verdict)| {
            farm::Receipt { sobol_index, verdict: verdict_message(verdict).into() }
        });
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

/// What a worker is told that speaks another protocol.
fn other_protocol(worker: &str, version: &str, protocol: u32) -> String {
    let mend = if protocol < PROTOCOL_VERSION {
        "update the worker to the coordinator's version"
    } else {
        "install the coordinator's version on the worker, or update the coordinator"
    };
    format!(
        "worker {worker} (version {version}) speaks protocol {protocol}, this coordinator (version \
         {CODE_VERSION}) speaks {PROTOCOL_VERSION}: {mend}"
    )
}

fn held(messages: Vec<farm::HeldCase>) -> Result<Vec<Held>, Status> {
    let held = held_from_messages(messages).map_err(|error| malformed(&error))?;
    Ok(held.into_iter().map(|(index, epoch)| Held { index, epoch }).collect())
}

fn library_report(report: CaseReport) -> library::CaseReport {
    let CaseReport { index, epoch, parameter_hash, duration_s, outcome } = report;
    let outcome = match outcome {
        Outcome::Finished(passes) => Ok(passes.into_iter().map(|pass| pass.features).collect()),
        Outcome::Failed { reason } => Err(reason),
    };
    library::CaseReport { index, epoch, parameter_hash, duration_s, outcome }
}

const fn verdict_message(verdict: Verdict) -> farm::Verdict {
    match verdict {
        Verdict::Stored => farm::Verdict::Stored,
        Verdict::Duplicate => farm::Verdict::Duplicate,
        Verdict::Late => farm::Verdict::Late,
        Verdict::Refused => farm::Verdict::Refused,
    }
}

fn malformed(error: &BadMessage) -> Status {
    Status::invalid_argument(error.to_string())
}

/// The worker asks again; what is wrong with the library is the coordinator's to say.
fn unavailable(error: &LibraryError) -> Status {
    tracing::error!("the library does not answer: {error:?}");
    Status::unavailable(error.to_string())
}

fn unix_ms(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}
