//! A table of another program is converted to a recording, and its content is described.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fmt::Write as _;
use system_tests::run;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// A table with one second of pseudo-random accelerations at 2 kHz, and a column of times.
fn table() -> String {
    let mut text = "t_s,acc\n".to_owned();
    let mut state = 1_u32;
    for row in 0..2000 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let value = f64::from(state >> 16) / 65_536.0 - 0.5;
        writeln!(text, "{},{value:.4}", f64::from(row) / 2000.0).unwrap();
    }
    text
}

#[test]
fn a_table_is_imported_and_inspected() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (file, out, page) = (path("run.csv"), path("recording"), path("page.html"));
    std::fs::write(&file, table()).unwrap();

    let answer = run(PROGRAM, &["import", &file, "--out", &out]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.err.contains("the columns of the file are t_s, acc"), "{}", answer.err);
    assert_eq!(answer.err.lines().count(), 1, "{}", answer.err);

    let columns = ["--column", "acceleration=acc", "--column", "time=t_s", "--speed", "36"];
    let arguments = [&["import", &file, "--out", &out][..], &columns].concat();
    let answer = run(PROGRAM, &arguments);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert!(answer.out.contains("a sleeper spacing of 0.6 m is assumed"), "{}", answer.out);

    // The same again changes nothing.
    let answer = run(PROGRAM, &[&arguments[..], &["--json"]].concat()).succeeded();
    let imported: serde_json::Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(imported[0]["recording"], *out);
    assert_eq!(imported[0]["column"], "acc");

    let answer = run(PROGRAM, &["inspect", &out, "--out", &page]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert!(answer.out.contains("2000 Hz") && answer.out.contains("one speed only"));
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("<svg") && page.contains("Level along the track"));

    let answer = run(PROGRAM, &["inspect", &out, "--json"]);
    let root: serde_json::Value = serde_json::from_str(&answer.out).unwrap();
    assert_eq!(root["sample_rate_Hz"], 2000.0);
    for (index, command) in ["evaluate", "evaluate --models", "diagnose"].into_iter().enumerate() {
        let sentence = root["uses"][index].as_str().unwrap();
        let expected = format!("`{command}`: not possible: sleepers: their positions are unknown");
        assert!(sentence.starts_with(&expected), "{sentence}");
    }
}

#[test]
fn an_independent_recording_is_inspected() {
    for recording in test_needs::recordings("dev-02") {
        let answer = run(PROGRAM, &["inspect", &recording.display().to_string(), "--json"]);
        assert_eq!(answer.code, Some(0), "{}", answer.err);
        let root: serde_json::Value = serde_json::from_str(&answer.out).unwrap();
        assert_eq!(root["findings"][0]["physics"], "rail_joint", "{}", answer.out);
        assert_eq!(root["findings"].as_array().unwrap().len(), 1, "{}", answer.out);
    }
}
