//! What stands after a kill and on a full disk: the old set or the new one.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use test_needs::skipped;
use tracktwin_files::{FileName, FilesError, Kind, Output};

/// Set for a copy of this test's program: the folder it is to write to until it is killed.
const VICTIM: &str = "TRACKTWIN_TEST_VICTIM";

/// Parts of a set, and bytes of each.
const PARTS: usize = 6;
const BYTES: usize = 100_000;

fn write(folder: &Path, round: u8) -> Result<(), FilesError> {
    let mut output = Output::begin(folder, Kind::Models, false)?;
    let mut manifest = String::new();
    for part in 0..PARTS {
        let plain = FileName::new(&format!("part-{part}.bin"))?;
        output.add(&plain, &vec![round; BYTES])?;
        writeln!(manifest, "{round} {}", output.unique_name(&plain)?).unwrap();
    }
    output.add_manifest(&FileName::new("manifest")?, manifest.as_bytes())?;
    output.commit()
}

/// The round of the set in the folder, all its parts whole and of one round.
fn round(folder: &Path) -> u8 {
    let manifest = fs::read_to_string(folder.join("manifest")).unwrap();
    let rounds = manifest.lines().map(|line| {
        let (round, file) = line.split_once(' ').unwrap();
        let round: u8 = round.parse().unwrap();
        assert_eq!(fs::read(folder.join(file)).unwrap(), vec![round; BYTES], "{file}");
        round
    });
    let rounds: Vec<u8> = rounds.collect();
    assert!(rounds.len() == PARTS && rounds.iter().all(|it| *it == rounds[0]), "{rounds:?}");
    rounds[0]
}

fn partial(folder: &Path) -> usize {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    names.filter(|name| name.to_string_lossy().ends_with(".partial")).count()
}

/// Does nothing unless it is the copy that the next test starts.
#[test]
fn victim() {
    let Ok(folder) = std::env::var(VICTIM) else { return };
    for step in 0_u32.. {
        write(Path::new(&folder), (step % 200) as u8 + 1).unwrap();
    }
}

#[test]
fn whoever_is_killed_while_writing_leaves_a_whole_set_and_the_next_one_cleans_up() {
    let home = tempfile::tempdir().unwrap();
    write(home.path(), 0).unwrap();
    let mut left = 0;
    for kill in 0..12 {
        let mut victim = Command::new(std::env::current_exe().unwrap())
            .args(["victim", "--exact"])
            .env(VICTIM, home.path())
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(40 + 7 * kill));
        victim.kill().unwrap();
        victim.wait().unwrap();
        round(home.path());
        left += partial(home.path());
        write(home.path(), 201).unwrap();
        assert_eq!(round(home.path()), 201);
        assert_eq!(partial(home.path()), 0);
        // The parts, the manifest and the list.
        assert!(fs::read_dir(home.path()).unwrap().count() <= 2 * PARTS + 2);
    }
    assert!(left > 0, "no kill met a writer");
}

/// A file system of 2 MB, unmounted with its handle.
struct SmallDisk(tempfile::TempDir);

impl SmallDisk {
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=2m", "tmpfs"])
            .arg(folder.path())
            .output();
        let mounted = mount.is_ok_and(|mount| mount.status.success());
        if !mounted {
            skipped("a full disk; no file system may be mounted here");
        }
        mounted.then_some(Self(folder))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}

#[test]
fn a_full_disk_leaves_the_old_set_and_is_the_machine_s_fault() {
    let Some(disk) = SmallDisk::new() else { return };
    let folder = disk.0.path().join("models");
    write(&folder, 1).unwrap();
    // Room for four of the six parts.
    let ballast = disk.0.path().join("ballast");
    fs::write(&ballast, vec![0; (2 << 20) - (PARTS + 4) * BYTES - 50_000]).unwrap();
    let error = write(&folder, 2).unwrap_err();
    assert!(!error.is_wrong_input(), "{error}");
    assert!(error.to_string().contains("No space left"), "{error}");
    assert_eq!(round(&folder), 1);
    assert_eq!(partial(&folder), 0);
    fs::remove_file(ballast).unwrap();
    write(&folder, 2).unwrap();
    assert_eq!(round(&folder), 2);
}
