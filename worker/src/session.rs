//! A worker's talk with its coordinator: each call is repeated until it is answered.

use crate::agent::{AgentError, Config};
use crate::backoff::Backoff;
use crate::{CODE_VERSION, MODEL_HASH};
use std::collections::BTreeSet;
use std::sync::Mutex;
use std::time::Duration;
use tokio::sync::RwLock;
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;
use tonic::{Code, Response, Status};
use tracktwin_protocol::farm::farm_client::FarmClient;
use tracktwin_protocol::{CaseLease, CaseReport, Lease, Registration, farm, held_to_messages};

/// Cases asked for at a time; the coordinator, who knows how long they take, gives fewer.
const CASES_MAX: u32 = 1024;

/// Heartbeat until the coordinator has said how often it wants one.
const FIRST_HEARTBEAT: Duration = Duration::from_secs(1);

/// Heartbeats lie between a twentieth of a second and a minute, whatever a coordinator says.
const HEARTBEATS_S: [f64; 2] = [0.05, 60.0];

/// A case this worker holds: campaign, index, epoch.
type Held = (String, u32, u32);

/// What the tasks of a worker share.
pub(crate) struct Session {
    worker: String,
    cores: u32,
    model_hash: String,
    client: FarmClient<Channel>,
    held: Mutex<BTreeSet<Held>>,
    heartbeat: Mutex<Duration>,
    /// Registrations so far; held for writing while one is under way, so that one suffices for all.
    registrations: RwLock<u64>,
    /// No new work from here on.
    pub(crate) shutdown: CancellationToken,
    /// No more tries either.
    pub(crate) give_up: CancellationToken,
}

impl Session {
    pub(crate) fn new(
        config: &Config,
        shutdown: CancellationToken,
        give_up: CancellationToken,
    ) -> Result<Self, AgentError> {
        let address = |source| AgentError::Address { url: config.coordinator.clone(), source };
        Ok(Self {
            worker: config.worker.clone(),
            cores: u32::try_from(config.cores.get()).unwrap_or(u32::MAX),
            model_hash: config.model_hash.clone().unwrap_or_else(|| MODEL_HASH.to_owned()),
            client: crate::connection::connect(&config.coordinator).map_err(address)?,
            held: Mutex::default(),
            heartbeat: Mutex::new(FIRST_HEARTBEAT),
            registrations: RwLock::new(0),
            shutdown,
            give_up,
        })
    }

    /// Introduces the worker, unless another task has done so after `seen` registrations.
    pub(crate) async fn register(&self, seen: u64) -> Result<(), AgentError> {
        let mut registrations = self.registrations.write().await;
        if *registrations > seen {
            return Ok(());
        }
        let registration = Registration {
            worker: self.worker.clone(),
            code_version: CODE_VERSION.to_owned(),
            model_hash: self.model_hash.clone(),
            cores: self.cores,
        };
        let request = farm::RegisterRequest::from(registration);
        let answer = self
            .persist(&self.shutdown, |mut client| {
                let request = request.clone();
                async move { client.register(request).await }
            })
            .await?;
        let Some(answer) = answer else { return Ok(()) };
        let [shortest, longest] = HEARTBEATS_S;
        if answer.heartbeat_s.is_finite() {
            let heartbeat = Duration::from_secs_f64(answer.heartbeat_s.clamp(shortest, longest));
            *self.heartbeat.lock().expect("nobody panics while holding it") = heartbeat;
        }
        *registrations += 1;
        Ok(())
    }

    /// Cases to simulate, or when to ask again; nothing at shutdown.
    pub(crate) async fn lease(&self) -> Result<Option<Lease>, AgentError> {
        loop {
            let seen = *self.registrations.read().await;
            let request = farm::LeaseRequest { worker: self.worker.clone(), cases_max: CASES_MAX };
            let answer = self
                .persist(&self.shutdown, |mut client| {
                    let request = request.clone();
                    async move { client.lease(request).await }
                })
                .await;
            match answer {
                Ok(None) => return Ok(None),
                Ok(Some(message)) => {
                    let lease = Lease::try_from(message)?;
                    if let Lease::Cases(lease) = &lease {
                        self.hold(lease);
                    }
                    return Ok(Some(lease));
                }
                // It has been restarted since, and knows nobody.
                Err(AgentError::Unknown) => self.register(seen).await?,
                Err(error) => return Err(error),
            }
        }
    }

