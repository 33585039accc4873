//! Workers are killed, stopped, and asked to end.

use crate::farm::{Engine, Farm, PATIENCE};
use std::time::{Duration, Instant};
use system_tests::until;

/// Kills a worker at regular intervals, another one each time, and starts a new one in its place.
fn workers_are_killed(farm: &Farm, every: Duration) {
    let mut coordinator = farm.coordinator(0);
    let mut workers: Vec<_> = (0..3).map(|_| farm.worker()).collect();
    let mut kills = 0_usize;
    while coordinator.runs() {
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
    until("the other has cases of it", PATIENCE, || farm.leased_again() > 0);
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
fn a_run_stopped_for_longer_than_a_lease_loses_none() {
    let Some(farm) = Farm::new(Engine::Sqlite) else { return };
    let mut run = farm.run(&[]);
    farm.reach(4);
    run.signal("STOP");
    // A lease lasts 12 s.
    std::thread::sleep(Duration::from_secs(14));
    run.signal("CONT");
    Farm::finish(&mut run);
    farm.assert_undisturbed();
    assert_eq!(
        (farm.attempts(), farm.leased_again()),
        (0, 0),
        "one process tells by itself that it lives"
    );
}

#[test]
fn a_dead_worker_s_cases_are_leased_again_within_fifteen_seconds() {
    let Some(mut farm) = Farm::new(Engine::Sqlite) else { return };
    // What a coordinator is started with if nobody says otherwise.
    farm.lease = "12";
    let mut coordinator = farm.coordinator(0);
    let first = farm.worker();
    farm.reach(1);
    first.kill();
    let second = farm.worker();
    until("its cases are leased again", Duration::from_secs(15), || farm.leased_again() > 0);
    Farm::finish(&mut coordinator);
    drop(second);
    farm.assert_undisturbed();
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
    assert_eq!(farm.leased(), 0, "it has handed everything in or back");
    let second = farm.worker();
    Farm::finish(&mut coordinator);
    drop(second);
    farm.assert_undisturbed();
}
