//! Coordinators are killed.

use crate::farm::{Engine, Farm};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use system_tests::Process;

/// Kills the coordinator this number of times, and waits until the last one finishes.
fn coordinator_is_killed(farm: &Farm, times: u32) {
    let workers = [farm.worker(), farm.worker()];
    let mut acknowledged = BTreeMap::new();
    for kill in 0..times {
        let coordinator = farm.coordinator(0);
        // Moments spread over start, work and commit by the golden ratio.
        std::thread::sleep(Duration::from_millis(150 + u64::from(kill) * 618 % 700));
        if kill + 1 == times && acknowledged.is_empty() {
            // On a busy machine no coordinator has lived long enough yet.
            farm.reach(1);
        }
        coordinator.kill();
        acknowledged.extend(farm.results());
    }
    assert!(!farm.is_done(), "the campaign was over before the last was killed");
    let mut coordinator = farm.coordinator(0);
    Farm::finish(&mut coordinator);
    drop(workers);
    farm.assert_undisturbed();
    assert!(!acknowledged.is_empty(), "nothing was finished before a kill");
    let results = farm.results();
    for (case, came) in acknowledged {
        assert_eq!(results[&case], came, "case {case} was leased or stored again");
    }
}

#[test]
fn a_coordinator_killed_again_and_again_loses_nothing_sqlite() {
    let Some(farm) = Farm::many(Engine::Sqlite, 300) else { return };
    coordinator_is_killed(&farm, 4);
}

#[test]
fn a_coordinator_killed_again_and_again_loses_nothing_postgres() {
    let Some(farm) = Farm::many(Engine::Postgres, 300) else { return };
    coordinator_is_killed(&farm, 4);
}

#[test]
#[ignore = "takes a minute; see docs/farm-faults.md"]
fn a_coordinator_killed_twenty_times_loses_nothing() {
    for engine in [Engine::Sqlite, Engine::Postgres] {
        let Some(farm) = Farm::many(engine, 2000) else { continue };
        coordinator_is_killed(&farm, 20);
    }
}

#[test]
fn where_one_of_two_coordinators_dies_the_other_goes_on() {
    let Some(farm) = Farm::new(Engine::Postgres) else { return };
    let (first, mut second) = (farm.coordinator(0), farm.coordinator(1));
    let workers = [farm.worker(), farm.worker()];
    farm.reach(8);
    first.kill();
    Farm::finish(&mut second);
    drop(workers);
    farm.assert_undisturbed();
}

#[test]
fn a_second_coordinator_on_a_sqlite_library_is_refused_in_one_line() {
    let Some(farm) = Farm::new(Engine::Sqlite) else { return };
    let first = farm.coordinator(0);
    let worker = farm.worker();
    farm.reach(1);
    let mut second = farm.coordinator(1);
    assert_eq!(second.ended(Duration::from_secs(10)).code(), Some(2));
    drop((first, worker));
}

#[test]
fn whoever_is_refused_adds_nothing_to_the_library() {
    let Some(farm) = Farm::new(Engine::Sqlite) else { return };
    let first = farm.coordinator(0);
    let taken = format!("127.0.0.1:{}", farm.port(0));
    let worker = farm.worker();
    farm.reach(1);
    let mut run = farm.run(&["--cases", "128"]);
    assert_eq!(run.ended(Duration::from_secs(30)).code(), Some(2));
    // One whose library is served already, and one whose port is taken.
    for listen in ["127.0.0.1:0", &taken] {
        let mut second = farm.coordinating(listen);
        second.arg("--campaign").arg(farm.campaign()).args(["--cases", "128"]);
        let mut second = Process::start(&mut second, "coordinator");
        assert_eq!(second.ended(Duration::from_secs(30)).code(), Some(2));
    }
    assert_eq!(farm.cases(), 64);
    drop((first, worker));
}

#[test]
fn a_coordinator_that_is_back_has_its_workers_back_within_five_seconds() {
    let Some(farm) = Farm::new(Engine::Sqlite) else { return };
    let first = farm.coordinator(0);
    let worker = farm.worker();
    farm.reach(1);
    first.kill();
    // Long enough for the worker's waits to have grown.
    std::thread::sleep(Duration::from_secs(3));
    let before = farm.finished();
    let begun = Instant::now();
    let mut second = farm.coordinator(0);
    farm.reach(before + 1);
    let back = begun.elapsed();
    assert!(back < Duration::from_secs(5), "{back:?}");
    Farm::finish(&mut second);
    drop(worker);
    farm.assert_undisturbed();
}
