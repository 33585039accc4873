//! Commands write only to the requested paths, do not replace files of other programs, and write a file
//! completely or not at all.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use system_tests::{Answer, run};
use test_needs::skipped;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Content of a file of another program.
const THEIRS: &str = "somebody's own words";

fn refused(answer: &Answer, words: &[&str]) {
    let Answer { code, err, .. } = answer;
    assert_eq!(*code, Some(2), "{err}");
    assert_eq!(err.trim_end().lines().count(), 1, "{err}");
    for word in words {
        assert!(err.contains(word), "`{word}` is missing in: {err}");
    }
}

/// All files of a folder and its subfolders, without the hidden lists.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if !path.ends_with(".tracktwin.json") {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// A table with two seconds of data at 2 kHz: a column of times, and these columns of accelerations.
fn table(columns: &[&str]) -> String {
    let mut table = "t_s".to_owned();
    for column in columns {
        write!(table, ",\"{column}\"").unwrap();
    }
    let mut state = 1_u32;
    for row in 0..4000 {
        write!(table, "\n{}", f64::from(row) / 2000.0).unwrap();
        for _ in columns {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            write!(table, ",{:.4}", f64::from(state >> 16) / 65_536.0 - 0.5).unwrap();
        }
    }
    table + "\n"
}

/// Runs a short, coarse simulation.
fn simulate(out: &Path, more: &[&str]) -> Answer {
    let coarse = ["--spans", "16", "--rail-elements", "2", "--sleeper-elements", "2"];
    let out = ["simulate", "--out", &text(out), "--speed", "13", "--time-step", "5e-5"];
    run(PROGRAM, &[&out[..], &coarse, more].concat())
}

fn import(file: &Path, out: &Path, more: &[&str]) -> Answer {
    let (file, out) = (text(file), text(out));
    let time = ["--column", "time=t_s", "--speed", "36", "--unit", "m/s2"];
    run(PROGRAM, &[&["import", &file, "--out", &out][..], &time, more].concat())
}

#[test]
fn columns_with_the_names_of_paths_stay_in_the_folder() {
    let home = tempfile::tempdir().unwrap();
    let outside = home.path().join("outside");
    let names = [
        text(&outside),
        "../a".to_owned(),
        "../../a".to_owned(),
        "/'ABA'/'acc_l'".to_owned(),
        "A".to_owned(),
        "..".to_owned(),
        ".hidden".to_owned(),
        "con".to_owned(),
    ];
    let file = home.path().join("run.csv");
    fs::write(&file, table(&names.each_ref().map(String::as_str))).unwrap();
    let columns: Vec<String> = names.iter().map(|name| format!("acceleration={name}")).collect();
    let columns: Vec<&str> = columns.iter().flat_map(|it| ["--column", it]).collect();
    let out = home.path().join("in/out");
    import(&file, &out, &columns).succeeded();
    let stay = |path: &PathBuf| path.starts_with(&out) || *path == file;
    assert!(files(home.path()).iter().all(stay), "{:?}", files(home.path()));
    // `../a`, `A` and the others: a folder each, none over another.
    assert_eq!(files(&out).len(), 2 * names.len());
    // The same again changes nothing and is no fault.
    import(&file, &out, &columns).succeeded();
    assert_eq!(files(&out).len(), 2 * names.len());
}

#[test]
fn a_recording_is_read_from_its_own_folder_only() {
    let home = tempfile::tempdir().unwrap();
    let recording = home.path().join("recording");
    simulate(&recording, &[]).succeeded();
    let manifest = recording.join("recording.json");
    let inspect = || run(PROGRAM, &["inspect", &text(&recording)]);
    inspect().succeeded();
    let told = fs::read_to_string(&manifest).unwrap();
    let pass = "pass-13kmh-1.parquet";
    fs::copy(recording.join(pass), home.path().join(pass)).unwrap();
    for name in [format!("../{pass}"), text(&home.path().join(pass)), "/etc/passwd".to_owned()] {
        fs::write(&manifest, told.replace(pass, &name)).unwrap();
        refused(&inspect(), &["passes[0].file", "is outside", "copy the file"]);
    }
    fs::write(&manifest, &told).unwrap();
    fs::remove_file(recording.join(pass)).unwrap();
    std::os::unix::fs::symlink(home.path().join(pass), recording.join(pass)).unwrap();
    refused(&inspect(), &["passes[0].file", "is outside"]);
}

