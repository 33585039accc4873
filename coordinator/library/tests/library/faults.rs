//! Faults in the environment of the library, and the guarantees that hold despite them.

use crate::support::{CAMPAIGN, Home, fill, finished, lease, report};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use test_needs::skipped;
use test_postgres::{Server, Settings};
use tracktwin_library::{Leased, Library, LibraryError, ReportVerdict};

/// Leases cases and reports them until no case is waiting. Calls without a response are repeated.
async fn work(library: &Library, cases: usize) -> usize {
    let mut temporary = 0;
    let mut stored = 0;
    while stored < cases {
        let request = crate::support::request("w", 2, library.now_unix_ms());
        let leased = match library.lease(request).await {
            Ok(lease) => lease.map(|lease| lease.cases).unwrap_or_default(),
            Err(error) => {
                assert!(error.is_temporary(), "{error:?}");
                temporary += 1;
                continue;
            }
        };
        for case in leased {
            stored += finish(library, &case, &mut temporary).await;
        }
        // A case whose lease was not heard of comes back when that has expired.
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    temporary
}

async fn finish(library: &Library, case: &Leased, temporary: &mut usize) -> usize {
    loop {
        let message = crate::support::message("w", vec![finished(case)]);
        match library.report(message).await {
            // A duplicate: the first answer got lost.
            Ok(verdicts) => {
                assert!(matches!(verdicts[0], ReportVerdict::Stored | ReportVerdict::Duplicate));
                return 1;
            }
            Err(error) => {
                assert!(error.is_temporary(), "{error:?}");
                *temporary += 1;
            }
        }
    }
}

/// The digest of this number of cases, computed without faults.
async fn undisturbed(count: u32) -> String {
    let home = Home::sqlite_in_memory();
    let library = home.library(count).await;
    let leased = lease(&library, "w", count, 0).await;
    report(&library, "w", leased.iter().map(finished).collect()).await;
    library.digest(CAMPAIGN).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_stopped_and_started_again_loses_nothing() {
    const CASES: u32 = 40;
    let Some(server) = Server::start(Settings::default()) else { return };
    let library = Library::open_or_create(&server.database()).await.unwrap();
    fill(&library, CAMPAIGN, CASES).await;
    let working = library.clone();
    let worker = tokio::spawn(async move { work(&working, CASES as usize).await });
    let server = std::sync::Arc::new(server);
    for finished in [4, 12] {
        let reached = async {
            while library.status(CAMPAIGN).await.unwrap().finished < finished {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        tokio::time::timeout(Duration::from_secs(20), reached).await.expect("work goes on");
        let server = server.clone();
        let restart = move || {
            server.stop();
            server.start_again();
        };
        tokio::task::spawn_blocking(restart).await.unwrap();
    }
    worker.await.unwrap();
    let status = library.status(CAMPAIGN).await.unwrap();
    assert_eq!((status.finished, status.total()), (CASES, CASES));
    assert_eq!(library.digest(CAMPAIGN).await.unwrap(), undisturbed(CASES).await);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_stays_away_is_told_as_such_within_a_bound() {
    let Some(server) = Server::start(Settings::default()) else { return };
    let library = Library::open_or_create(&server.database()).await.unwrap();
    fill(&library, CAMPAIGN, 1).await;
    server.stop();
    let begin = Instant::now();
    let error = library.pause(CAMPAIGN).await.unwrap_err();
    assert!(matches!(error, LibraryError::Unavailable { .. }), "{error:?}");
    assert!(error.is_temporary() && !error.is_wrong_input());
    // The retry budget of ten seconds, and room for a slow machine.
    assert!(begin.elapsed() < Duration::from_secs(30), "{:?}", begin.elapsed());
    // Whoever comes now need not wait as long again.
    let begin = Instant::now();
    library.pause(CAMPAIGN).await.unwrap_err();
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    server.start_again();
    library.pause(CAMPAIGN).await.unwrap();
}

/// A file system of 8 MB, unmounted when dropped; `None` if mounting is not allowed.
struct SmallDisk(tempfile::TempDir);

impl SmallDisk {
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=8m", "tmpfs"]).arg(folder.path());
        let mounted = mount.stderr(Stdio::null()).status().is_ok_and(|status| status.success());
        if !mounted {
            skipped("a full disk; no file system may be mounted here");
        }
        mounted.then_some(Self(folder))
    }

    fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.path()).status();
    }
}

#[tokio::test]
async fn nothing_is_written_to_a_file_that_was_moved_away() {
    const CASES: u32 = 4;
    let folder = tempfile::tempdir().unwrap();
    let [path, aside] = ["library.sqlite", "aside.sqlite"].map(|name| folder.path().join(name));
    let library = Library::open_or_create(&format!("sqlite:{}", path.display())).await.unwrap();
    fill(&library, CAMPAIGN, CASES).await;
    let leased = lease(&library, "w", CASES, library.now_unix_ms()).await;
    let results = || crate::support::message("w", leased.iter().map(finished).collect());

    std::fs::rename(&path, &aside).unwrap();
    let error = library.report(results()).await.unwrap_err();
    assert!(matches!(error, LibraryError::FileGone { .. }), "{error:?}");
    assert!(error.is_temporary());
    // Another file in its place is not the library either.
    std::fs::write(&path, "").unwrap();
    library.report(results()).await.unwrap_err();

    std::fs::rename(&aside, &path).unwrap();
    library.report(results()).await.unwrap();
    assert_eq!(library.digest(CAMPAIGN).await.unwrap(), undisturbed(CASES).await);
}

#[tokio::test]
async fn a_full_disk_is_said_and_survived() {
    const CASES: u32 = 120;
    let Some(disk) = SmallDisk::new() else { return };
    let url = format!("sqlite:{}", disk.path().join("library.sqlite").display());
    let library = Library::open_or_create(&url).await.unwrap();
    fill(&library, CAMPAIGN, CASES).await;
    let leased = lease(&library, "w", CASES, library.now_unix_ms()).await;
    let ballast = disk.path().join("ballast");
    // As much as there is room for.
    let _ = std::fs::write(&ballast, vec![0; 16 << 20]);
    let mut refused = None;
    for case in &leased {
        let message = crate::support::message("w", vec![finished(case)]);
        if let Err(error) = library.report(message).await {
            refused = Some(error);
            break;
        }
    }
    let error = refused.expect("there is no room");
    assert!(matches!(error, LibraryError::DiskFull), "{error:?}");
    assert!(error.is_temporary());

    std::fs::remove_file(&ballast).unwrap();
    let reports = leased.iter().map(finished).collect();
    let verdicts = report(&library, "w", reports).await;
    assert!(
        verdicts.iter().all(|it| matches!(it, ReportVerdict::Stored | ReportVerdict::Duplicate))
    );
    assert_eq!(library.digest(CAMPAIGN).await.unwrap(), undisturbed(CASES).await);
    let findings = library.verify(|| ()).await.unwrap().findings;
    assert!(findings.iter().all(|it| it.what.ends_with("does not match its hash")), "{findings:?}");
    library.close().await;
}

/// Environment variable for a second process of this test program: the library that it writes to until it
/// is killed.
const VICTIM: &str = "TRACKTWIN_TEST_VICTIM";

/// Does nothing except in the process that [`kill_writers`] starts.
#[tokio::test]
async fn victim() {
    let Ok(url) = std::env::var(VICTIM) else { return };
    let library = Library::open(&url).await.unwrap();
    loop {
        let leased = lease(&library, "victim", 3, library.now_unix_ms()).await;
        report(&library, "victim", leased.iter().map(finished).collect()).await;
    }
}

async fn kill_writers(home: &Home) {
    const CASES: u32 = 400;
    home.library(CASES).await.close().await;
    for kill in 0..4_u64 {
        let mut victim = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "faults::victim", "--nocapture"])
            .env(VICTIM, &home.url)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Moments spread over start and work by the golden ratio.
        tokio::time::sleep(Duration::from_millis(150 + (kill * 618) % 400)).await;
        victim.kill().unwrap();
        victim.wait().unwrap();
    }
    let library = home.open().await;
    let findings = library.verify(|| ()).await.unwrap().findings;
    assert!(findings.iter().all(|it| it.what.ends_with("does not match its hash")), "{findings:?}");
    // The victims' leases have long expired.
    let later = library.now_unix_ms() + 3_600_000;
    loop {
        let leased = lease(&library, "w", 100, later).await;
        if leased.is_empty() {
            break;
        }
        report(&library, "w", leased.iter().map(finished).collect()).await;
    }
    assert_eq!(library.status(CAMPAIGN).await.unwrap().finished, CASES);
    assert_eq!(library.digest(CAMPAIGN).await.unwrap(), undisturbed(CASES).await);
}

#[tokio::test]
async fn a_killed_writer_leaves_a_sound_file() {
    kill_writers(&Home::sqlite()).await;
}

#[tokio::test]
async fn a_killed_writer_leaves_a_sound_server() {
    if let Some(home) = Home::postgres() {
        kill_writers(&home).await;
    }
}
