//! A worker that computes wrong results is quarantined; one that fails is suspended.

use crate::support::{
    CORES, Coordinator, StandIn, coordinator_with, lease, library, registered, registration,
    renewal, report, stand_in, verdicts, with_checksum,
};
use std::net::Ipv4Addr;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracktwin_experiment::{
    Case, Experiment, ExperimentError, MODEL_HASH, Outcome, Prepare, Simulate,
};
use tracktwin_farm::campaign::Campaign;
use tracktwin_farm::dispatch::{Settings, Timing};
use tracktwin_farm::embedded;
use tracktwin_farm::security::Security;
use tracktwin_library::WorkerState;
use tracktwin_protocol::farm::{self as messages, CaseReport, ReportRequest, Verdict};
use tracktwin_worker::agent::{self, Config};

/// A machine whose levels are all too high by 0.1 dB.
struct Faulty(StandIn);

impl Simulate for Faulty {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        let mut outcomes = self.0.simulate(cases);
        for outcome in &mut outcomes {
            let Outcome::Finished(passes) = outcome else { continue };
            let levels = passes.iter_mut().flat_map(|pass| &mut pass.features.band_levels_db);
            levels.for_each(|level| *level += 0.1);
        }
        outcomes
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature is that of a preparation")]
fn faulty(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(Faulty(StandIn(experiment.clone()))))
}

async fn serving(audit_share: f64) -> Coordinator {
    let settings = Settings { prepare: stand_in, audit_share, ..Settings::default() };
    coordinator_with(settings, Security::default(), 40).await
}

