//! The paper's test ring, shortened: recorded, evaluated, compared with its true values, and continued.

use serde_json::Value;
use std::fs;
use system_tests::run;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Arguments for the part from before joint J4 to behind the sleeper without bolts, with one pass.
const SHORT: [&str; 6] = ["--sleepers", "86-97", "--laps", "1", "--speeds", "13"];

#[test]
fn a_shortened_ring_comes_with_truth_statements_and_page_and_is_not_made_twice() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ring").display().to_string();
    let ring = |further: &[&str]| run(PROGRAM, &[&["ring", "--out", &out], further].concat());
    let answer = ring(&SHORT);
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.err);
    assert!(answer.out.contains("cannot tell; page: "), "{}", answer.out);

    let text = |name: &str| fs::read_to_string(format!("{out}/{name}")).unwrap();
    let table = text("ring.csv");
    assert_eq!(table.lines().count(), 1 + 12);
    assert!(table.lines().next().unwrap().contains("inversion_ballast_stiffness_N_m_high_90"));
    assert!(
        text("truth.csv").lines().any(|line| line.starts_with("SN91,11.25,1,,false,true,true"))
    );
    let truth: Value = serde_json::from_str(&text("truth.json")).unwrap();
    assert_eq!(truth["sleepers"][5]["railpad_stiffness_N_m"], 1e7);
    let document: Value = serde_json::from_str(&text("ring.json")).unwrap();
    assert_eq!(document["format"], "tracktwin-ring/1");
    let statements = document["statements"].as_array().unwrap();
    let failed = statements.iter().filter(|row| row["verdict"] == "differs").count();
    assert_eq!(answer.code, Some(i32::from(failed > 0)), "{document:#}");
    // Whatever else: a joint in a bad condition raises the level.
    let joint = statements.iter().find(|row| row["claim"].as_str().unwrap().contains("raised"));
    assert_eq!(joint.unwrap()["verdict"], "reproduced", "{joint:?}");
    let page = text("report.html");
    assert!(page.contains("SN91") && page.contains("<svg") && !page.contains("<script"));
    // What the evaluation reads does not tell the truth.
    let manifest = text("recording/recording.json");
    assert!(!manifest.contains("clamp") && !manifest.contains("seed"));

    let evaluation = text("evaluations/all/evaluation.json");
    fs::remove_file(format!("{out}/ring.csv")).unwrap();
    let again = ring(&[&SHORT[..], &["--json"]].concat());
    let printed: Value = serde_json::from_str(&again.out).unwrap();
    assert_eq!(printed["statements"], document["statements"]);
    assert_eq!((text("ring.csv"), text("evaluations/all/evaluation.json")), (table, evaluation));
    assert!(!again.err.contains("null model"), "{}", again.err);

    let other = ring(&[&SHORT[..], &["--seed", "2"]].concat());
    assert_eq!(other.code, Some(2), "{}", other.err);
    assert!(other.err.contains("ring of other settings (seed 1, 1 laps"), "{}", other.err);
}

#[test]
fn a_ring_that_cannot_be_is_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ring").display().to_string();
    for (further, words) in [
        (&["--sleepers", "90-110"][..], "from 1 to 100"),
        (&["--sleepers", "5"][..], "FIRST-LAST"),
        (&["--speeds", "7,7"][..], "7 km/h is given twice"),
        (&["--speeds", "400"][..], "from 3 to 40 km/h"),
        (&["--models", "none", "--library", "sqlite:none"][..], "none"),
    ] {
        let answer = run(PROGRAM, &[&["ring", "--out", &out], further].concat());
        assert_eq!(answer.code, Some(2), "{further:?}: {}", answer.err);
        assert!(answer.err.contains(words), "{further:?}: {}", answer.err);
    }
    assert!(!folder.path().join("ring").exists());
}
