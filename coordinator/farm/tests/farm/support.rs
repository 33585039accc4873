//! A stand-in for the track model, libraries, and a coordinator for tests.

use std::net::Ipv4Addr;
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio_util::sync::{CancellationToken, DropGuard};
use tonic::transport::Channel;
use tracktwin_experiment::{
    Case, Experiment, ExperimentError, MODEL_HASH, Outcome, PassFeatures, Simulate,
};
use tracktwin_farm::campaign::Campaign;
use tracktwin_farm::dispatch::{Counts, Dispatch, Settings, Timing};
use tracktwin_farm::embedded::{self, Task};
use tracktwin_farm::security::Security;
use tracktwin_farm::serve;
use tracktwin_library::{Library, Status};
use tracktwin_protocol::farm::farm_client::FarmClient;
use tracktwin_protocol::farm::{
    self as messages, CaseReport, LeaseRequest, RegisterRequest, ReportRequest, Verdict,
};
use tracktwin_protocol::{PROTOCOL_VERSION, checksum};
use tracktwin_signal::{Features, ThirdOctave};

/// Replaces the track model: a function of the case that takes no time.
pub(crate) struct StandIn(pub(crate) Experiment);

impl StandIn {
    pub(crate) fn outcome(&self, case: &Case) -> Outcome {
        let bins = self.0.features.frequencies_hz().len();
        let pass = |&speed_km_h: &f64| PassFeatures {
            speed_km_h,
            features: Features {
                log_power: vec![(f64::from(case.index) * speed_km_h).sin(); bins],
                band_levels_db: vec![case.parameters.values()[0] / 1e7; ThirdOctave::COUNT],
            },
            contact_loss_share: Some(0.0),
        };
        Outcome::Finished(self.0.speeds_km_h.iter().map(pass).collect())
    }
}

impl Simulate for StandIn {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        cases.iter().map(|case| self.outcome(case)).collect()
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature is that of a preparation")]
pub(crate) fn stand_in(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(StandIn(experiment.clone())))
}

pub(crate) const CORES: NonZeroUsize = NonZeroUsize::new(2).expect("two are more than none");

pub(crate) async fn library(folder: &TempDir, campaign: &Campaign) -> Library {
    let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
    library_at(&url, campaign).await
}

pub(crate) async fn library_at(url: &str, campaign: &Campaign) -> Library {
    let library = Library::open_or_create(url).await.unwrap();
    tracktwin_farm::campaign::store_campaign(&library, campaign).await.unwrap();
    library
}

pub(crate) fn task(campaign: &str, cases: u32) -> Task<'_> {
    Task { prepare: stand_in, ..Task::new(campaign, cases, CORES) }
}

/// The digest of a campaign simulated without faults.
pub(crate) async fn undisturbed(campaign: &Campaign) -> String {
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, campaign).await;
    let id = campaign.id();
    let shutdown = CancellationToken::new();
    let task = task(&id, campaign.cases);
    let status = embedded::run_embedded(&library, task, shutdown, |_| {}).await.unwrap();
    assert_eq!(status, Status { finished: campaign.cases, ..Status::default() });
    library.digest(&id).await.unwrap()
}

/// A coordinator of the first 20 cases of the built-in campaign.
pub(crate) struct Coordinator {
    pub(crate) url: String,
    pub(crate) library: Library,
    pub(crate) campaign: Campaign,
    _folder: TempDir,
    end: DropGuard,
}

pub(crate) async fn coordinator() -> Coordinator {
    let timing = Timing { lease: Duration::from_millis(400), ..Timing::default() };
    let settings = Settings { timing, prepare: stand_in, ..Settings::default() };
    coordinator_with(settings, Security::default(), 20).await
}

