//! Responses and refusals of the service.

use crate::support::{
    CORES, StandIn, coordinator, coordinator_with, lease, pass, registered, registration, renewal,
    report, stand_in, until, verdicts, with_checksum,
};
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio_util::sync::CancellationToken;
use tonic::Code;
use tracktwin_experiment::{Case, Experiment, ExperimentError, MODEL_HASH, Outcome, Simulate};
use tracktwin_farm::dispatch::{Settings, Timing};
use tracktwin_farm::security::Security;
use tracktwin_protocol::farm::farm_client::FarmClient;
use tracktwin_protocol::farm::{
    self as messages, LeaseRequest, RegisterRequest, ReportRequest, Verdict,
};
use tracktwin_signal::ThirdOctave;
use tracktwin_worker::agent::{self, AgentError, Config, Seams};

#[tokio::test]
async fn a_worker_of_other_physics_is_refused_with_both_hashes() {
    let coordinator = coordinator().await;
    let mut client = FarmClient::connect(coordinator.url.clone()).await.unwrap();
    let status = client.register(registration("w", "other")).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert!(status.message().contains("other") && status.message().contains(MODEL_HASH));

    let config = Config {
        prepare: stand_in,
        seams: Seams { model_hash: "other".to_owned(), ..Seams::default() },
        ..Config::new(coordinator.url.clone(), CORES)
    };
    let error = agent::run(config, CancellationToken::new()).await.unwrap_err();
    assert!(matches!(error, AgentError::Refused { .. }), "{error}");
}

#[tokio::test]
async fn a_worker_of_an_older_protocol_is_told_to_update() {
    let coordinator = coordinator().await;
    let mut client = FarmClient::connect(coordinator.url.clone()).await.unwrap();
    let older = messages::RegisterRequest { protocol_version: 0, ..registration("w", MODEL_HASH) };
    let status = client.register(older).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert!(status.message().contains("update the worker"), "{status}");
    let newer = messages::RegisterRequest { protocol_version: 99, ..registration("w", MODEL_HASH) };
    let status = client.register(newer).await.unwrap_err();
    assert!(status.message().contains("update the coordinator"), "{status}");
}

#[tokio::test]
async fn more_cases_than_a_message_may_hold_are_refused() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "w").await;
    let cases = vec![messages::HeldCase { sobol_index: 1, epoch: 1 }; 5000];
    let renew = messages::RenewRequest {
        worker: "w".to_owned(),
        campaign_id: coordinator.campaign.id(),
        cases,
    };
    assert_eq!(client.renew(renew).await.unwrap_err().code(), Code::InvalidArgument);
}

#[tokio::test]
async fn a_message_that_is_too_large_is_refused_and_the_service_goes_on() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "w").await;
    let mut endless = registration("w", MODEL_HASH);
    endless.code_version = "x".repeat(17 << 20);
    let status = client.register(endless).await.unwrap_err();
    assert_eq!(status.code(), Code::OutOfRange, "{status}");
    let mut long = registration("w", MODEL_HASH);
    long.worker = "x".repeat(1000);
    assert_eq!(client.register(long).await.unwrap_err().code(), Code::InvalidArgument);
    assert_eq!(lease(&mut client, "w").await.cases.len(), 4);
}