#[test]
fn a_simulation_does_not_replace_a_measured_recording_and_its_own_it_does() {
    let home = tempfile::tempdir().unwrap();
    let [measured, simulated] = ["measured", "simulated"].map(|name| home.path().join(name));
    let file = home.path().join("run.csv");
    fs::write(&file, table(&["acc"])).unwrap();
    let column = ["--column", "acceleration=acc"];
    import(&file, &measured, &column).succeeded();
    let before: Vec<Vec<u8>> = files(&measured).iter().map(|it| fs::read(it).unwrap()).collect();
    refused(&simulate(&measured, &[]), &["recording.json", "imported recording", "--force"]);
    refused(&import(&file, &measured, &[&column[..], &["--upwards"]].concat()), &["--force"]);
    let after: Vec<Vec<u8>> = files(&measured).iter().map(|it| fs::read(it).unwrap()).collect();
    assert_eq!(before, after);

    // One that was made by hand has no list of files at all.
    let handmade = home.path().join("handmade");
    fs::create_dir(&handmade).unwrap();
    fs::write(handmade.join("recording.json"), THEIRS).unwrap();
    fs::write(handmade.join("pass-13kmh-1.parquet"), THEIRS).unwrap();
    refused(
        &simulate(&handmade, &[]),
        &["recording.json", "was not written by tracktwin", "--force"],
    );
    assert_eq!(files(&handmade).len(), 2);

    simulate(&simulated, &[]).succeeded();
    fs::write(simulated.join("log.txt"), THEIRS).unwrap();
    simulate(&simulated, &[]).succeeded();
    simulate(&simulated, &["--seed", "2"]).succeeded();
    // Recording, truth, one pass and the log: no pass of the first surface is left.
    assert_eq!(files(&simulated).len(), 4, "{:?}", files(&simulated));
    run(PROGRAM, &["inspect", &text(&simulated)]).succeeded();
    simulate(&measured, &["--force"]).succeeded();
    assert!(measured.join("truth.json").exists());
}

/// For every command that writes files: the first file that it writes, and its arguments.
#[test]
fn no_command_replaces_a_file_that_it_did_not_write() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| text(&home.path().join(name));
    simulate(&home.path().join("recording"), &[]).succeeded();
    let [recording, out, none] = ["recording", "out", "none"].map(path);
    let library = format!("sqlite:{}", path("library.sqlite"));
    let campaign = path("campaign.toml");
    fs::write(&campaign, "name = \"c\"\ncases = 300\nseed = 5\n").unwrap();
    run(PROGRAM, &["campaign", "add", &campaign, "--library", &library]).succeeded();
    let file = |name: &str| format!("{out}/{name}");
    let (table, page, tables) = (file("r.csv"), file("p.html"), file("t.parquet"));
    let models = ["--models", &none, "--library", &library];
    let commands: [(&str, Vec<&str>); 15] = [
        ("recording.json", vec!["simulate", "--out", &out]),
        ("truth.json", vec!["simulate", "--out", &out]),
        ("models.json", vec!["train", "--out", &out, "--library", &library]),
        ("evaluation.json", [&["evaluate", &recording, "--out", &out][..], &models].concat()),
        ("report.html", vec!["diagnose", &recording, "--out", &out]),
        ("p.html", vec!["inspect", &recording, "--out", &page]),
        ("r.csv", vec!["receptance", "--at", "sleeper", "--spans", "20", "--out", &table]),
        ("r.svg", vec!["receptance", "--at", "sleeper", "--spans", "20", "--out", &table]),
        ("coordinator.pem", vec!["certs", &out, "--host", "head"]),
        ("tracktwin.1", vec!["manual", "--out", &out]),
        ("campaign.parquet", vec!["library", "export", "--out", &out, "--library", &library]),
        ("t.parquet", vec!["library", "export", "--out", &tables, "--library", &library]),
        ("evaluation.csv", vec!["run", &campaign, "--out", &out, "--library", &library]),
        ("trial.md", vec!["trial", "--cases", "1", "--out", &out]),
        ("seals.sha256", vec!["trial", "--cases", "1", "--out", &out]),
    ];
    for (first, arguments) in &commands {
        fs::create_dir(&out).unwrap();
        fs::write(file(first), THEIRS).unwrap();
        let answer = run(PROGRAM, arguments);
        refused(&answer, &[first, "--force"]);
        assert_eq!(fs::read_to_string(file(first)).unwrap(), THEIRS, "{arguments:?}");
        let found = files(Path::new(&out));
        assert!(found.len() <= 2, "{arguments:?}: {found:?}");
        fs::remove_dir_all(&out).unwrap();
    }
}