pub(crate) async fn coordinator_with(
    settings: Settings,
    security: Security,
    cases: u32,
) -> Coordinator {
    let campaign = Campaign::built_in(Some(cases)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let scheme = if security.identity_pem.is_some() { "https" } else { "http" };
    let url = format!("{scheme}://{}", listener.local_addr().unwrap());
    let end = serving(&library, listener, settings, security);
    Coordinator { url, library, campaign, _folder: folder, end }
}

fn serving(
    library: &Library,
    listener: TcpListener,
    settings: Settings,
    security: Security,
) -> DropGuard {
    let dispatch = Dispatch::new(library.clone(), settings, Counts::default());
    let stop = CancellationToken::new();
    let end = stop.clone().drop_guard();
    tokio::spawn(async move { serve(listener, dispatch, &security, stop).await });
    end
}

impl Coordinator {
    /// Replaces the service by another one at the same address, of the same library.
    pub(crate) async fn restarted(self, settings: Settings) -> Self {
        drop(self.end);
        let address = self.url.trim_start_matches("http://");
        let mut listener = None;
        until("the address is free", async || {
            listener = TcpListener::bind(address).await.ok();
            listener.is_some()
        })
        .await;
        let end = serving(&self.library, listener.unwrap(), settings, Security::default());
        Self { end, ..self }
    }
}

pub(crate) async fn registered(coordinator: &Coordinator, worker: &str) -> FarmClient<Channel> {
    let mut client = FarmClient::connect(coordinator.url.clone()).await.unwrap();
    client.register(registration(worker, MODEL_HASH)).await.unwrap();
    client
}

pub(crate) fn registration(worker: &str, model_hash: &str) -> RegisterRequest {
    RegisterRequest {
        worker: worker.to_owned(),
        code_version: "9.9.9".to_owned(),
        model_hash: model_hash.to_owned(),
        cores: 1,
        protocol_version: PROTOCOL_VERSION,
    }
}

pub(crate) async fn lease(
    client: &mut FarmClient<Channel>,
    worker: &str,
) -> messages::LeaseResponse {
    let request = LeaseRequest { worker: worker.to_owned(), cases_max: 4 };
    client.lease(request).await.unwrap().into_inner()
}

/// The message with the features of one pass.
pub(crate) fn pass(speed_km_h: f64, log_power: Vec<f64>) -> messages::PassFeatures {
    let features = Features { log_power, band_levels_db: vec![1.0; ThirdOctave::COUNT] };
    PassFeatures { speed_km_h, features, contact_loss_share: None }.into()
}

/// The message with the checksum of its content, as a worker computes it.
pub(crate) fn with_checksum(message: CaseReport) -> CaseReport {
    let outcome = match message.outcome.clone() {
        Some(messages::case_report::Outcome::Passes(passes)) => {
            Outcome::Finished(passes.passes.into_iter().map(PassFeatures::from).collect())
        }
        Some(messages::case_report::Outcome::Failure(failure)) => {
            Outcome::Failed { reason: failure.reason }
        }
        None => return message,
    };
    let checksum = checksum(message.sobol_index, &message.parameter_hash, &outcome);
    CaseReport { checksum, ..message }
}

pub(crate) fn report(lease: &messages::LeaseResponse, worker: &str) -> ReportRequest {
    let experiment = Experiment::from_json(&lease.experiment_json).unwrap();
    let bins = experiment.features.frequencies_hz().len();
    let pass = |&speed_km_h: &f64| pass(speed_km_h, vec![0.5; bins]);
    let passes = messages::Passes { passes: experiment.speeds_km_h.iter().map(pass).collect() };
    let case = |case: &messages::LeasedCase| {
        with_checksum(CaseReport {
            sobol_index: case.sobol_index,
            epoch: case.epoch,
            parameter_hash: case.parameter_hash.clone(),
            duration_s: 0.1,
            outcome: Some(messages::case_report::Outcome::Passes(passes.clone())),
            checksum: String::new(),
        })
    };
    ReportRequest {
        worker: worker.to_owned(),
        campaign_id: lease.campaign_id.clone(),
        experiment_hash: lease.experiment_hash.clone(),
        cases: lease.cases.iter().map(case).collect(),
        traceparent: lease.traceparent.clone(),
    }
}

/// A heartbeat that names everything leased.
pub(crate) fn renewal(leased: &messages::LeaseResponse, worker: &str) -> messages::RenewRequest {
    let held = |case: &messages::LeasedCase| messages::HeldCase {
        sobol_index: case.sobol_index,
        epoch: case.epoch,
    };
    messages::RenewRequest {
        worker: worker.to_owned(),
        campaign_id: leased.campaign_id.clone(),
        cases: leased.cases.iter().map(held).collect(),
    }
}

pub(crate) async fn verdicts(
    client: &mut FarmClient<Channel>,
    request: ReportRequest,
) -> Vec<Verdict> {
    let response = client.report(request).await.unwrap().into_inner();
    response.receipts.iter().map(messages::Receipt::verdict).collect()
}

/// Waits until the condition is true; fails after 20 s.
pub(crate) async fn until(what: &str, mut is_so: impl AsyncFnMut() -> bool) {
    let begun = Instant::now();
    while !is_so().await {
        assert!(begun.elapsed() < Duration::from_secs(20), "not in time: {what}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}
