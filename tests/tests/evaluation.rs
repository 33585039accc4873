//! Evaluation of a recording by inversion, from the command line.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::fs;
use std::path::Path;
use system_tests::{COARSE_MODEL, run, simulated};
use tracktwin_signal::Signal;
use tracktwin_signal::recording::Recording;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../coordinator/sample");

/// JSON output of an evaluation without models.
fn evaluated(recording: &Path, out: &Path) -> Value {
    let [recording, folder] = [recording, out].map(|path| path.display().to_string());
    let answer = run(PROGRAM, &["evaluate", &recording, "--out", &folder, "--json"]).succeeded();
    let summary: Value = serde_json::from_str(&answer).unwrap();
    let text = fs::read_to_string(out.join("evaluation.json")).unwrap();
    let evaluation: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["sleepers"], evaluation["sleepers"].as_array().unwrap().len());
    for key in ["recording", "method", "outside_library", "notes"] {
        assert_eq!(summary[key], evaluation[key]);
    }
    assert!(Path::new(summary["report"].as_str().unwrap()).exists(), "{answer}");
    evaluation
}

/// Means of a parameter at the sleepers with numbers in this range.
fn means(evaluation: &Value, parameter: &str, numbers: std::ops::RangeInclusive<u32>) -> Vec<f64> {
    let sleepers = evaluation["sleepers"].as_array().unwrap().iter();
    let number = |sleeper: &Value| sleeper["id"].as_str().unwrap()[2..].parse::<u32>().unwrap();
    let inside = sleepers.filter(|sleeper| numbers.contains(&number(sleeper)));
    inside.map(|sleeper| sleeper[parameter]["mean"].as_f64().unwrap()).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn the_sample_s_step_and_soft_railpads_are_found_without_library_or_models() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    let evaluation = evaluated(Path::new(SAMPLE), &out);
    assert_eq!(evaluation["format"], "tracktwin-evaluation/1");
    assert_eq!(evaluation["method"], "inversion");
    assert_eq!(evaluation["outside_library"]["share"], 0.0);
    let ballast = |numbers| mean(&means(&evaluation, "ballast_stiffness_N_m", numbers));
    // Truth: 14 and 8 MN/m with a step at SN13 (coordinator/sample/truth.json). One pass a speed.
    assert!((ballast(8..=11) / 14e6 - 1.0).abs() < 0.25, "{}", ballast(8..=11));
    assert!((ballast(14..=17) / 8e6 - 1.0).abs() < 0.25, "{}", ballast(14..=17));
    // Truth: 40 MN/m at SN9 and SN10, 120 elsewhere.
    let sleepers = evaluation["sleepers"].as_array().unwrap();
    let stiffness = |sleeper: &&Value| sleeper["railpad_stiffness_N_m"]["mean"].as_f64().unwrap();
    let mut softest: Vec<&Value> = sleepers.iter().collect();
    softest.sort_by(|a, b| stiffness(a).total_cmp(&stiffness(b)));
    let mut ids = [0, 1].map(|rank| softest[rank]["id"].as_str().unwrap());
    ids.sort_unstable();
    assert_eq!(ids, ["SN10", "SN9"]);

    let csv = fs::read_to_string(out.join("evaluation.csv")).unwrap();
    assert!(
        csv.starts_with("id,x_m,railpad_stiffness_N_m_mean,railpad_stiffness_N_m_sd,"),
        "{csv}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("evaluated by inversion from 3 passes at 7, 10, 13 km/h"));
    assert!(page.contains("Common to the sleepers in the middle"));
    let picture = fs::read_to_string(out.join("track.svg")).unwrap();
    for title in ["Railpad stiffness", "Ballast stiffness", "Irregularity level"] {
        assert!(picture.contains(&format!(">{title}</text>")), "{title} is not in {picture}");
    }
}

#[test]
fn the_step_of_an_independent_recording_comes_out_within_a_tenth() {
    let reference = test_needs::reference();
    let folder = tempfile::tempdir().unwrap();
    let evaluation = evaluated(&reference.join("recordings/dev-01"), &folder.path().join("result"));
    let truth = fs::read_to_string(reference.join("truth/dev-01.json")).unwrap();
    let truth: Value = serde_json::from_str(&truth).unwrap();
    for (parameter, tolerance) in [("ballast_stiffness_N_m", 0.1), ("railpad_stiffness_N_m", 0.25)]
    {
        for numbers in [8..=18, 21..=31] {
            let of = |number: u32| truth["sleepers"][format!("SN{number}")][parameter].as_f64();
            let expected: Vec<f64> = numbers.clone().map(|number| of(number).unwrap()).collect();
            let found = mean(&means(&evaluation, parameter, numbers));
            assert!((found / mean(&expected) - 1.0).abs() < tolerance, "{parameter}: {found}");
        }
    }
}

#[test]
fn gaussian_processes_without_models_are_refused_in_a_line() {
    let answer = run(PROGRAM, &["evaluate", SAMPLE, "--method", "gp", "--out", "nowhere"]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.err.contains("--models"), "{}", answer.err);
}

#[test]
fn passes_at_other_positions_than_their_speed_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    simulated(PROGRAM, &path, "25", &["13", "10", "7"], "");
    let mut recording = Recording::open(&path).unwrap();
    // Of two passes that differ, neither is known to be right.
    recording.passes[1].position_m.iter_mut().for_each(|x_m| *x_m += 0.04);
    let files = [0, 1].map(|pass| recording.passes[pass].file.clone());
    fs::remove_dir_all(&path).unwrap();
    recording.write(&path).unwrap();
    let evaluation = evaluated(&path, &folder.path().join("result"));
    let notes = evaluation["notes"].to_string();
    assert!(notes.contains("not compared with the track"), "{notes}");
    assert!(files.iter().all(|file| notes.contains(file)), "{files:?}: {notes}");
    assert!(notes.contains("The passes alone show position_error"), "{notes}");
    assert!(!notes.contains("tracktwin improve"), "{notes}");
    let speeds = evaluation["provenance"]["speeds_km_h"].as_array().unwrap();
    assert_eq!(speeds.len(), 2);
    let page = fs::read_to_string(folder.path().join("result/report.html")).unwrap();
    assert!(page.contains("evaluated by inversion from 4 passes at 7, 10 km/h"));
}