    /// Hands in results; after shutdown only until the worker gives up.
    pub(crate) async fn report(
        &self,
        lease: &CaseLease,
        reports: Vec<CaseReport>,
    ) -> Result<(), AgentError> {
        let held: Vec<_> = reports.iter().map(|report| (report.index, report.epoch)).collect();
        let request = farm::ReportRequest {
            worker: self.worker.clone(),
            campaign_id: lease.campaign.clone(),
            experiment_hash: lease.experiment_hash.clone(),
            cases: reports.into_iter().map(Into::into).collect(),
        };
        loop {
            let seen = *self.registrations.read().await;
            let answer = self
                .persist(&self.give_up, |mut client| {
                    let request = request.clone();
                    async move { client.report(request).await }
                })
                .await;
            match answer {
                Err(AgentError::Unknown) => self.register(seen).await?,
                Err(error) => return Err(error),
                Ok(answer) => {
                    let receipts = answer.map_or_else(Vec::new, |answer| answer.receipts);
                    let refused = |it: &&farm::Receipt| it.verdict() == farm::Verdict::Refused;
                    let refused = receipts.iter().filter(refused).count();
                    if refused > 0 {
                        tracing::warn!("{refused} results refused: not cases of this coordinator");
                    }
                    break;
                }
            }
        }
        self.let_go(&lease.campaign, &held);
        Ok(())
    }

    /// Gives back cases that were not simulated. What cannot be given back expires.
    pub(crate) async fn release(&self, lease: &CaseLease, held: Vec<(u32, u32)>) {
        self.let_go(&lease.campaign, &held);
        let request = farm::ReleaseRequest {
            worker: self.worker.clone(),
            campaign_id: lease.campaign.clone(),
            cases: held_to_messages(held),
        };
        if let Err(status) = self.client.clone().release(request).await {
            tracing::warn!("cases not given back, their lease expires: {}", status.message());
        }
    }

    /// Renews what is held, for as long as the worker lives: a task of its own, so that no
    /// computation and no slow report makes a live worker look dead.
    pub(crate) async fn keep_alive(&self) {
        loop {
            let heartbeat = *self.heartbeat.lock().expect("nobody panics while holding it");
            tokio::time::sleep(heartbeat).await;
            for request in self.renewals() {
                match self.client.clone().renew(request).await {
                    Ok(answer) => {
                        let lost = answer.into_inner().lost.len();
                        if lost > 0 {
                            // Their results are the same, and stored if they come first.
                            tracing::warn!("{lost} leases expired and went to others");
                        }
                    }
                    Err(status) => tracing::warn!("heartbeat failed: {}", status.message()),
                }
            }
        }
    }

    /// One request a campaign.
    fn renewals(&self) -> Vec<farm::RenewRequest> {
        let held = self.held.lock().expect("nobody panics while holding it");
        let mut requests: Vec<farm::RenewRequest> = Vec::new();
        for (campaign, index, epoch) in held.iter() {
            let case = farm::HeldCase { sobol_index: *index, epoch: *epoch };
            match requests.last_mut() {
                Some(request) if request.campaign_id == *campaign => request.cases.push(case),
                _ => requests.push(farm::RenewRequest {
                    worker: self.worker.clone(),
                    campaign_id: campaign.clone(),
                    cases: vec![case],
                }),
            }
        }
        requests
    }

    fn hold(&self, lease: &CaseLease) {
        let cases = lease.cases.iter();
        let held = cases.map(|leased| (lease.campaign.clone(), leased.case.index, leased.epoch));
        self.held.lock().expect("nobody panics while holding it").extend(held);
    }

    fn let_go(&self, campaign: &str, cases: &[(u32, u32)]) {
        let mut held = self.held.lock().expect("nobody panics while holding it");
        for &(index, epoch) in cases {
            held.remove(&(campaign.to_owned(), index, epoch));
        }
    }

    /// Calls until there is an answer, or a refusal, or (then `None`) until `end`.
    ///
    /// A call on its way is waited for even then: what it leases must be known to be given back.
    async fn persist<T, F>(
        &self,
        end: &CancellationToken,
        call: impl Fn(FarmClient<Channel>) -> F,
    ) -> Result<Option<T>, AgentError>
    where
        F: Future<Output = Result<Response<T>, Status>>,
    {
        let mut backoff = Backoff::default();
        while !end.is_cancelled() {
            let answer = tokio::select! {
                answer = call(self.client.clone()) => answer,
                () = self.give_up.cancelled() => return Ok(None),
            };
            let status = match answer {
                Ok(answer) => return Ok(Some(answer.into_inner())),
                Err(status) => status,
            };
            match status.code() {
                Code::Unauthenticated => return Err(AgentError::Unknown),
                Code::FailedPrecondition | Code::InvalidArgument | Code::Unimplemented => {
                    return Err(AgentError::Refused { reason: status.message().to_owned() });
                }
                _ => tracing::info!("the coordinator does not answer: {}", status.message()),
            }
            tokio::select! {
                () = tokio::time::sleep(backoff.next()) => {}
                () = end.cancelled() => {}
            }
        }
        Ok(None)
    }
}
