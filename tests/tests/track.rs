//! A track defined by the user: described, checked, simulated, evaluated.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::fs;
use std::path::Path;
use system_tests::run;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// Writes the preset of a line to `folder`. Returns the text of the file.
fn line(folder: &Path) -> String {
    let answer = run(PROGRAM, &["new", &text(folder), "--preset", "60E1-concrete"]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    fs::read_to_string(folder.join("track.toml")).unwrap()
}

#[test]
fn a_described_line_is_explained_in_figures() {
    let folder = tempfile::tempdir().unwrap();
    line(folder.path());
    let file = text(&folder.path().join("track.toml"));
    let page = run(PROGRAM, &["check", &file]).succeeded();
    for label in ["track modulus", "wheel on track (P2)", "pinned-pinned", "ISO 3095", "80 km/h"] {
        assert!(page.contains(label), "{page}");
    }
    let figures: Value =
        serde_json::from_str(&run(PROGRAM, &["check", &file, "--json"]).succeeded()).unwrap();
    let stiffness = figures["point_stiffness_n_m"].as_f64().unwrap();
    assert!((60e6..264e6).contains(&stiffness), "{stiffness}");
}

#[test]
fn a_changed_description_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("track.toml");
    let changed = line(folder.path()).replace("spacing_m = 0.6", "spacing_m = 0.65");
    fs::write(&file, &changed).unwrap();
    let answer = run(PROGRAM, &["new", &text(folder.path()), "--preset", "54E1-wood"]);
    assert_eq!(answer.code, Some(2), "{}", answer.err);
    assert_eq!(fs::read_to_string(&file).unwrap(), changed);
}

#[test]
fn nonsense_is_refused_in_a_line_with_the_key() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("track.toml");
    let good = line(folder.path());
    for (from, to, key) in [
        ("load_N = 60e3", "load_N = 60", "vehicle.load_N"),
        ("mass_kg = 650.0", "mass_kg = -650.0", "vehicle.mass_kg"),
        ("spacing_m = 0.6", "spacing_m = 600", "track.sleeper.spacing_m"),
        ("[vehicle]", "[vehicel]", "vehicel"),
        ("range = [50e6, 1600e6]", "range = [1600e6, 50e6]", "railpad_stiffness_N_m"),
    ] {
        assert!(good.contains(from), "{from}");
        fs::write(&file, good.replacen(from, to, 1)).unwrap();
        let answer = run(PROGRAM, &["check", &text(&file)]);
        assert_eq!(answer.code, Some(2), "{from}: {}", answer.err);
        assert_eq!(answer.err.trim_end().lines().count(), 1, "{}", answer.err);
        assert!(answer.err.contains(key), "{}", answer.err);
    }
}

#[test]
fn a_line_is_simulated_described_again_and_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    line(folder.path());
    let file = text(&folder.path().join("track.toml"));
    let ride = folder.path().join("ride");
    run(
        PROGRAM,
        &[
            "simulate",
            "--track",
            &file,
            "--out",
            &text(&ride),
            "--spans",
            "26",
            "--speed",
            "40",
            "--speed",
            "80",
            "--set",
            "ballast_stiffness_N_m=90e6",
            "--rail-elements",
            "4",
        ],
    )
    .succeeded();
    let again = folder.path().join("again");
    run(PROGRAM, &["new", &text(&again), "--from", &text(&ride)]).succeeded();
    let described = fs::read_to_string(again.join("track.toml")).unwrap();
    assert!(described.contains("mass_kg = 650.0"), "{described}");
    let out = folder.path().join("result");
    run(PROGRAM, &["evaluate", &text(&ride), "--track", &file, "--out", &text(&out)]).succeeded();
    let evaluation: Value =
        serde_json::from_str(&fs::read_to_string(out.join("evaluation.json")).unwrap()).unwrap();
    assert_eq!(evaluation["outside_library"]["share"], 0.0);
    let sleepers = evaluation["sleepers"].as_array().unwrap();
    let ballast = |sleeper: &Value| sleeper["ballast_stiffness_N_m"]["mean"].as_f64().unwrap();
    let mean = sleepers.iter().map(ballast).sum::<f64>() / sleepers.len() as f64;
    assert!((mean / 90e6).ln().abs() < 0.15, "{mean}");
}

/// Required accuracy: means within 10 % for ballast and 20 % for railpads. The 90 % intervals must contain
/// most true values; the 41 sleepers are not independent.
#[test]
fn a_line_of_an_independent_simulator_is_evaluated_sleeper_by_sleeper() {
    let Some(shared) = test_needs::shared_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    let recording = shared.join("recordings-line/line-01");
    run(PROGRAM, &["evaluate", &text(&recording), "--out", &text(&out)]).succeeded();
    let read = |path: &Path| -> Value {
        serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
    };
    let evaluation = read(&out.join("evaluation.json"));
    let truth = read(&shared.join("recordings-line-truth/line-01.json"));
    let judged: Vec<&Value> = evaluation["sleepers"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|sleeper| (8.99..=33.01).contains(&sleeper["x_m"].as_f64().unwrap()))
        .collect();
    for (parameter, most) in [("ballast_stiffness_N_m", 0.1), ("railpad_stiffness_N_m", 0.2)] {
        let errors = judged.iter().map(|sleeper| {
            let true_value =
                truth["sleepers"][sleeper["id"].as_str().unwrap()][parameter].as_f64().unwrap();
            let [mean, sd] = ["mean", "sd"].map(|of| sleeper[parameter][of].as_f64().unwrap());
            ((mean / true_value).ln(), (mean - true_value).abs() < 1.645 * sd)
        });
        let (errors, held): (Vec<f64>, Vec<bool>) = errors.unzip();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(mean.abs() < most, "{parameter}: {mean}");
        let held = held.iter().filter(|held| **held).count() as f64 / held.len() as f64;
        assert!(held > 0.75, "{parameter}: {held}");
    }
}
