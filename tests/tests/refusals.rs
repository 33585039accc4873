//! Wrong input is refused with one line (fault, position, remedy) and exit code 2, and changes nothing.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fs;
use std::path::Path;
use system_tests::{Answer, free_port, run};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Checks for exit code 2, no text on standard output, and one line on standard error that contains all of
/// `words`.
fn assert_refused(answer: &Answer, words: &[&str]) {
    let Answer { code, out, err } = answer;
    assert_eq!(*code, Some(2), "{err}");
    assert_eq!(err.trim_end().lines().count(), 1, "{err}");
    assert!(out.is_empty(), "{out}");
    for word in words {
        assert!(err.contains(word), "`{word}` is missing in: {err}");
    }
}

/// Names of all files in a folder.
fn contents(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

fn refused_campaign(text: &str, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("campaign.toml");
    fs::write(&file, text).unwrap();
    let out = folder.path().join("out").display().to_string();
    let answer = run(PROGRAM, &["run", &file.display().to_string(), "--out", &out]);
    assert_refused(&answer, words);
    assert_eq!(contents(folder.path()), ["campaign.toml"]);
}

#[test]
fn a_campaign_with_an_unknown_key_is_refused() {
    refused_campaign(
        "name = \"c\"\nseed = 1\ncases = 8\nspeed = [13]\n",
        &["campaign.toml:4:", "`speed`", "speeds_km_h"],
    );
}

#[test]
fn a_campaign_with_a_reversed_range_is_refused() {
    refused_campaign(
        "name = \"c\"\nseed = 1\ncases = 8\n[parameters]\nrailpad_stiffness_N_m = [3e8, 1e7]\n",
        &["campaign.toml:", "parameters.railpad_stiffness_N_m", "lower end first"],
    );
}

#[test]
fn a_campaign_with_speeds_in_disorder_is_refused() {
    refused_campaign(
        "name = \"c\"\nseed = 1\ncases = 8\nspeeds_km_h = [13, 7]\n",
        &["campaign.toml:", "speeds_km_h", "ascending"],
    );
}

/// Part of a campaign file with every parameter of the catalogue at a fixed value.
const HELD: &str = "[parameters]\nrailpad_stiffness_N_m = 1e8\nrailpad_damping_N_s_m = 6e3\n\
                    ballast_stiffness_N_m = 1e7\nballast_damping_N_s_m = 5e3\nsleeper_EI_N_m2 = 1e4\n\
                    irregularity_level = 1.0\n";

#[test]
fn what_training_would_lack_is_found_out_before_anything_is_simulated() {
    let head = "name = \"c\"\nseed = 1\n";
    refused_campaign(
        &format!("{head}cases = 400\n{HELD}"),
        &["parameters", "no parameter varies", "--no-train"],
    );
    refused_campaign(&format!("{head}cases = 199\n"), &["199", "--cases 200", "--no-train"]);
}

#[test]
fn a_library_that_cannot_be_trained_on_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (file, url) = (path("campaign.toml"), format!("sqlite:{}", path("l.sqlite")));
    fs::write(&file, "name = \"c\"\nseed = 1\ncases = 300\n").unwrap();
    run(PROGRAM, &["campaign", "add", &file, "--library", &url]).succeeded();
    let answer = run(PROGRAM, &["train", "--library", &url, "--out", &path("models")]);
    assert_refused(&answer, &["0 cases are finished", "200"]);
}

#[test]
fn cases_that_would_begin_another_campaign_are_refused_with_the_way_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (file, url) = (path("campaign.toml"), format!("sqlite:{}", path("l.sqlite")));
    fs::write(&file, "name = \"c\"\nseed = 1\ncases = 300\n").unwrap();
    run(PROGRAM, &["campaign", "add", &file, "--library", &url]).succeeded();
    let out = path("out");
    let more = ["--cases", "65537", "--library", &url];
    for command in [
        &["run", &file, "--no-train", "--out", &out][..],
        &["campaign", "add", &file],
        &["coordinator", "--listen", "127.0.0.1:0", "--campaign", &file],
    ] {
        let answer = run(PROGRAM, &[command, &more].concat());
        assert_refused(
            &answer,
            &["from case 0", "to continue it, use `--cases 65536`", "sequence = \"rotated\""],
        );
    }
    let ask =
        "select count(*) as cases, count(distinct campaign_id) as campaigns from campaign_case";
    let counted = run(PROGRAM, &["library", "sql", ask, "--format", "csv", "--library", &url]);
    assert!(counted.succeeded().contains("300,1"));
    // Whoever asks for the other sequence gets it, and is told.
    fs::write(&file, "name = \"c\"\nseed = 1\ncases = 300\nsequence = \"rotated\"\n").unwrap();
    let anew = run(PROGRAM, &["campaign", "add", &file, "--library", &url]);
    assert!(
        anew.err.contains("starts from case 0") && anew.err.contains("sequence"),
        "{}",
        anew.err
    );
    anew.succeeded();
}

