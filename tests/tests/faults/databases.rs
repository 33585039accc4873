//! Databases stop, and disks are full.

use crate::farm::{Farm, PATIENCE, PROGRAM};
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use system_tests::until;
use test_needs::skipped;
use test_postgres::{Server, Settings};

#[test]
fn a_postgres_server_stopped_and_started_in_the_middle_loses_nothing() {
    let Some(server) = Server::start(Settings { durable: true }) else { return };
    let folder = tempfile::tempdir().unwrap();
    let farm = Farm::on(folder, server.database(), 64);
    let mut coordinator = farm.coordinator(0);
    let workers = [farm.worker(), farm.worker()];
    farm.reach(8);
    server.stop();
    // Everybody meets the absence several times.
    std::thread::sleep(Duration::from_secs(2));
    server.start_again();
    Farm::finish(&mut coordinator);
    drop(workers);
    farm.assert_undisturbed();
}

#[test]
fn a_run_rides_out_a_server_that_is_away_for_twenty_seconds() {
    let Some(server) = Server::start(Settings { durable: true }) else { return };
    let farm = Farm::on(tempfile::tempdir().unwrap(), server.database(), 64);
    let mut run = farm.run(&[]);
    farm.reach(8);
    server.stop();
    // Longer than a single question waits for an answer.
    std::thread::sleep(Duration::from_secs(20));
    assert!(run.runs(), "it ended with the server");
    server.start_again();
    Farm::finish(&mut run);
    farm.assert_undisturbed();
}

#[test]
fn a_status_that_is_watched_rides_out_a_server_that_is_away() {
    let Some(server) = Server::start(Settings::default()) else { return };
    let farm = Farm::on(tempfile::tempdir().unwrap(), server.database(), 8);
    let folder = tempfile::tempdir().unwrap();
    let [out, err] = ["out", "err"].map(|name| folder.path().join(name));
    let mut watch = Command::new(PROGRAM);
    watch.args(["status", "--watch", "--every", "1", "--library", &farm.library]);
    watch.stdout(std::fs::File::create(&out).unwrap());
    watch.stderr(std::fs::File::create(&err).unwrap());
    let mut watch = watch.spawn().unwrap();
    let count =
        |file: &Path, words: &str| std::fs::read_to_string(file).unwrap().matches(words).count();
    let states = || count(&out, "8 cases: 0 finished");
    until("it shows the state", PATIENCE, || states() > 0);
    server.stop();
    let told = || count(&err, "trying again") > 0 || watch.try_wait().unwrap().is_some();
    until("it tells that the server is away", PATIENCE, told);
    let before = states();
    server.start_again();
    let shown = || states() > before || watch.try_wait().unwrap().is_some();
    until("it shows the state again", PATIENCE, shown);
    assert!(watch.try_wait().unwrap().is_none(), "{}", std::fs::read_to_string(&err).unwrap());
    watch.kill().unwrap();
    watch.wait().unwrap();
}

/// A separate small file system.
struct Tmpfs<'a>(&'a Path);

impl<'a> Tmpfs<'a> {
    /// Mounts an empty file system; `None` if mounting is not allowed.
    fn mount(path: &'a Path, size: &str) -> Option<Self> {
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"]).arg(path);
        let mounted = mount.output().is_ok_and(|output| output.status.success());
        if !mounted {
            skipped("full disks; no file system may be mounted here");
        }
        mounted.then_some(Self(path))
    }

    fn grow(&self, size: &str) {
        let mut grow = Command::new("mount");
        grow.args(["-o", &format!("remount,size={size}")]).arg(self.0);
        assert!(grow.status().unwrap().success());
    }
}

impl Drop for Tmpfs<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").args(["-l"]).arg(self.0).status();
    }
}

#[test]
fn a_full_disk_stops_the_campaign_until_there_is_room_and_loses_nothing() {
    let volume = tempfile::tempdir().unwrap();
    let Some(disk) = Tmpfs::mount(volume.path(), "1500k") else { return };
    let library = format!("sqlite:{}", volume.path().join("l.sqlite").display());
    let farm = Farm::on(tempfile::tempdir().unwrap(), library, 64);
    let mut coordinator = farm.coordinator(0);
    let worker = farm.worker();
    // Long enough to fill it: 64 results take more than there is.
    std::thread::sleep(Duration::from_secs(6));
    assert!(farm.finished() < 64, "the disk never got full");
    assert!(coordinator.runs(), "the coordinator waits for room");
    disk.grow("64m");
    Farm::finish(&mut coordinator);
    drop(worker);
    farm.assert_undisturbed();
}

#[test]
fn a_full_disk_under_a_postgres_server_loses_nothing_either() {
    let volume = tempfile::tempdir().unwrap();
    let Some(_disk) = Tmpfs::mount(volume.path(), "200m") else { return };
    let Some(server) = Server::start_in(volume.path(), Settings { durable: true }) else { return };
    let farm = Farm::on(tempfile::tempdir().unwrap(), server.database(), 64);
    let mut coordinator = farm.coordinator(0);
    let worker = farm.worker();
    farm.reach(8);
    let ballast = volume.path().join("ballast");
    let full = std::fs::write(&ballast, vec![0; 200 << 20]).unwrap_err();
    assert_eq!(full.kind(), std::io::ErrorKind::StorageFull);
    // Long enough to have finished: nothing says that nothing will come.
    std::thread::sleep(Duration::from_secs(6));
    assert!(farm.finished() < 64, "the full disk stopped nobody");
    assert!(coordinator.runs(), "the coordinator waits for room");
    std::fs::remove_file(&ballast).unwrap();
    Farm::finish(&mut coordinator);
    drop(worker);
    farm.assert_undisturbed();
}
