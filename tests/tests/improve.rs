//! One command finds the physics that the track model lacks, adds it, and evaluates the recording again.

use serde_json::Value;
use std::path::Path;
use system_tests::{Answer, run, simulated};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

const MISSING_RAILPAD: &str =
    "[[extension]]\nphysics = \"missing_railpad\"\nsleepers = [12]\nstiffness_N_per_m = 1e7\n";

/// A recording of thirteen sleepers, two passes at each of two speeds, with this extension file.
fn recorded(folder: &Path, name: &str, extension: &str) -> String {
    simulated(PROGRAM, &folder.join(name), "25", &["13", "10"], extension)
}

fn improved(recording: &str, out: &Path) -> Answer {
    let out = out.display().to_string();
    run(PROGRAM, &["improve", recording, "--out", &out, "--cases", "200"])
}

#[test]
#[ignore = "takes two minutes; see CONTRIBUTING.md"]
fn the_physics_that_was_found_is_evaluated_with_and_an_empty_result_replaces_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("better");
    let answer = improved(&recorded(folder.path(), "ride", MISSING_RAILPAD), &out);
    assert_eq!(answer.code, Some(0), "{}", answer.err);

    let text = std::fs::read_to_string(out.join("improvement.json")).unwrap();
    let improvement: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(improvement["physics"], serde_json::json!(["missing_railpad"]));
    assert_eq!(improvement["confirmation"]["is_confirmed"], true);
    let at_place: Vec<&str> = improvement["sleepers"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|sleeper| sleeper["is_at_place"] == true)
        .map(|sleeper| sleeper["id"].as_str().unwrap())
        .collect();
    assert_eq!(at_place, ["SN12"]);
    for file in ["report.html", "before/evaluation.csv", "after/evaluation.csv"] {
        assert!(out.join(file).is_file(), "{file}");
    }

    let answer = improved(&recorded(folder.path(), "quiet", ""), &out);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert!(!out.join("improvement.json").exists(), "an earlier result is left: {}", answer.out);
}