#[test]
fn a_trial_s_seals_that_cannot_be_read_are_left_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("trial");
    fs::create_dir(&out).unwrap();
    let trial = || run(PROGRAM, &["trial", "--cases", "1", "--out", &out.display().to_string()]);
    let assert_stopped = |code: i32, file: &str| {
        let answer = trial();
        assert_eq!(answer.code, Some(code), "{}", answer.err);
        assert!(answer.err.contains(file), "{}", answer.err);
    };
    let seals = out.join("seals.sha256");
    let unreadable = b"\xff\xfe is not text";
    // Without a trial beside them they are somebody else's.
    fs::write(&seals, unreadable).unwrap();
    assert_stopped(2, "seals.sha256");
    assert_eq!(fs::read(&seals).unwrap(), unreadable);
    // A trial begins, and finds something else in the place of its seals.
    fs::remove_file(&seals).unwrap();
    fs::create_dir(&seals).unwrap();
    assert_stopped(3, "seals.sha256");
    fs::remove_dir(&seals).unwrap();
    fs::write(&seals, unreadable).unwrap();
    assert_stopped(3, "seals.sha256");
    assert_eq!(fs::read(&seals).unwrap(), unreadable);
    // Neither is a trial begun where it can't be told which one is there.
    fs::remove_file(&seals).unwrap();
    fs::remove_file(out.join("trial.json")).unwrap();
    fs::create_dir(out.join("trial.json")).unwrap();
    assert_stopped(3, "trial.json");
    // Nor one that an earlier program began, whose cases are others.
    fs::remove_dir(out.join("trial.json")).unwrap();
    fs::write(out.join("trial.json"), r#"{"seed": 1, "code_version": "0.2.0"}"#).unwrap();
    assert_stopped(2, "format 1");
}

#[test]
fn a_campaign_that_is_not_there_is_refused() {
    let answer = run(PROGRAM, &["run", "/nowhere/campaign.toml"]);
    assert_refused(&answer, &["/nowhere/campaign.toml", "cannot be read"]);
}

#[test]
fn a_library_that_is_not_there_or_something_else_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let url = |name: &str| format!("sqlite:{}", folder.path().join(name).display());
    let status = |url: &str| run(PROGRAM, &["library", "status", "--library", url]);
    assert_refused(&status(&url("missing.sqlite")), &["missing.sqlite", "does not exist"]);
    fs::write(folder.path().join("text.sqlite"), "not a database, but long enough to be one")
        .unwrap();
    assert_refused(&status(&url("text.sqlite")), &["text.sqlite", "not a tracktwin library"]);
    assert_refused(&status("library.sqlite"), &["sqlite:PATH"]);
    assert_refused(&status("sqlite:/dev/null"), &["/dev/null", "not a tracktwin library"]);
    let name = "n".repeat(300);
    assert_refused(&status(&url(&name)), &["too long", "shorter"]);
    let deep =
        format!("{}/l.sqlite", ["d".repeat(200), "e".repeat(200), "f".repeat(200)].join("/"));
    fs::create_dir_all(folder.path().join(&deep).parent().unwrap()).unwrap();
    for url in [url(&name), url(&deep), "sqlite:/dev/null".to_owned()] {
        let answer = run(PROGRAM, &["coordinator", "--library", &url, "--listen", "127.0.0.1:0"]);
        assert_refused(
            &answer,
            &[if url.contains("null") { "not a tracktwin" } else { "shorter" }],
        );
    }
    assert_eq!(contents(folder.path()), [&"d".repeat(200), "text.sqlite"]);
}