#[tokio::test]
async fn results_of_cases_that_another_worker_holds_are_refused() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "holder").await;
    let leased = lease(&mut client, "holder").await;
    client.register(registration("thief", MODEL_HASH)).await.unwrap();
    let stolen = verdicts(&mut client, report(&leased, "thief")).await;
    assert_eq!(stolen, [Verdict::Refused; 4]);
    assert_eq!(verdicts(&mut client, report(&leased, "holder")).await, [Verdict::Stored; 4]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_without_work_ends_when_it_was_told_to() {
    let coordinator = coordinator().await;
    let config = Config {
        prepare: stand_in,
        idle_exit: Some(Duration::from_millis(600)),
        ..Config::new(coordinator.url.clone(), CORES)
    };
    let run = agent::run(config, CancellationToken::new());
    tokio::time::timeout(Duration::from_secs(10), run).await.unwrap().unwrap();
    assert_eq!(coordinator.library.status(&coordinator.campaign.id()).await.unwrap().finished, 20);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_reaches_nobody_gives_up_when_it_was_told_to() {
    let config = Config {
        give_up_after: Some(Duration::from_millis(300)),
        // The discard port: nobody listens there.
        ..Config::new("http://127.0.0.1:9".to_owned(), CORES)
    };
    let run = agent::run(config, CancellationToken::new());
    let error = tokio::time::timeout(Duration::from_secs(10), run).await.unwrap().unwrap_err();
    assert!(matches!(error, AgentError::GaveUp { .. }) && error.may_pass(), "{error}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn where_one_coordinator_is_gone_the_worker_turns_to_the_next() {
    let coordinator = coordinator().await;
    let config = Config {
        coordinators: vec!["http://127.0.0.1:9".to_owned(), coordinator.url.clone()],
        prepare: stand_in,
        idle_exit: Some(Duration::from_millis(300)),
        ..Config::new(String::new(), CORES)
    };
    let run = agent::run(config, CancellationToken::new());
    tokio::time::timeout(Duration::from_secs(10), run).await.unwrap().unwrap();
    assert_eq!(coordinator.library.status(&coordinator.campaign.id()).await.unwrap().finished, 20);
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

/// Takes two seconds for its cases.
struct Slow(StandIn);

/// Whether a [`Slow`] simulation has ended.
static SLOW_ENDED: AtomicBool = AtomicBool::new(false);

impl Simulate for Slow {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        std::thread::sleep(Duration::from_secs(2));
        SLOW_ENDED.store(true, Ordering::Relaxed);
        self.0.simulate(cases)
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature is that of a preparation")]
fn slow(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(Slow(StandIn(experiment.clone()))))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_busy_worker_registers_with_a_new_coordinator_and_keeps_its_leases() {
    let timing = Timing::of_lease(Duration::from_secs(1));
    let settings = Settings { timing, prepare: stand_in, ..Settings::default() };
    let coordinator = coordinator_with(settings.clone(), Security::default(), 8).await;
    let config = Config {
        prepare: slow,
        worker: "busy".to_owned(),
        idle_exit: Some(Duration::from_millis(300)),
        ..Config::new(coordinator.url.clone(), NonZeroUsize::MIN)
    };
    let holdings = config.holdings.clone();
    let worker = tokio::spawn(agent::run(config, CancellationToken::new()));
    let id = coordinator.campaign.id();
    until("it holds cases", async || !holdings.of(&id).is_empty()).await;
    let coordinator = coordinator.restarted(settings).await;
    let restarted_unix_ms = coordinator.library.now_unix_ms();
    until("it is seen while it is busy", async || {
        let record = coordinator.library.worker("busy").await.unwrap().unwrap();
        assert!(!SLOW_ENDED.load(Ordering::Relaxed), "it is no longer busy");
        record.last_seen_unix_ms >= restarted_unix_ms
    })
    .await;
    worker.await.unwrap().unwrap();
    let last = coordinator.library.case(&id, 0).await.unwrap();
    assert_eq!(coordinator.library.status(&id).await.unwrap().finished, 8);
    assert_eq!(last.map(|case| case.attempts), Some(0), "no lease was lost");
}

#[tokio::test]
async fn the_leases_of_an_unknown_worker_are_renewed_before_it_registers() {
    let timing = Timing { lease: Duration::from_millis(1500), ..Timing::default() };
    let settings = Settings { timing, prepare: stand_in, ..Settings::default() };
    let coordinator = coordinator_with(settings.clone(), Security::default(), 4).await;
    let mut client = registered(&coordinator, "w").await;
    let leased = lease(&mut client, "w").await;
    let coordinator = coordinator.restarted(settings).await;
    let mut client = registered(&coordinator, "other").await;
    for _ in 0..20 {
        let refused = client.renew(renewal(&leased, "w")).await.unwrap_err();
        assert_eq!(refused.code(), Code::Unauthenticated);
        assert!(lease(&mut client, "other").await.cases.is_empty(), "a lease was lost");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

#[tokio::test]
async fn what_no_worker_asks_is_refused_and_holds_up_nobody() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "w").await;
    let liar = RegisterRequest { cores: u32::MAX, ..registration("liar", MODEL_HASH) };
    assert_eq!(client.register(liar).await.unwrap_err().code(), Code::InvalidArgument);
    let nothing = LeaseRequest { worker: "w".to_owned(), cases_max: 0 };
    assert_eq!(client.lease(nothing).await.unwrap_err().code(), Code::InvalidArgument);
    let leased = lease(&mut client, "w").await;
    assert_eq!(leased.cases.len(), 4);
    for worker in ["a\0b".to_owned(), "w".repeat(100_000)] {
        let renewal = messages::RenewRequest {
            worker,
            campaign_id: leased.campaign_id.clone(),
            cases: Vec::new(),
        };
        assert_eq!(client.renew(renewal).await.unwrap_err().code(), Code::InvalidArgument);
    }
    let mut long = report(&leased, "w");
    long.cases[0].duration_s = 1e308;
    assert_eq!(client.report(long).await.unwrap_err().code(), Code::InvalidArgument);
}

#[tokio::test]
async fn a_case_with_another_checksum_stays_leased_and_spoils_no_other() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "w").await;
    let leased = lease(&mut client, "w").await;
    let good = report(&leased, "w");
    let mut damaged = good.clone();
    damaged.cases[0].checksum = damaged.cases[1].checksum.clone();
    damaged.cases[1].outcome = None;
    damaged.cases[2].sobol_index += 100;
    let expected = [Verdict::Damaged, Verdict::Damaged, Verdict::Damaged, Verdict::Stored];
    assert_eq!(verdicts(&mut client, damaged).await, expected);
    let status = coordinator.library.status(&coordinator.campaign.id()).await.unwrap();
    assert_eq!((status.finished, status.leased), (1, 3));
    // Sent again, whole.
    let expected = [Verdict::Stored, Verdict::Stored, Verdict::Stored, Verdict::Duplicate];
    assert_eq!(verdicts(&mut client, good).await, expected);
    let verified = coordinator.library.verify(|| ()).await.unwrap();
    assert_eq!((verified.attested, verified.unattested), (4, 0));
    assert_eq!(verified.findings, []);
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
    let bins = changed.passes[1].log_power.len() / size_of::<f64>();
    let mut log_power = vec![0.5; bins];
    log_power[7] = f64::NAN;
    changed.passes[1] = pass(changed.passes[1].speed_km_h, log_power);
    nan.cases[0].outcome = Some(messages::case_report::Outcome::Passes(changed));
    let mut short = good.clone();
    let mut changed = passes(&mut short);
    changed.passes[0].band_levels_db.truncate((ThirdOctave::COUNT - 1) * size_of::<f64>());
    short.cases[0].outcome = Some(messages::case_report::Outcome::Passes(changed));
    for bad in [&mut nan, &mut short] {
        bad.cases[0] = with_checksum(bad.cases[0].clone());
        let refused = client.report(bad.clone()).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument);
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
    not_leased.cases[0] = with_checksum(not_leased.cases[0].clone());
    assert_eq!(verdicts(&mut client, not_leased).await[0], Verdict::Refused);
}

#[tokio::test]
async fn a_silent_worker_s_cases_go_to_another_and_its_late_results_change_nothing() {
    let coordinator = coordinator().await;
    let mut client = registered(&coordinator, "silent").await;
    let first = lease(&mut client, "silent").await;
    // The lease must expire: who asks before gets other cases.
    tokio::time::sleep(Duration::from_millis(450)).await;
    client.register(registration("quick", MODEL_HASH)).await.unwrap();
    let second = lease(&mut client, "quick").await;
    assert_eq!(first.cases[0].sobol_index, second.cases[0].sobol_index);
    assert_eq!((first.cases[0].epoch, second.cases[0].epoch), (1, 2));
    assert_eq!(verdicts(&mut client, report(&second, "quick")).await, [Verdict::Stored; 4]);
    assert_eq!(verdicts(&mut client, report(&first, "silent")).await, [Verdict::Duplicate; 4]);
}

/// Blocks its thread for three lease durations before it returns a simulator.
fn slow_preparation(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    std::thread::sleep(Duration::from_millis(1200));
    stand_in(experiment)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_of_a_single_thread_keeps_its_leases_while_it_prepares() {
    let timing = Timing::of_lease(Duration::from_millis(400));
    let settings = Settings { timing, prepare: stand_in, ..Settings::default() };
    let coordinator = coordinator_with(settings, Security::default(), 8).await;
    let config = Config {
        prepare: slow_preparation,
        idle_exit: Some(Duration::from_millis(300)),
        ..Config::new(coordinator.url.clone(), NonZeroUsize::MIN)
    };
    let holdings = config.holdings.clone();
    let worker = std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(agent::run(config, CancellationToken::new()))
    });
    let id = coordinator.campaign.id();
    until("it holds cases", async || !holdings.of(&id).is_empty()).await;
    // Another asks for work all the while, and so ends what has expired.
    let mut other = registered(&coordinator, "other").await;
    until("all cases are done", async || {
        assert!(lease(&mut other, "other").await.cases.is_empty(), "a lease was lost");
        coordinator.library.status(&id).await.unwrap().finished == 8
    })
    .await;
    tokio::task::spawn_blocking(move || worker.join().unwrap()).await.unwrap().unwrap();
}
