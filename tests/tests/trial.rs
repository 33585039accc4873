//! Several machines share a blind trial. It loses nothing if one of them stops, and it continues if a
//! diagnosis fails. Its recordings hold nothing of their truth.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use system_tests::{run, until};
use tracktwin_parameters::Preset;
use tracktwin_trial::{Class, Making, Plan, plan_on};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Writes the recordings of two cases into the folder of the trial, so that the trial does not record them
/// again.
fn record(out: &Path, [spans, passes]: [&str; 2]) {
    for case in ["0000", "0001"] {
        let recording = out.join("recordings").join(case).display().to_string();
        let short = ["simulate", "--spans", spans, "--speed", "13", "--passes", passes];
        let further = ["--noise", "0.01", "--out", &recording];
        assert_eq!(run(PROGRAM, &[&short[..], &further].concat()).code, Some(0));
    }
}

#[test]
fn a_node_that_is_killed_loses_its_case_to_another_and_each_case_has_one_answer() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let library = format!("sqlite:{}", path("library.sqlite"));
    let arguments = |out: &str| {
        let options = ["trial", "--cases", "2", "--seed", "6174", "--force"];
        let places = ["--library".to_owned(), library.clone(), "--out".to_owned(), path(out)];
        options.map(str::to_owned).into_iter().chain(places).collect::<Vec<_>>()
    };
    for out in ["first", "second"] {
        record(&folder.path().join(out), ["25", "2"]);
    }
    let begun = |out: &str| -> Child {
        let mut node = Command::new(PROGRAM);
        node.args(arguments(out)).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    };
    let ask = |question: &str| {
        let asked = ["library", "sql", "--library", &library, "--format", "csv", question];
        run(PROGRAM, &asked).out
    };
    let leased = || ask("select count(*) from trial_lease").lines().nth(1).map(str::to_owned);

    let mut first = begun("first");
    until("the first has a case", Duration::from_mins(1), || {
        assert!(first.try_wait().unwrap().is_none(), "it ended without a case");
        leased().as_deref() == Some("1")
    });
    let mut second = begun("second");
    until("each has a case", Duration::from_mins(1), || leased().as_deref() == Some("2"));
    first.kill().unwrap();
    first.wait().unwrap();
    let ended = second.wait().unwrap();
    // Two cases reach some goals and not others.
    assert!(matches!(ended.code(), Some(0 | 1)), "{ended}");

    let answers = ask("select case_number, question, count(*) from trial_answer group by 1, 2");
    assert_eq!(answers.lines().skip(1).collect::<Vec<_>>(), ["0,catalogue,1", "1,catalogue,1"]);
    let nodes = ask("select count(distinct worker) from trial_answer");
    assert_eq!(nodes.lines().nth(1), Some("1"), "the survivor did both");
    assert_eq!(ask("select count(*) from trial_lease").lines().nth(1), Some("0"));
    let scores = std::fs::read_to_string(path("second/scores.jsonl")).unwrap();
    assert_eq!(scores.lines().count(), 2);

    // The node that died comes back, and finds all done.
    let arguments = arguments("first");
    let again = run(PROGRAM, &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(matches!(again.code, Some(0 | 1)), "{}", again.err);
    assert!(again.out.contains("2 of 2 scored"), "{}", again.out);
    assert_eq!(std::fs::read_to_string(path("first/scores.jsonl")).unwrap(), scores);

    let arguments = arguments.iter().map(String::as_str).chain(["--json"]);
    let in_json = run(PROGRAM, &arguments.collect::<Vec<_>>());
    let summary: serde_json::Value = serde_json::from_str(&in_json.out).unwrap();
    let file = std::fs::read_to_string(path("first/summary.json")).unwrap();
    assert_eq!(summary, serde_json::from_str::<serde_json::Value>(&file).unwrap());
    assert_eq!((&summary["cases"], in_json.code), (&2.into(), again.code));
}

#[test]
fn a_case_whose_diagnosis_breaks_down_is_named_at_the_end_and_stops_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("trial");
    // Too short to diagnose.
    record(&out, ["17", "1"]);
    let out_text = out.display().to_string();
    let answer = run(PROGRAM, &["trial", "--cases", "2", "--out", &out_text, "--force"]);
    assert_eq!(answer.code, Some(3), "{}", answer.err);
    assert!(answer.err.contains("2 of 2 diagnoses failed"), "{}", answer.err);
    assert!(answer.err.contains("case 0: ") && answer.err.contains("case 1: "), "{}", answer.err);
    let table = std::fs::read_to_string(out.join("trial.md")).unwrap();
    assert!(table.contains("| diagnoses that broke down | 2 of 2: 100 %"), "{table}");
}

/// Content of every file of a recording, by name.
fn files(plan: &Plan, folder: &Path) -> BTreeMap<String, Vec<u8>> {
    plan.making.record(&plan.scene, folder).unwrap();
    let content = |entry: std::io::Result<std::fs::DirEntry>| {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, std::fs::read(&path).unwrap())
    };
    std::fs::read_dir(folder).unwrap().map(content).collect()
}

/// The manifest of a recording.
fn manifest(files: &BTreeMap<String, Vec<u8>>) -> String {
    String::from_utf8(files["recording.json"].clone()).unwrap()
}

/// Checks that only the samples of a case of this making depend on its truth. Returns the manifest.
fn check_recording(preset: Preset, making: Making) -> String {
    let folder = tempfile::tempdir().unwrap();
    let is_wanted = |it: &Plan| (it.class, it.making) == (Class::Single, making);
    let mut plans = (0..40).map(|number| plan_on(preset, 20_270_101, number));
    let mut plan = plans.find(is_wanted).unwrap();
    plan.scene.passes.truncate(1);
    let found = files(&plan, &folder.path().join("effect"));
    let (kind, seed) = (plan.scene.left_out[0].physics(), plan.scene.seed.to_string());
    for (name, content) in &found {
        let has = |word: &&str| {
            name.contains(*word) || content.windows(word.len()).any(|it| it == word.as_bytes())
        };
        let words = [kind, &seed, "simulator", "left_out", "control", "single"];
        assert_eq!(words.into_iter().find(has), None, "{name}");
    }
    // The same track without the effect, and with another surface.
    plan.scene.left_out.clear();
    plan.scene.seed += 1;
    let control = files(&plan, &folder.path().join("control"));
    assert_eq!(found.keys().collect::<Vec<_>>(), control.keys().collect::<Vec<_>>());
    assert_eq!(manifest(&found), manifest(&control));
    manifest(&found)
}

#[test]
fn a_recording_holds_nothing_of_its_truth_but_its_samples() {
    let [plain, varied, second] = Making::ALL.map(|it| check_recording(Preset::VTrack, it));
    assert_eq!(plain, varied);
    assert_eq!(plain, second);
    check_recording(Preset::Concrete60E1, Making::Second);
}