#[test]
fn what_a_library_is_not_copied_exported_or_imported_to_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (file, url) = (path("campaign.toml"), format!("sqlite:{}", path("l.sqlite")));
    fs::write(&file, "name = \"c\"\nseed = 1\ncases = 8\n").unwrap();
    run(PROGRAM, &["campaign", "add", &file, "--library", &url]).succeeded();
    let library = |arguments: &[&str]| run(PROGRAM, &[&["library"], arguments].concat());
    std::os::unix::fs::symlink(path("l.sqlite"), path("link.sqlite")).unwrap();
    for same in ["l.sqlite", "./l.sqlite", "link.sqlite"] {
        let same = format!("sqlite:{}", path(same));
        let answer = library(&["copy", "--from", &url, "--to", &same]);
        assert_refused(&answer, &["the same library", "another --to"]);
    }
    let out = path("training.parquet");
    let answer = library(&["export", "--out", &out, "--format", "csv", "--library", &url]);
    assert_refused(&answer, &["--format csv", "training.parquet", "--format out"]);
    assert!(!Path::new(&out).exists());
    let tables = path("tables");
    library(&["export", "--out", &tables, "--format", "csv", "--library", &url]).succeeded();
    let answer =
        library(&["import", &tables, "--library", &format!("sqlite:{}", path("new.sqlite"))]);
    assert_refused(&answer, &["reads Parquet only", "--format parquet"]);
    assert!(!Path::new(&path("new.sqlite")).exists());
}

#[test]
fn a_server_that_does_not_answer_is_a_failure_and_no_wrong_input() {
    let nobody = format!("postgres://w@127.0.0.1:{}/library", free_port());
    for command in [&["status"][..], &["coordinator"], &["library", "status"]] {
        let answer = run(PROGRAM, &[command, &["--library", &nobody]].concat());
        // Whoever starts programs again is to start this one again.
        assert_eq!(answer.code, Some(3), "{command:?}: {}", answer.err);
    }
}

/// Checks that a small recording is refused by `evaluate` after one of its files was changed.
fn refused_recording(change: impl Fn(&Path), words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording");
    fs::create_dir(&recording).unwrap();
    let manifest = r#"{"format": "aba-recording/1", "sample_rate_Hz": 10000,
        "channel": "vertical axle-box acceleration, positive downwards",
        "passes": [{"file": "pass.csv", "speed_km_h": 13.0}],
        "sleepers": [{"id": "SN1", "x_m": 0.25}, {"id": "SN2", "x_m": 0.375}],
        "nominal": {"sleeper": {"spacing_m": 0.125}}}"#;
    fs::write(recording.join("recording.json"), manifest).unwrap();
    fs::write(recording.join("pass.csv"), pass_csv(1500)).unwrap();
    change(&recording);
    let out = folder.path().join("out").display().to_string();
    let answer = run(
        PROGRAM,
        &[
            "evaluate",
            &recording.display().to_string(),
            "--models",
            "nowhere",
            "--library",
            "sqlite:nowhere.sqlite",
            "--out",
            &out,
        ],
    );
    assert_refused(&answer, words);
    assert_eq!(contents(folder.path()), ["recording"]);
}

fn pass_csv(rows: usize) -> String {
    let row = |row: usize| {
        let time = row as f64 / 10_000.0;
        let position = 0.1 + time * 13.0 / 3.6;
        format!("{time:.5},{position:.7},{:.4}\n", (time * 900.0).sin())
    };
    let heads = "time_s,position_m,acceleration_m_s2\n".to_owned();
    std::iter::once(heads).chain((0..rows).map(row)).collect()
}

