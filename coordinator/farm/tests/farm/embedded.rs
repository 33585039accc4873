//! The farm in one process.

use crate::support::{CORES, StandIn, library, task, undisturbed};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tokio_util::sync::CancellationToken;
use tracktwin_experiment::{Case, Experiment, ExperimentError, Outcome, Simulate};
use tracktwin_farm::campaign::Campaign;
use tracktwin_farm::dispatch::Timing;
use tracktwin_farm::embedded::{self, FarmError, Task};
use tracktwin_library::{LibraryError, Status};

/// A simulator that fails at case 3 and panics at case 5.
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_campaign_that_is_paused_or_cancelled_ends_the_run_with_the_remedy() {
    let campaign = Campaign::built_in(Some(2000)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let id = campaign.id();
    // Each run begins by resuming the campaign; somebody stops it as soon as it is at work.
    for (cancels, state) in [(false, "paused"), (true, "cancelled")] {
        let (operator, stopped) = (library.clone(), id.clone());
        let stop = move |_| {
            let (operator, stopped) = (operator.clone(), stopped.clone());
            tokio::spawn(async move {
                let stop = if cancels {
                    operator.cancel(&stopped).await
                } else {
                    operator.pause(&stopped).await
                };
                stop.unwrap();
            });
        };
        let task = task(&id, campaign.cases);
        let run = embedded::run_embedded(&library, task, CancellationToken::new(), stop);
        let error = run.await.unwrap_err();
        assert!(matches!(error, FarmError::NotRunning { .. }), "{error}");
        let told = format!("was {state} meanwhile");
        let told = [told.as_str(), "the same command continues it"];
        assert!(told.iter().all(|part| error.to_string().contains(part)), "{error}");
    }
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
        // Longer each time: a machine that is busy with other things gets there as well.
        let after = Duration::from_millis(40 + 20 * stops);
        tokio::spawn(async move {
            tokio::time::sleep(after).await;
            stop.cancel();
        });
        let task = task(&id, campaign.cases);
        let status = embedded::run_embedded(&library, task, shutdown, |_| {}).await.unwrap();
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
    let status =
        embedded::run_embedded(&library, task, CancellationToken::new(), |_| {}).await.unwrap();
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
        embedded::run_embedded(&library, task(&id, cases), shutdown, seen).await.unwrap();
        first.into_inner()
    };
    assert_eq!(run(10).await, 0);
    tracktwin_farm::campaign::store_campaign(&library, &many).await.unwrap();
    assert_eq!(run(30).await, 10);
    assert_eq!(library.status(&id).await.unwrap().finished, 30);
    assert_eq!(library.digest(&id).await.unwrap(), undisturbed(&many).await);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_library_whose_file_is_removed_ends_the_run() {
    let campaign = Campaign::built_in(Some(2000)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let id = campaign.id();
    let file = folder.path().join("library.sqlite");
    let remove = |_| {
        let _ = std::fs::remove_file(&file);
    };
    let task = task(&id, campaign.cases);
    let run = embedded::run_embedded(&library, task, CancellationToken::new(), remove);
    let ended = tokio::time::timeout(Duration::from_secs(20), run).await.unwrap();
    let FarmError::Library(error) = ended.unwrap_err() else { panic!("it is the library's fault") };
    // A reading connection that is opened now finds no file.
    let gone = matches!(error, LibraryError::FileGone { .. } | LibraryError::NotOpened { .. });
    assert!(gone, "{error:?}");
}

/// A simulator that needs three times the lease duration of the tests.
struct Slow(StandIn);

impl Simulate for Slow {
    fn simulate(&self, cases: &[Case]) -> Vec<Outcome> {
        std::thread::sleep(Duration::from_millis(1200));
        self.0.simulate(cases)
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the signature is that of a preparation")]
fn slow(experiment: &Experiment) -> Result<Box<dyn Simulate>, ExperimentError> {
    Ok(Box::new(Slow(StandIn(experiment.clone()))))
}

/// Runs eight slow cases with leases of 400 ms and this heartbeat; no case may be leased twice.
async fn no_lease_is_lost(heartbeat: Duration) {
    let campaign = Campaign::built_in(Some(8)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let id = campaign.id();
    let timing =
        Timing { lease: Duration::from_millis(400), heartbeat, retry: Duration::from_millis(50) };
    // The second core asks for work all the while.
    let task = Task { prepare: slow, timing, ..Task::new(&id, 8, CORES) };
    embedded::run_embedded(&library, task, CancellationToken::new(), |_| {}).await.unwrap();
    for index in 0..8 {
        assert_eq!(library.case(&id, index).await.unwrap().unwrap().attempts, 0);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_computation_longer_than_its_lease_keeps_it_by_heartbeats() {
    no_lease_is_lost(Duration::from_millis(100)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn in_one_process_a_lease_needs_no_heartbeat() {
    // As on a machine so busy that none gets through.
    no_lease_is_lost(Duration::from_mins(1)).await;
}

#[tokio::test]
async fn a_library_that_another_process_serves_is_left_as_it_is() {
    let campaign = Campaign::built_in(Some(8)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let library = library(&folder, &campaign).await;
    let claim = embedded::claim(&library).await.unwrap();
    let refused = embedded::claim(&library).await.err().unwrap();
    let in_use = matches!(refused, FarmError::Library(LibraryError::InUse { .. }));
    assert!(in_use, "{refused:?}");
    drop(claim);
    embedded::claim(&library).await.unwrap();
}
