//! The clock of a worker or a coordinator jumps by an hour and back.

use crate::farm::{Engine, Farm};
use std::path::{Path, PathBuf};
use std::process::Command;
use system_tests::Process;
use test_needs::skipped;

/// Path, below Debian's library folder, of the library that gives a program another time of day.
const FAKETIME: &str = "faketime/libfaketime.so.1";

/// A time of day that the test can set, for programs started with [`Clock::environment`].
struct Clock {
    library: PathBuf,
    setting: tempfile::NamedTempFile,
}

impl Clock {
    /// A clock with the correct time; `None` if libfaketime is not installed.
    fn right() -> Option<Self> {
        let folders = std::fs::read_dir("/usr/lib").ok()?.flatten();
        let library = folders.map(|it| it.path().join(FAKETIME)).find(|it| it.is_file());
        let Some(library) = library else {
            skipped("clocks that jump; install libfaketime");
            return None;
        };
        let clock = Self { library, setting: tempfile::NamedTempFile::new().unwrap() };
        clock.set("+0");
        Some(clock)
    }

    /// Sets the clock ahead or back, for example by `+1h`.
    fn set(&self, ahead: &str) {
        std::fs::write(self.setting.path(), ahead).unwrap();
    }

    /// Environment variables that make a program use this clock. Durations are not affected, as with a real
    /// clock that is set.
    fn environment(&self) -> [(&'static str, String); 4] {
        let text = |path: &Path| path.display().to_string();
        [
            ("LD_PRELOAD", text(&self.library)),
            ("FAKETIME_TIMESTAMP_FILE", text(self.setting.path())),
            ("FAKETIME_NO_CACHE", "1".to_owned()),
            ("FAKETIME_DONT_FAKE_MONOTONIC", "1".to_owned()),
        ]
    }

    /// Present time in s since 1970, as a program with this clock reads it.
    fn now_unix_s(&self) -> i64 {
        let date = Command::new("date").arg("+%s").envs(self.environment()).output().unwrap();
        String::from_utf8(date.stdout).unwrap().trim().parse().unwrap()
    }

    /// Sets the clock ahead, back, and to the correct time while a farm is running.
    fn jumps_during(&self, farm: &Farm) {
        let before = self.now_unix_s();
        for (ahead, finished) in [("+1h", 4), ("-1h", 16), ("+0", 28)] {
            farm.reach(finished);
            self.set(ahead);
            let jumped = self.now_unix_s() - before;
            assert_eq!(jumped > 3500, ahead == "+1h", "the clock did not jump: {jumped} s");
        }
    }
}

fn clock_jumps(engine: Engine) {
    let Some(clock) = Clock::right() else { return };
    let Some(mut farm) = Farm::new(engine) else { return };
    // Shorter than the jumps, and longer than a busy machine may hold up a heartbeat.
    farm.lease = "12";
    let mut coordinator = farm.coordinator(0);
    let worker = Farm::worker_in(&farm.urls(), &clock.environment());
    clock.jumps_during(&farm);
    Farm::finish(&mut coordinator);
    drop(worker);
    farm.assert_undisturbed();
    assert_eq!(farm.attempts(), 0, "no lease was lost to the jumps");
}

#[test]
fn a_coordinator_whose_clock_jumps_by_an_hour_ends_no_lease_of_another() {
    let Some(clock) = Clock::right() else { return };
    let Some(mut farm) = Farm::new(Engine::Postgres) else { return };
    farm.lease = "12";
    let url = |number| format!("127.0.0.1:{}", farm.port(number));
    let mut jumping = farm.coordinating(&url(0));
    let mut jumping = Process::start(jumping.envs(clock.environment()), "coordinator");
    let mut sound = farm.coordinator(1);
    let workers = [0, 1].map(|number| Farm::worker_of(&format!("http://{}", url(number))));
    clock.jumps_during(&farm);
    Farm::finish(&mut jumping);
    Farm::finish(&mut sound);
    drop(workers);
    farm.assert_undisturbed();
    assert_eq!(farm.attempts(), 0, "no lease was lost to the jumps");
}

#[test]
fn a_worker_whose_clock_jumps_by_an_hour_loses_nothing_sqlite() {
    clock_jumps(Engine::Sqlite);
}

#[test]
fn a_worker_whose_clock_jumps_by_an_hour_loses_nothing_postgres() {
    clock_jumps(Engine::Postgres);
}
