//! Comparison of results with the paper's, from the command line.

use serde_json::Value;
use std::fs;
use system_tests::run;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Campaign with a coarse, short model, because only the processing of the results is tested.
const CAMPAIGN: &str = "name = \"compared\"\nseed = 5\ncases = 60\nspeeds_km_h = [7, 13]\n\
    [simulation]\nspans = 22\nrail_elements_per_span = 2\nsleeper_elements = 2\n";

#[test]
fn figures_of_a_small_library_come_as_rows_and_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let library = format!("sqlite:{}", path("library.sqlite"));
    fs::write(path("campaign.toml"), CAMPAIGN).unwrap();
    let arguments = ["run", &path("campaign.toml"), "--no-train", "--library", &library];
    let answer = run(PROGRAM, &[&arguments[..], &["--out", &path("out")]].concat());
    assert_eq!(answer.code, Some(0), "{}", answer.err);

    let reproduce = |figures: &[&str], out: &str| {
        let further = ["--library", &library, "--out", out];
        run(PROGRAM, &[&["reproduce"], figures, &further].concat())
    };
    // Out of order and one twice: each comes once, in the paper's order.
    let out = path("reproduction");
    let answer = reproduce(&["fig12", "fig9", "fig10", "fig12"], &out);
    let json: Value =
        serde_json::from_str(&fs::read_to_string(format!("{out}/reproduce.json")).unwrap())
            .unwrap();
    let rows = json["rows"].as_array().unwrap();
    let mut figures: Vec<&str> = rows.iter().map(|row| row["figure"].as_str().unwrap()).collect();
    figures.dedup();
    assert_eq!(figures, ["fig9", "fig10", "fig12"]);
    assert_eq!((&json["format"], &json["library_entries"]), (&"reproduction/1".into(), &60.into()));
    // On the paper's 25 spans the ends give the peak near 1000 Hz, whatever the library.
    let differs = rows.iter().filter(|row| row["verdict"] == "differs").count();
    assert!(differs >= 1, "{json:#}");
    assert_eq!(answer.code, Some(1), "{}", answer.err);
    assert!(answer.out.contains(&format!("{differs} differ")), "{}", answer.out);
    let louder = rows.iter().find(|row| row["claim"].as_str().unwrap().contains("magnitude"));
    assert_eq!(louder.unwrap()["verdict"], "reproduced");
    let page = fs::read_to_string(format!("{out}/reproduce.html")).unwrap();
    assert!(page.contains("Fig. 12") && page.contains("<svg") && !page.contains("<script"));

    let out = path("one");
    let answer = reproduce(&["fig9", "--json"], &out);
    let printed: Value = serde_json::from_str(&answer.out).unwrap();
    let text = fs::read_to_string(format!("{out}/reproduce.json")).unwrap();
    assert_eq!(printed, serde_json::from_str::<Value>(&text).unwrap());
    assert_eq!((&printed["rows"][0]["figure"], answer.code), (&"fig9".into(), Some(1)));

    refused(&reproduce(&["fig20"], &path("none")), &["`fig20`", "fig9, fig10"]);
    refused(&reproduce(&["fig16"], &path("none")), &["24 spans", "fig15 to fig19"]);
    refused(&reproduce(&["fig14"], &path("few")), &["60", "200"]);
    assert!(!folder.path().join("none").exists());
}

#[test]
fn models_that_an_earlier_call_trained_are_used_again_while_the_library_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let library = format!("sqlite:{}", path("library.sqlite"));
    let simulate = |cases: &str| {
        // Fewest cases that models are trained on.
        let campaign = CAMPAIGN.replace("cases = 60", cases).replace("[7, 13]", "[13]");
        fs::write(path("campaign.toml"), campaign).unwrap();
        let arguments = ["run", &path("campaign.toml"), "--no-train", "--library", &library];
        let answer = run(PROGRAM, &[&arguments[..], &["--out", &path("out")]].concat());
        assert_eq!(answer.code, Some(0), "{}", answer.err);
    };
    let reproduce = || {
        let out = path("reproduction");
        let answer = run(PROGRAM, &["reproduce", "fig14", "--library", &library, "--out", &out]);
        // Two hundred coarse cases do not reach the paper's errors.
        assert_eq!(answer.code, Some(1), "{}", answer.err);
        answer
    };
    simulate("cases = 200");
    let (first, again) = (reproduce(), reproduce());
    assert!(first.err.contains("training: done") && !first.err.contains("used again"));
    assert!(again.err.contains("used again") && !again.err.contains("training"), "{}", again.err);
    assert_eq!(first.out, again.out);
    simulate("cases = 210");
    let grown = reproduce();
    assert!(grown.err.contains("training: done"), "{}", grown.err);
}

/// Checks for exit code 2, and one line on standard error that contains all of `words`.
fn refused(answer: &system_tests::Answer, words: &[&str]) {
    assert_eq!(answer.code, Some(2), "{}", answer.err);
    assert_eq!(answer.err.trim_end().lines().count(), 1, "{}", answer.err);
    for word in words {
        assert!(answer.err.contains(word), "`{word}` is missing in: {}", answer.err);
    }
}