async fn work(coordinator: &Coordinator, worker: &str, prepare: Prepare) {
    let config = Config {
        prepare,
        worker: worker.to_owned(),
        // Longer than the pause after which audits are looked for again.
        idle_exit: Some(Duration::from_secs(3)),
        ..Config::new(coordinator.url.clone(), CORES)
    };
    let run = agent::run(config, CancellationToken::new());
    tokio::time::timeout(Duration::from_secs(20), run).await.unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sound_workers_agree() {
    let coordinator = serving(0.5).await;
    let id = coordinator.campaign.id();
    work(&coordinator, "first", stand_in).await;
    let open = coordinator.library.audits(&id).await.unwrap().open;
    assert!((5..35).contains(&open), "about half of 40 are to be audited: {open}");
    work(&coordinator, "second", stand_in).await;
    let audits = coordinator.library.audits(&id).await.unwrap();
    assert_eq!((audits.open, audits.agree, audits.differ), (0, open, 0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_differs_is_quarantined_and_its_results_are_flagged_whoever_audits_whom() {
    for (first, second, wrong) in
        [(faulty as Prepare, stand_in as Prepare, "first"), (stand_in, faulty, "second")]
    {
        let coordinator = serving(0.2).await;
        work(&coordinator, "first", first).await;
        work(&coordinator, "second", second).await;
        let audits = coordinator.library.audits(&coordinator.campaign.id()).await.unwrap();
        assert!(audits.differ > 0, "{audits:?}");
        for name in ["first", "second"] {
            let worker = coordinator.library.worker(name).await.unwrap().unwrap();
            let expected =
                if name == wrong { WorkerState::Quarantined } else { WorkerState::Active };
            assert_eq!(worker.state, expected, "{name}: {:?}", worker.reason);
        }
        let mut client = registered(&coordinator, wrong).await;
        let answer = lease(&mut client, wrong).await;
        assert!(answer.cases.is_empty() && answer.reason.contains("quarantine"), "{answer:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn where_nobody_can_judge_nobody_is_blamed() {
    let cannot = |_: &Experiment| Err(ExperimentError::Speeds { speeds: Vec::new() });
    let settings = Settings { prepare: cannot, audit_share: 0.2, ..Settings::default() };
    let coordinator = coordinator_with(settings, Security::default(), 40).await;
    work(&coordinator, "first", stand_in).await;
    work(&coordinator, "second", faulty).await;
    let audits = coordinator.library.audits(&coordinator.campaign.id()).await.unwrap();
    assert!(audits.differ > 0, "{audits:?}");
    for name in ["first", "second"] {
        let worker = coordinator.library.worker(name).await.unwrap().unwrap();
        assert_eq!(worker.state, WorkerState::Active, "{name}: {:?}", worker.reason);
    }
}

#[tokio::test]
async fn what_an_auditor_gives_back_goes_to_the_next_at_once() {
    let coordinator = serving(1.0).await;
    let mut client = registered(&coordinator, "first").await;
    let leased = lease(&mut client, "first").await;
    client.report(report(&leased, "first")).await.unwrap();
    // There was nothing to audit when the first one asked; for two seconds nobody looks again, and
    // the second may not be the one that finds this over.
    tokio::time::sleep(Duration::from_millis(2100)).await;
    for auditor in ["second", "third"] {
        client.register(registration(auditor, MODEL_HASH)).await.unwrap();
        let audits = lease(&mut client, auditor).await;
        assert!(!audits.cases.is_empty() && audits.cases.iter().all(|case| case.epoch == 0));
        let messages::RenewRequest { worker, campaign_id, cases } = renewal(&audits, auditor);
        let request = messages::ReleaseRequest { worker, campaign_id, cases };
        client.release(request).await.unwrap();
    }
}

#[tokio::test]
async fn a_worker_that_can_audit_nothing_keeps_nobody_from_auditing() {
    let coordinator = serving(1.0).await;
    let mut client = registered(&coordinator, "first").await;
    client.register(registration("second", MODEL_HASH)).await.unwrap();
    let leased = lease(&mut client, "first").await;
    client.report(report(&leased, "first")).await.unwrap();
    // There was no audit at all when the first one asked, which is not looked into again for two seconds.
    tokio::time::sleep(Duration::from_millis(2100)).await;
    let others = lease(&mut client, "first").await;
    assert!(others.cases.iter().all(|case| case.epoch > 0), "it does not audit itself");
    let audits = lease(&mut client, "second").await;
    assert!(!audits.cases.is_empty() && audits.cases.iter().all(|case| case.epoch == 0));
}

/// A machine that cannot simulate anything.
struct Broken;

impl Simulate for Broken {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        vec![Outcome::Failed { reason: "out of memory".to_owned() }; cases.len()]
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature is that of a preparation")]
fn broken(_: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(Broken))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_auditor_that_fails_is_suspended_and_its_audits_go_to_another() {
    let coordinator = serving(0.5).await;
    work(&coordinator, "first", stand_in).await;
    work(&coordinator, "broken", broken).await;
    let broken = coordinator.library.worker("broken").await.unwrap().unwrap();
    assert_eq!(broken.state, WorkerState::Active, "{:?}", broken.reason);
    let mut client = registered(&coordinator, "broken").await;
    let answer = lease(&mut client, "broken").await;
    assert!(answer.cases.is_empty() && answer.reason.contains("suspended"), "{answer:?}");
    work(&coordinator, "third", stand_in).await;
    let audits = coordinator.library.audits(&coordinator.campaign.id()).await.unwrap();
    assert_eq!((audits.open, audits.differ), (0, 0));
    assert!(audits.agree > 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_audit_that_failed_three_times_is_simulated_by_the_coordinator() {
    for (prepare, wrong) in [(stand_in as Prepare, None), (faulty, Some("first"))] {
        let settings = Settings {
            prepare: stand_in,
            audit_share: 0.2,
            suspends_failing: false,
            ..Settings::default()
        };
        let coordinator = coordinator_with(settings, Security::default(), 40).await;
        work(&coordinator, "first", prepare).await;
        work(&coordinator, "broken", broken).await;
        let audits = coordinator.library.audits(&coordinator.campaign.id()).await.unwrap();
        assert_eq!(audits.open, 0, "they are not repeated for ever: {audits:?}");
        assert_eq!(audits.differ > 0, wrong.is_some(), "{audits:?}");
        for name in ["first", "broken"] {
            let worker = coordinator.library.worker(name).await.unwrap().unwrap();
            let expected =
                if Some(name) == wrong { WorkerState::Quarantined } else { WorkerState::Active };
            assert_eq!(worker.state, expected, "{name}: {:?}", worker.reason);
        }
    }
}

#[tokio::test]
async fn an_audit_is_leased_as_long_as_its_auditor_lives_and_outlives_the_coordinator() {
    let timing = Timing::of_lease(Duration::from_millis(600));
    let settings = Settings { timing, prepare: stand_in, audit_share: 1.0, ..Settings::default() };
    let mut coordinator = coordinator_with(settings.clone(), Security::default(), 4).await;
    let mut client = registered(&coordinator, "first").await;
    let leased = lease(&mut client, "first").await;
    client.report(report(&leased, "first")).await.unwrap();
    client.register(registration("slow", MODEL_HASH)).await.unwrap();
    // After a search that found nothing, the next one is two seconds later.
    tokio::time::sleep(Duration::from_millis(2100)).await;
    let audits = lease(&mut client, "slow").await;
    assert_eq!(audits.cases.len(), 4);
    coordinator = coordinator.restarted(settings).await;
    let mut client = registered(&coordinator, "slow").await;
    client.register(registration("quick", MODEL_HASH)).await.unwrap();
    for _ in 0..12 {
        client.renew(renewal(&audits, "slow")).await.unwrap();
        assert!(lease(&mut client, "quick").await.cases.is_empty(), "the audits are taken");
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    let mut first = report(&audits, "slow");
    first.cases.truncate(1);
    assert_eq!(verdicts(&mut client, first).await, [Verdict::Duplicate]);
    let counts = coordinator.library.audits(&coordinator.campaign.id()).await.unwrap();
    assert_eq!((counts.open, counts.agree), (3, 1));
    // The others are no longer renewed.
    tokio::time::sleep(Duration::from_millis(2700)).await;
    assert_eq!(lease(&mut client, "quick").await.cases.len(), 3);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn audits_that_nobody_can_do_are_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let campaign = Campaign::built_in(Some(8)).unwrap();
    let library = library(&folder, &campaign).await;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let coordinator = tracktwin_farm::coordinator::Coordinator {
        claim: embedded::claim(&library).await.unwrap(),
        library: library.clone(),
        listener,
        dashboard: None,
        security: Security::default(),
        settings: Settings { prepare: stand_in, audit_share: 1.0, ..Settings::default() },
        exit_when_done: true,
    };
    let served = tokio::spawn(coordinator.run(CancellationToken::new()));
    let stop = CancellationToken::new();
    let config = Config { prepare: stand_in, ..Config::new(url, CORES) };
    let worker = tokio::spawn(agent::run(config, stop.clone()));
    tokio::time::timeout(Duration::from_secs(20), served).await.unwrap().unwrap().unwrap();
    let audits = library.audits(&campaign.id()).await.unwrap();
    assert_eq!((audits.open, audits.agree), (8, 0));
    stop.cancel();
    worker.await.unwrap().unwrap();
}

#[tokio::test]
async fn a_worker_that_fails_where_another_does_not_is_put_aside() {
    let coordinator = serving(0.0).await;
    let mut client = registered(&coordinator, "bad").await;
    client.register(registration("good", MODEL_HASH)).await.unwrap();
    let leased = lease(&mut client, "good").await;
    client.report(report(&leased, "good")).await.unwrap();
    for _ in 0..2 {
        let leased = lease(&mut client, "bad").await;
        let failed = |case: &messages::LeasedCase| {
            with_checksum(CaseReport {
                sobol_index: case.sobol_index,
                epoch: case.epoch,
                parameter_hash: case.parameter_hash.clone(),
                duration_s: 0.1,
                outcome: Some(messages::case_report::Outcome::Failure(messages::Failure {
                    reason: "out of memory".to_owned(),
                })),
                checksum: String::new(),
            })
        };
        let request = ReportRequest {
            worker: "bad".to_owned(),
            campaign_id: leased.campaign_id.clone(),
            experiment_hash: leased.experiment_hash.clone(),
            cases: leased.cases.iter().map(failed).collect(),
            traceparent: String::new(),
        };
        client.report(request).await.unwrap();
    }
    let answer = lease(&mut client, "bad").await;
    assert!(answer.cases.is_empty() && answer.reason.contains("suspended"), "{answer:?}");
    assert!(answer.retry_after_s > 10.0);
    assert_eq!(lease(&mut client, "good").await.cases.len(), 4);
}
