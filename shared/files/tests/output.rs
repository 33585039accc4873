//! Sets of files: whole or not at all, and over nobody else's.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fmt::Write as _;
use std::fs;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use tracktwin_files::{FileName, FilesError, Kind, Output, check, replace};

fn name(text: &str) -> FileName {
    FileName::new(text).unwrap()
}

fn write(folder: &Path, kind: Kind, force: bool, files: &[(&str, &str)]) -> Result<(), FilesError> {
    let mut output = Output::begin(folder, kind, force)?;
    for (file, text) in files {
        output.add(&name(file), text.as_bytes())?;
    }
    output.commit()
}

/// A set with a manifest that names its parts.
fn write_set(folder: &Path, parts: &[&str]) -> Result<(), FilesError> {
    let mut output = Output::begin(folder, Kind::Models, false)?;
    let mut manifest = String::new();
    for (number, part) in parts.iter().enumerate() {
        let plain = name(&format!("part-{number}.bin"));
        output.add(&plain, part.as_bytes())?;
        writeln!(manifest, "{} {part}", output.unique_name(&plain)?).unwrap();
    }
    output.add_manifest(&name("manifest"), manifest.as_bytes())?;
    output.commit()
}

/// The parts that the manifest names.
fn read_set(folder: &Path) -> Vec<String> {
    let manifest = fs::read_to_string(folder.join("manifest")).unwrap();
    let part = |line: &str| {
        let (file, part) = line.split_once(' ').unwrap();
        assert_eq!(fs::read_to_string(folder.join(file)).unwrap(), part);
        part.to_owned()
    };
    manifest.lines().map(part).collect()
}

fn contents(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn own_files_are_replaced_and_others_are_not() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("new/out");
    write(&out, Kind::Results, false, &[("a.json", "1"), ("b.html", "1")]).unwrap();
    write(&out, Kind::Results, false, &[("a.json", "2"), ("b.html", "2")]).unwrap();
    write(&out, Kind::Results, false, &[("a.json", "3")]).unwrap();
    fs::write(out.join("notes.txt"), "mine").unwrap();
    assert_eq!(contents(&out), [".tracktwin.json", "a.json", "b.html", "notes.txt"]);

    // Changed by hand; nothing of the set is written.
    fs::write(out.join("b.html"), "my words").unwrap();
    let error = write(&out, Kind::Results, false, &[("a.json", "4"), ("b.html", "4")]);
    assert!(matches!(error, Err(FilesError::Foreign { ref path }) if path.ends_with("b.html")));
    assert_eq!(fs::read_to_string(out.join("a.json")).unwrap(), "3");
    assert_eq!(fs::read_to_string(out.join("b.html")).unwrap(), "my words");
    assert!(check(&out, Kind::Results, false, &["a.json", "b.html"]).is_err());

    // Never the program's, but of the same content.
    write(&out, Kind::Results, false, &[("notes.txt", "mine")]).unwrap();
    write(&out, Kind::Results, false, &[("notes.txt", "other")]).unwrap_err();

    write(&out, Kind::Results, true, &[("a.json", "4"), ("b.html", "4")]).unwrap();
    write(&out, Kind::Results, false, &[("a.json", "5"), ("b.html", "5")]).unwrap();
    assert_eq!(contents(&out), [".tracktwin.json", "a.json", "b.html", "notes.txt"]);
}

#[test]
fn what_is_of_another_kind_stays() {
    let home = tempfile::tempdir().unwrap();
    write(home.path(), Kind::MeasuredRecording, false, &[("recording.json", "1")]).unwrap();
    for kind in [Kind::SimulatedRecording, Kind::MeasuredRecording] {
        let error = write(home.path(), kind, false, &[("recording.json", "2")]).unwrap_err();
        assert!(matches!(error, FilesError::OtherKind { .. }), "{error}");
        assert!(error.is_wrong_input());
    }
    write(home.path(), Kind::MeasuredRecording, false, &[("recording.json", "1")]).unwrap();
}

#[test]
fn folders_and_links_in_the_way_stay_what_they_are() {
    let home = tempfile::tempdir().unwrap();
    let [out, other] = ["out", "other"].map(|it| home.path().join(it));
    fs::create_dir_all(out.join("a")).unwrap();
    fs::write(&other, "theirs").unwrap();
    symlink(&other, out.join("b")).unwrap();
    for force in [false, true] {
        let error = write(&out, Kind::Results, force, &[("a", "1")]).unwrap_err();
        assert!(matches!(error, FilesError::Folder { .. }), "{error}");
    }
    write(&out, Kind::Results, false, &[("b", "1")]).unwrap_err();
    write(&out, Kind::Results, true, &[("b", "1")]).unwrap();
    assert_eq!(fs::read_to_string(other).unwrap(), "theirs");
    assert_eq!(fs::read_to_string(out.join("b")).unwrap(), "1");
}

#[test]
fn a_set_that_is_not_finished_leaves_nothing() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let mut output = Output::begin(&out, Kind::Results, false).unwrap();
    output.add(&name("a"), b"1").unwrap();
    drop(output);
    assert!(!out.exists());
}

#[test]
fn a_new_set_takes_the_place_of_the_old_one_in_one_step() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path();
    write_set(out, &["a", "b", "c"]).unwrap();
    assert_eq!(contents(out).len(), 5);
    // The old set's parts stand until the new manifest is there.
    let mut output = Output::begin(out, Kind::Models, false).unwrap();
    output.add(&name("part-0.bin"), b"x").unwrap();
    let part = output.unique_name(&name("part-0.bin")).unwrap();
    assert_ne!(part, name("part-0.bin"));
    drop(output);
    assert_eq!(read_set(out), ["a", "b", "c"]);
    write_set(out, &["x", "b"]).unwrap();
    assert_eq!(read_set(out), ["x", "b"]);
    // List, manifest and two parts: what the new set lacks is gone.
    assert_eq!(contents(out).len(), 4);
    // A stranger's file of a part's name stays, and the part gets another.
    fs::write(out.join("part-2.bin"), "mine").unwrap();
    write_set(out, &["x", "y", "z"]).unwrap();
    assert_eq!(read_set(out), ["x", "y", "z"]);
    assert_eq!(fs::read_to_string(out.join("part-2.bin")).unwrap(), "mine");
}

#[test]
fn files_have_the_usual_mode_and_secrets_have_theirs() {
    let home = tempfile::tempdir().unwrap();
    let mode =
        |file: &str| fs::metadata(home.path().join(file)).unwrap().permissions().mode() & 0o777;
    fs::write(home.path().join("usual"), "").unwrap();
    replace(&home.path().join("one"), b"1").unwrap();
    let mut output = Output::begin(home.path(), Kind::Certificates, false).unwrap();
    output.add(&name("two"), b"1").unwrap();
    output.add_secret(&name("key"), b"1").unwrap();
    output.commit().unwrap();
    assert_eq!([mode("one"), mode("two"), mode("key")], [mode("usual"), mode("usual"), 0o600]);
}

#[test]
fn a_path_that_cannot_be_is_the_user_s_and_a_refusing_system_is_not() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("file");
    fs::write(&file, "").unwrap();
    assert!(write(&file, Kind::Results, false, &[("a", "1")]).unwrap_err().is_wrong_input());
    let nowhere = file.join("under");
    assert!(write(&nowhere, Kind::Results, false, &[("a", "1")]).unwrap_err().is_wrong_input());
    let proc = Path::new("/proc/1");
    assert!(!proc.exists() || replace(&proc.join("a"), b"1").is_err());
}
