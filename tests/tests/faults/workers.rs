//! Workers that are killed, stopped and told to end.

use crate::farm::{Engine, Farm};
use std::time::{Duration, Instant};

/// Kills a worker now and then, another one each time, and starts a new one in its place.
fn workers_are_killed(farm: &Farm, every: Duration) {
    let mut coordinator = farm.coordinator(0);
    let mut workers: Vec<_> = (0..3).map(|_| farm.worker()).collect();
    let mut kills = 0_usize;
    while coordinator.0.try_wait().unwrap().is_none() {
        std::thread::sleep(every);
        // Golden-ratio steps go round all of them without a pattern.
        let victim = workers.swap_remove((kills * 618) % 1000 % workers.len());
        victim.kill();
        workers.push(farm.worker());
        kills += 1;
    }
    Farm::finish(&mut coordinator);
    eprintln!("{kills} workers were killed");
    assert!(kills > 1, "the campaign was over before anybody was killed");
    farm.assert_undisturbed();
}

#[test]
fn workers_killed_again_and_again_lose_nothing_sqlite() {
    let Some(farm) = Farm::new(Engine::Sqlite) else { return };
    workers_are_killed(&farm, Duration::from_secs(1));
}

#[test]
fn workers_killed_again_and_again_lose_nothing_postgres() {
    let Some(farm) = Farm::new(Engine::Postgres) else { return };
    workers_are_killed(&farm, Duration::from_secs(1));
}

#[test]
#[ignore = "takes minutes; see docs/farm-faults.md"]
fn a_worker_killed_every_second_for_long() {
    for engine in [Engine::Sqlite, Engine::Postgres] {
        let Some(farm) = Farm::many(engine, 3000) else { continue };
        workers_are_killed(&farm, Duration::from_secs(1));
    }
}

fn worker_is_stopped_and_continued(engine: Engine) {
    let Some(farm) = Farm::new(engine) else { return };
    let mut coordinator = farm.coordinator(0);
    let sleeper = farm.worker();
    farm.reach(4);
    sleeper.signal("STOP");
    let other = farm.worker();
    // Two leases later everything it held is with the other.
    std::thread::sleep(Duration::from_secs(3));
    sleeper.signal("CONT");
    Farm::finish(&mut coordinator);
    drop((sleeper, other));
    farm.assert_undisturbed();
}

#[test]
fn a_worker_stopped_for_longer_than_its_lease_changes_nothing_when_it_goes_on_sqlite() {
    worker_is_stopped_and_continued(Engine::Sqlite);
}

#[test]
fn a_worker_stopped_for_longer_than_its_lease_changes_nothing_when_it_goes_on_postgres() {
    worker_is_stopped_and_continued(Engine::Postgres);
}

#[test]
fn a_dead_worker_s_cases_go_to_others_when_its_lease_ends() {
    let Some(farm) = Farm::new(Engine::Sqlite) else { return };
    let mut coordinator = farm.coordinator(0);
    let first = farm.worker();
    farm.reach(1);
    first.kill();
    let begun = Instant::now();
    let second = farm.worker();
    Farm::finish(&mut coordinator);
    drop(second);
    farm.assert_undisturbed();
    eprintln!("done {:.1} s after the first worker died", begun.elapsed().as_secs_f64());
}

#[test]
fn a_worker_that_is_told_to_stop_hands_back_what_it_has_and_says_so_by_its_exit_code() {
    let Some(farm) = Farm::new(Engine::Sqlite) else { return };
    let mut coordinator = farm.coordinator(0);
    let mut first = farm.worker();
    farm.reach(1);
    first.signal("TERM");
    let begun = Instant::now();
    assert_eq!(first.ended(Duration::from_secs(10)).code(), Some(0));
    eprintln!("it ended within {:.2} s", begun.elapsed().as_secs_f64());
    let second = farm.worker();
    Farm::finish(&mut coordinator);
    drop(second);
    farm.assert_undisturbed();
}
