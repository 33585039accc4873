//! The embedded farm over a real socket, with a stand-in for the physics; and what its service
//! refuses.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::net::Ipv4Addr;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tonic::Code;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Channel, Server};
use tracktwin::campaign::Campaign;
use tracktwin::dispatch::{Dispatch, Timing};
use tracktwin::farm::{self, Task};
use tracktwin_library::{Library, Status};
use tracktwin_protocol::PROTOCOL_VERSION;
use tracktwin_protocol::farm::farm_client::FarmClient;
use tracktwin_protocol::farm::farm_server::FarmServer;
use tracktwin_protocol::farm::{
    self as messages, CaseReport, LeaseRequest, RegisterRequest, ReportRequest, Verdict,
};
use tracktwin_signal::{Features, ThirdOctave};
use tracktwin_worker::agent::{self, AgentError, Config};
use tracktwin_worker::{
    Case, Experiment, ExperimentError, MODEL_HASH, Outcome, PassFeatures, Simulate,
};

/// Instead of physics: a function of the case that takes no time.
struct StandIn(Experiment);

impl StandIn {
    fn outcome(&self, case: &Case) -> Outcome {
        let bins = self.0.features.frequencies_hz().len();
        let pass = |&speed_km_h: &f64| PassFeatures {
            speed_km_h,
            features: Features {
                log_power: vec![(f64::from(case.index) * speed_km_h).sin(); bins],
                band_levels_db: vec![case.parameters.values()[0] / 1e7; ThirdOctave::COUNT],
            },
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
fn stand_in(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(StandIn(experiment.clone())))
}

/// Fails at case 3, panics at case 5.
struct Troubled(StandIn);

impl Simulate for Troubled {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        let outcome = |case: &Case| match case.index {
            3 => Outcome::Failed { reason: "the sleeper floats".to_owned() },
            5 => panic!("case 5 is bad"),
            _ => self.0.outcome(case),
        };
        cases.iter().map(outcome).collect()
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature is that of a preparation")]
fn troubled(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(Troubled(StandIn(experiment.clone()))))
}

const CORES: NonZeroUsize = NonZeroUsize::new(2).expect("two are more than none");

async fn library(folder: &TempDir, campaign: &Campaign) -> Library {
    let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
    let library = Library::open_or_create(&url).await.unwrap();
    farm::prepare(&library, campaign).await.unwrap();
    library
}

fn task(campaign: &str, cases: u32) -> Task<'_> {
    Task { prepare: stand_in, ..Task::new(campaign, cases, CORES) }
}

/// The digest of a campaign that nothing disturbed.
async fn undisturbed(campaign: &Campaign) -> String {
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, campaign).await;
    let id = campaign.id();
    let shutdown = CancellationToken::new();
    let task = task(&id, campaign.cases);
    let status = farm::embedded(&library, task, shutdown, |_| {}).await.unwrap();
    assert_eq!(status, Status { finished: campaign.cases, ..Status::default() });
    library.digest(&id).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_campaign_that_is_stopped_and_gone_on_with_has_the_digest_of_an_undisturbed_one() {
    let campaign = Campaign::built_in(Some(600)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let id = campaign.id();
    let mut stops = 0;
    loop {
        let shutdown = CancellationToken::new();
        let stop = shutdown.clone();
        tokio::spawn(async move {
            tokio::time::sleep(Duration::from_millis(40)).await;
            stop.cancel();
        });
        let task = task(&id, campaign.cases);
        let status = farm::embedded(&library, task, shutdown, |_| {}).await.unwrap();
        assert_eq!((status.leased, status.failed), (0, 0), "nothing is left in work: {status:?}");
        if status.waiting == 0 {
            break;
        }
        stops += 1;
    }
    assert!(stops > 0, "the campaign was over before it was stopped");
    assert_eq!(library.digest(&id).await.unwrap(), undisturbed(&campaign).await);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_case_that_fails_or_panics_is_given_up_and_leaves_the_others_alone() {
    let campaign = Campaign::built_in(Some(20)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let id = campaign.id();
    let task = Task { prepare: troubled, ..task(&id, 20) };
    let status = farm::embedded(&library, task, CancellationToken::new(), |_| {}).await.unwrap();
    assert_eq!(status, Status { finished: 18, failed: 2, ..Status::default() });
    let failures = library.failures(&id, 10).await.unwrap();
    let reasons: Vec<_> = failures.iter().map(|case| case.error.as_deref().unwrap()).collect();
    assert_eq!(reasons, ["the sleeper floats", "the program panicked: case 5 is bad"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_campaign_that_grows_keeps_what_it_has() {
    let few = Campaign::built_in(Some(10)).unwrap();
    let many = Campaign::built_in(Some(30)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &few).await;
    let id = few.id();
    let run = async |cases| {
        let shutdown = CancellationToken::new();
        let first = AtomicU32::new(u32::MAX);
        let seen = |status: Status| {
            first.fetch_min(status.finished, Ordering::Relaxed);
        };
        farm::embedded(&library, task(&id, cases), shutdown, seen).await.unwrap();
        first.into_inner()
    };
    assert_eq!(run(10).await, 0);
    farm::prepare(&library, &many).await.unwrap();
    assert_eq!(run(30).await, 10);
    assert_eq!(library.status(&id).await.unwrap().finished, 30);
    assert_eq!(library.digest(&id).await.unwrap(), undisturbed(&many).await);
}

/// A coordinator of the first 20 cases of the built-in campaign.
struct Coordinator {
    url: String,
    library: Library,
    campaign: Campaign,
    _folder: TempDir,
}

async fn coordinator() -> Coordinator {
    let campaign = Campaign::built_in(Some(20)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let timing = Timing { lease: Duration::from_millis(400), ..Timing::default() };
    let dispatch = Dispatch::new(library.clone(), &campaign.id(), 20, timing).await.unwrap();
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let service = Server::builder().add_service(FarmServer::new(dispatch));
    tokio::spawn(service.serve_with_incoming(TcpIncoming::from(listener)));
    Coordinator { url, library, campaign, _folder: folder }
}

async fn registered(coordinator: &Coordinator, worker: &str) -> FarmClient<Channel> {
    let mut client = FarmClient::connect(coordinator.url.clone()).await.unwrap();
    client.register(registration(worker, MODEL_HASH)).await.unwrap();
    client
}

fn registration(worker: &str, model_hash: &str) -> RegisterRequest {
    RegisterRequest {
        worker: worker.to_owned(),
        code_version: "9.9.9".to_owned(),
        model_hash: model_hash.to_owned(),
        cores: 1,
        protocol_version: PROTOCOL_VERSION,
    }
}

async fn lease(client: &mut FarmClient<Channel>, worker: &str) -> messages::LeaseResponse {
    let request = LeaseRequest { worker: worker.to_owned(), cases_max: 4 };
    client.lease(request).await.unwrap().into_inner()
}

fn report(lease: &messages::LeaseResponse, worker: &str) -> ReportRequest {
    let experiment = Experiment::from_json(&lease.experiment_json).unwrap();
    let pass = |&speed_km_h: &f64| messages::PassFeatures {
        speed_km_h,
        log_power: vec![0.5; experiment.features.frequencies_hz().len()],
        band_levels_db: vec![1.0; ThirdOctave::COUNT],
    };
    let passes = messages::Passes { passes: experiment.speeds_km_h.iter().map(pass).collect() };
    let case = |case: &messages::LeasedCase| CaseReport {
        sobol_index: case.sobol_index,
        epoch: case.epoch,
        parameter_hash: case.parameter_hash.clone(),
        duration_s: 0.1,
        outcome: Some(messages::case_report::Outcome::Passes(passes.clone())),
    };
    ReportRequest {
        worker: worker.to_owned(),
        campaign_id: lease.campaign_id.clone(),
        experiment_hash: lease.experiment_hash.clone(),
        cases: lease.cases.iter().map(case).collect(),
    }
}

async fn verdicts(client: &mut FarmClient<Channel>, request: ReportRequest) -> Vec<Verdict> {
    let response = client.report(request).await.unwrap().into_inner();
    response.receipts.iter().map(messages::Receipt::verdict).collect()
}

#[tokio::test]
async fn a_worker_of_other_physics_is_refused_with_both_hashes() {
    let coordinator = coordinator().await;
    let mut client = FarmClient::connect(coordinator.url.clone()).await.unwrap();
    let status = client.register(registration("w", "other")).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert!(status.message().contains("other") && status.message().contains(MODEL_HASH));

    let config = Config {
        model_hash: Some("other".to_owned()),
        prepare: stand_in,
        ..Config::new(coordinator.url.clone(), CORES)
    };
    let error = agent::run(config, CancellationToken::new()).await.unwrap_err();
    assert!(matches!(error, AgentError::Refused { .. }), "{error}");
}

#[tokio::test]
async fn a_worker_that_is_not_registered_gets_and_gives_nothing() {
    let coordinator = coordinator().await;
    let mut known = registered(&coordinator, "known").await;
    let leased = lease(&mut known, "known").await;
    let stranger = LeaseRequest { worker: "stranger".to_owned(), cases_max: 1 };
    assert_eq!(known.lease(stranger).await.unwrap_err().code(), Code::Unauthenticated);
    let refused = known.report(report(&leased, "stranger")).await.unwrap_err();
    assert_eq!(refused.code(), Code::Unauthenticated);
}

#[tokio::test]
async fn malformed_reports_are_refused_and_the_service_goes_on() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "w").await;
    let leased = lease(&mut client, "w").await;
    let good = report(&leased, "w");
    let passes = |request: &mut ReportRequest| match request.cases[0].outcome.take().unwrap() {
        messages::case_report::Outcome::Passes(passes) => passes,
        messages::case_report::Outcome::Failure(_) => panic!("the report is of a finished case"),
    };
    let mut nan = good.clone();
    let mut changed = passes(&mut nan);
    changed.passes[1].log_power[7] = f64::NAN;
    nan.cases[0].outcome = Some(messages::case_report::Outcome::Passes(changed));
    let mut short = good.clone();
    let mut changed = passes(&mut short);
    changed.passes[0].band_levels_db.pop();
    short.cases[0].outcome = Some(messages::case_report::Outcome::Passes(changed));
    let mut empty = good.clone();
    empty.cases[0].outcome = None;
    for bad in [nan, short, empty] {
        assert_eq!(client.report(bad).await.unwrap_err().code(), Code::InvalidArgument);
    }
    assert_eq!(coordinator.library.status(&coordinator.campaign.id()).await.unwrap().finished, 0);
    assert_eq!(verdicts(&mut client, good).await, [Verdict::Stored; 4]);
}

#[tokio::test]
async fn results_of_other_cases_or_experiments_are_not_stored() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "w").await;
    let good = report(&lease(&mut client, "w").await, "w");
    let mut other_experiment = good.clone();
    other_experiment.experiment_hash = "0".to_owned();
    assert_eq!(verdicts(&mut client, other_experiment).await, [Verdict::Refused; 4]);
    let mut not_leased = good.clone();
    not_leased.cases[0].sobol_index = 15;
    assert_eq!(verdicts(&mut client, not_leased).await[0], Verdict::Refused);
}

#[tokio::test]
async fn a_silent_worker_s_cases_go_to_another_and_its_late_results_change_nothing() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "silent").await;
    let first = lease(&mut client, "silent").await;
    tokio::time::sleep(Duration::from_millis(450)).await;
    client.register(registration("quick", MODEL_HASH)).await.unwrap();
    let second = lease(&mut client, "quick").await;
    assert_eq!(first.cases[0].sobol_index, second.cases[0].sobol_index);
    assert_eq!((first.cases[0].epoch, second.cases[0].epoch), (1, 2));
    assert_eq!(verdicts(&mut client, report(&second, "quick")).await, [Verdict::Stored; 4]);
    assert_eq!(verdicts(&mut client, report(&first, "silent")).await, [Verdict::Duplicate; 4]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_computation_longer_than_its_lease_keeps_it_by_heartbeats() {
    struct Slow(StandIn);
    impl Simulate for Slow {
        fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
            std::thread::sleep(Duration::from_millis(1200));
            self.0.simulate(cases)
        }
    }
    let slow = |experiment: &Experiment| {
        Ok(Box::new(Slow(StandIn(experiment.clone()))) as Box<dyn Simulate>)
    };
    let campaign = Campaign::built_in(Some(8)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let id = campaign.id();
    let timing = Timing {
        lease: Duration::from_millis(400),
        heartbeat: Duration::from_millis(100),
        retry: Duration::from_millis(50),
    };
    // The second core asks for work all the while.
    let task = Task { prepare: slow, timing, ..Task::new(&id, 8, CORES) };
    farm::embedded(&library, task, CancellationToken::new(), |_| {}).await.unwrap();
    for index in 0..8 {
        assert_eq!(library.case(&id, index).await.unwrap().unwrap().attempts, 0);
    }
}