#[test]
fn what_has_been_written_is_written_again_and_into_a_device_too() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| text(&home.path().join(name));
    let recording = path("recording");
    simulate(&home.path().join("recording"), &[]).succeeded();
    let (table, page) = (path("r.csv"), path("p.html"));
    let (certs, manual) = (path("certs"), path("manual"));
    for _ in 0..2 {
        let receptance = ["receptance", "--at", "sleeper", "--spans", "20", "--points", "5"];
        run(PROGRAM, &[&receptance[..], &["--out", &table]].concat()).succeeded();
        run(PROGRAM, &[&receptance[..], &["--out", "/dev/null"]].concat()).succeeded();
        run(PROGRAM, &["inspect", &recording, "--out", &page]).succeeded();
        run(PROGRAM, &["certs", &certs, "--host", "head"]).succeeded();
        run(PROGRAM, &["manual", "--out", &manual]).succeeded();
    }
    refused(
        &run(PROGRAM, &["receptance", "--at", "sleeper", "--out", &path("r.svg")]),
        &["the name of the plot", "r.csv"],
    );
}

/// A file system of 1 MB, unmounted when dropped.
struct SmallDisk(tempfile::TempDir);

impl SmallDisk {
    fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=1m", "tmpfs"])
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
fn on_a_full_disk_the_old_files_stand_and_the_exit_code_is_that_of_a_failure() {
    let Some(disk) = SmallDisk::new() else { return };
    let home = tempfile::tempdir().unwrap();
    let [old, new] = ["old", "new"].map(|name| disk.0.path().join(name));
    let file = home.path().join("run.csv");
    fs::write(&file, table(&["acc"])).unwrap();
    simulate(&old, &[]).succeeded();
    let before: Vec<Vec<u8>> = files(&old).iter().map(|it| fs::read(it).unwrap()).collect();
    let room = 1 << 20;
    let _ = fs::write(disk.0.path().join("ballast"), vec![0; room]);
    let failed = |answer: Answer| {
        assert_eq!(answer.code, Some(3), "{}", answer.err);
        assert!(answer.err.contains("No space left"), "{}", answer.err);
    };
    failed(simulate(&old, &["--seed", "2"]));
    failed(simulate(&new, &[]));
    failed(import(&file, &new, &["--column", "acceleration=acc"]));
    let page = text(&disk.0.path().join("p.html"));
    failed(run(PROGRAM, &["inspect", &text(&old), "--out", &page]));
    failed(run(PROGRAM, &["certs", &text(&new), "--host", "head"]));
    let after: Vec<Vec<u8>> = files(&old).iter().map(|it| fs::read(it).unwrap()).collect();
    assert_eq!(before, after);
    assert!(!new.exists());
    let left = files(disk.0.path());
    assert_eq!(left.len(), 1 + before.len(), "{left:?}");
}