#[test]
fn rails_are_never_mixed_and_one_of_them_is_selected() {
    let folder = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(SAMPLE).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    let manifest = folder.path().join("recording.json");
    let mut stated: Value = serde_json::from_str(&fs::read_to_string(&manifest).unwrap()).unwrap();
    for (pass, rail) in
        stated["passes"].as_array_mut().unwrap().iter_mut().zip(["left", "right", "left"])
    {
        pass["rail"] = rail.into();
        pass["axle"] = 1.into();
    }
    fs::write(&manifest, stated.to_string()).unwrap();
    let recording = folder.path().display().to_string();
    let inspected =
        |options: &[&str]| run(PROGRAM, &[&["inspect", &recording, "--json"], options].concat());
    let refused = inspected(&[]);
    assert_eq!(refused.code, Some(2));
    assert!(
        refused.err.contains("left, right") && refused.err.contains("--rail"),
        "{}",
        refused.err
    );
    let refused = inspected(&["--rail", "left", "--axle", "2"]);
    assert!(refused.err.contains("axle `2`; known are: 1"), "{}", refused.err);
    let of_rail = |rail: &str| -> Value {
        serde_json::from_str(&inspected(&["--rail", rail]).succeeded()).unwrap()
    };
    let passes = |inspection: &Value| inspection["passes"].as_u64().unwrap();
    assert_eq!([passes(&of_rail("left")), passes(&of_rail("right"))], [2, 1]);
    assert!(of_rail("left")["recording"].as_str().unwrap().ends_with(" rail left"));
}

#[test]
fn models_do_not_see_a_pass_of_another_gain() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let library = format!("sqlite:{}", path("library.sqlite"));
    fs::write(path("campaign.toml"), format!("name = \"gain\"\ncases = 200\n{COARSE_MODEL}"))
        .unwrap();
    let library = ["--library", &library];
    let make = ["run", &path("campaign.toml"), "--out", &path("out")];
    run(PROGRAM, &[&make[..], &library].concat()).succeeded();
    let ride = ["simulate", "--out", &path("ride"), "--spans", "40", "--speed", "13"];
    run(PROGRAM, &[&ride[..], &["--passes", "4", "--noise", "0.01"]].concat()).succeeded();
    let mut recording = Recording::open(folder.path().join("ride")).unwrap();
    let louder = &mut recording.passes[2];
    let file = louder.file.clone();
    let samples = louder.signal.samples().iter().map(|value| 1.5 * value).collect();
    louder.signal = Signal::new(recording.sample_rate_hz, samples).unwrap();
    recording.write(folder.path().join("louder")).unwrap();
    recording.passes.remove(2);
    recording.write(folder.path().join("without")).unwrap();
    let evaluated = |name: &str| -> Value {
        let (ride, out) = (path(name), path(&format!("{name}-result")));
        let options = ["--method", "gp", "--models", &path("out/models"), "--out", &out];
        run(PROGRAM, &[&["evaluate", &ride][..], &options, &library].concat());
        let text = fs::read_to_string(format!("{out}/evaluation.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    let (louder, without) = (evaluated("louder"), evaluated("without"));
    assert!(louder["sleepers"] == without["sleepers"], "the louder pass was evaluated");
    let notes = louder["notes"].to_string();
    assert!(notes.contains(&format!("{file}: not compared with the track")), "{notes}");
    assert!(!without["notes"].to_string().contains("not compared"), "{without}");
}