fn rewrite(folder: &Path, file: &str, from: &str, to: &str) {
    let path = folder.join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{file} has no {from}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn a_recording_with_a_number_that_is_none_is_refused() {
    refused_recording(
        |folder| rewrite(folder, "pass.csv", "\n0.00020,", "\nNaN,"),
        &["pass.csv", "time_s", "row 3", "NaN"],
    );
}

#[test]
fn a_recording_without_a_column_is_refused() {
    refused_recording(
        |folder| rewrite(folder, "pass.csv", "acceleration_m_s2", "acc"),
        &["pass.csv", "acceleration_m_s2", "column is missing", "acc"],
    );
}

#[test]
fn a_recording_with_a_wrong_sample_rate_is_refused() {
    refused_recording(
        |folder| rewrite(folder, "recording.json", "10000", "20000"),
        &["recording.json", "sample_rate_Hz", "20000"],
    );
}

#[test]
fn a_recording_too_short_for_a_sleeper_is_refused() {
    refused_recording(
        |folder| fs::write(folder.join("pass.csv"), pass_csv(100)).unwrap(),
        &["pass.csv", "position_m", "record a longer stretch"],
    );
}

#[test]
fn a_recording_that_is_not_json_is_refused() {
    refused_recording(
        |folder| fs::write(folder.join("recording.json"), "sleepers: []").unwrap(),
        &["recording.json", "not valid JSON"],
    );
}

#[test]
fn a_good_recording_is_followed_by_the_library_s_refusal() {
    refused_recording(|_| {}, &["nowhere.sqlite", "does not exist"]);
}

/// Checks that `diagnose` refuses a small recording of V-Track with this content of `nominal`.
fn refused_diagnosis(nominal: &str, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let [recording, out, v_track] = ["recording", "out", "v-track"].map(path);
    run(PROGRAM, &["new", &v_track, "--preset", "v-track"]).succeeded();
    fs::create_dir(&recording).unwrap();
    let manifest = format!(
        r#"{{"format": "aba-recording/1", "sample_rate_Hz": 10000,
        "passes": [{{"file": "pass.csv", "speed_km_h": 13.0}}],
        "sleepers": [{{"id": "SN1", "x_m": 0.25}}, {{"id": "SN2", "x_m": 0.375}}],
        "nominal": {nominal}}}"#
    );
    fs::write(path("recording/recording.json"), manifest).unwrap();
    fs::write(path("recording/pass.csv"), pass_csv(2000)).unwrap();
    let track = path("v-track/track.toml");
    let answer = run(PROGRAM, &["diagnose", &recording, "--track", &track, "--out", &out]);
    assert_refused(&answer, words);
    assert_eq!(contents(folder.path()), ["recording", "v-track"]);
}

#[test]
fn a_diagnosis_on_another_track_or_vehicle_than_the_recording_s_is_refused_with_both_numbers() {
    refused_diagnosis(r#"{"sleeper": {"spacing_m": 0.6}}"#, &["0.6 m", "0.125 m", "--track"]);
    refused_diagnosis(r#"{"wheel": {"mass_kg": 600}}"#, &["mass_kg", "600 kg", "44 kg"]);
    refused_diagnosis(r#"{"wheel": {"load_N": 5000}}"#, &["load_N", "5000 N", "4500 N"]);
    refused_diagnosis(r#"{"railhead_radius_m": 0.3}"#, &["railhead_radius_m", "0.3 m", "0.06 m"]);
    refused_diagnosis(r#"{"rail": {"area_m2": 0.00767}}"#, &["area_m2", "0.00767", "0.000865"]);
}

#[test]
fn what_a_diagnosis_found_extends_no_campaign_of_other_spacing() {
    let folder = tempfile::tempdir().unwrap();
    let [campaign, diagnosis] =
        ["large.toml", "diagnosis.json"].map(|name| folder.path().join(name).display().to_string());
    fs::write(&campaign, "name = \"c\"\nseed = 1\ncases = 8\npreset = \"real-scale\"\n").unwrap();
    fs::write(&diagnosis, diagnosis_of_v_track().to_string()).unwrap();
    let answer = run(PROGRAM, &["extend", &campaign, "--from", &diagnosis]);
    assert_refused(&answer, &["large.toml", "0.625 m", "0.125 m"]);
    assert_eq!(contents(folder.path()), ["diagnosis.json", "large.toml"]);
}

/// A diagnosis of three sleepers of V-Track without any finding.
fn diagnosis_of_v_track() -> serde_json::Value {
    let known = serde_json::json!({"mean": 1.0, "sd": 0.1});
    let known = serde_json::json!({"before": known, "after": known});
    let sleeper = |number: u8| {
        serde_json::json!({
            "id": format!("SN{number}"), "x_m": 0.125 * f64::from(number),
            "railpad_stiffness_N_m": known, "ballast_stiffness_N_m": known,
            "irregularity_level": known,
        })
    };
    let scores = serde_json::json!({"in_sample": {"score": 0.0}, "held_out": null});
    serde_json::json!({
        "format": "tracktwin-diagnosis/1", "recording": "r", "verdict": "consistent", "sentence": "",
        "mismatches": [], "hypotheses": [], "bias_removed": {}, "notes": [],
        "fit": {"score": "", "before": scores, "after": scores, "held_out_gain_nats": {}},
        "track": [sleeper(1), sleeper(2), sleeper(3)],
        "levels": {"frequency_Hz": [], "speeds_km_h": [], "measured_dB": [], "before_dB": [],
                   "after_dB": [], "scatter_dB": [[1.0, null]]},
    })
}
