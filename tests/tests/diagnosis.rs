//! The program finds, names and locates the hidden extension of a recording, and refuses recordings that it
//! cannot diagnose.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;
use system_tests::{Answer, run, simulated};
use tempfile::TempDir;
use test_needs::shared_data;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::Recording;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// A folder with a recording of thirteen sleepers on a track with an extension; two passes at each of these
/// speeds in km/h.
fn recorded(speeds: &[&str], extension: &str) -> TempDir {
    recorded_over("25", speeds, extension)
}

/// As [`recorded`], on a track of `spans` spans.
fn recorded_over(spans: &str, speeds: &[&str], extension: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    simulated(PROGRAM, &folder.path().join("recording"), spans, speeds, extension);
    folder
}

/// Output of the program, and the written document.
fn diagnosed(folder: &Path, further: &[&str]) -> (Answer, Option<Value>) {
    let [recording, out] = ["recording", "out"].map(|name| folder.join(name));
    let [recording, folder] = [recording, out.clone()].map(|path| path.display().to_string());
    let arguments = [&["diagnose", &recording, "--out", &folder], further].concat();
    let answer = run(PROGRAM, &arguments);
    let text = std::fs::read_to_string(out.join("diagnosis.json"));
    (answer, text.ok().map(|text| serde_json::from_str(&text).unwrap()))
}

/// The accepted hypotheses, each with its sleepers.
fn accepted(diagnosis: &Value) -> Vec<(&str, Vec<&str>)> {
    let all = diagnosis["hypotheses"].as_array().unwrap();
    all.iter()
        .filter(|found| found["accepted"] == true)
        .map(|found| {
            let sleepers = found["location"]["sleepers"].as_array();
            let sleepers = sleepers.into_iter().flatten().filter_map(Value::as_str);
            (found["physics"].as_str().unwrap(), sleepers.collect())
        })
        .collect()
}

const JOINT: &str = "[[extension]]\nphysics = \"rail_joint\"\nx_m = [1.5625, 1.5625]\n\
                     dip_m = 6e-5\nbending_factor = 0.2\n";

#[test]
fn a_joint_is_named_between_its_sleepers_and_withheld_passes_confirm_it() {
    let folder = recorded(&["13", "10"], JOINT);
    let (answer, diagnosis) = diagnosed(folder.path(), &["--confirm"]);
    let diagnosis = diagnosis.unwrap();
    assert_eq!(answer.code, Some(1), "{}", answer.err);
    assert!(answer.out.starts_with("At SN11 and SN12, 1.56 m: a rail joint"), "{}", answer.out);
    assert_eq!(diagnosis["verdict"], "left_out_physics");
    assert_eq!(accepted(&diagnosis), [("rail_joint", vec!["SN11", "SN12"])]);
    let gains = diagnosis["fit"]["held_out_gain_nats"].as_object().unwrap();
    assert!(gains.len() == 2 && gains.values().all(|gain| gain.as_f64().unwrap() > 0.0));

    assert!(answer.out.contains("Withheld passes confirm it"), "{}", answer.out);
    let confirmation = &diagnosis["confirmation"];
    assert_eq!(confirmation["passes"].as_array().unwrap().len(), 2);
    let speeds = confirmation["speeds"].as_array().unwrap();
    assert_eq!(speeds.len(), 2);
    let mean = |name: &str| speeds.iter().map(|speed| speed[name].as_f64().unwrap()).sum::<f64>();
    assert!(mean("after_dB") < mean("before_dB"), "{confirmation}");
    assert!(confirmation["gain_nats"].as_f64().unwrap() > 4.0, "{confirmation}");
}

#[test]
fn with_one_pass_at_each_speed_there_is_none_to_withhold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("recording").display().to_string();
    let arguments = ["simulate", "--spans", "25", "--speed", "13", "--speed", "10", "--out", &out];
    assert_eq!(run(PROGRAM, &arguments).code, Some(0));
    let (answer, diagnosis) = diagnosed(folder.path(), &["--confirm"]);
    assert_eq!((answer.code, diagnosis), (Some(2), None));
    assert!(answer.err.contains("record one more pass"), "{}", answer.err);
}

#[test]
fn a_flat_without_its_name_is_something_unknown_on_the_tread() {
    let flat = "[[extension]]\nphysics = \"wheel_flat\"\nlength_m = 3e-3\n";
    let folder = recorded(&["13", "10"], flat);
    let (answer, diagnosis) = diagnosed(folder.path(), &["--without", "wheel_flat", "--json"]);
    let diagnosis = diagnosis.unwrap();
    let summary: Value = serde_json::from_str(&answer.out).unwrap();
    assert_eq!(summary["verdict"], "unknown_physics");
    assert_eq!(summary["accepted"][0], diagnosis["hypotheses"][0]);
    assert_eq!(accepted(&diagnosis), [("unknown_physics", Vec::new())]);
    assert_eq!(diagnosis["hypotheses"][0]["port"], "wheel_surface");
}

#[test]
fn an_uneven_wheel_that_was_found_joins_a_campaign_with_its_order() {
    let waves = "[[extension]]\nphysics = \"wheel_out_of_round\"\norder = 36\namplitude_m = 1e-6\n";
    // Six turns.
    let folder = recorded_over("32", &["13", "10"], waves);
    let (_, diagnosis) = diagnosed(folder.path(), &[]);
    let diagnosis = diagnosis.unwrap();
    assert_eq!(accepted(&diagnosis), [("wheel_out_of_round", Vec::new())]);
    assert_eq!(diagnosis["hypotheses"][0]["parameters"]["order"]["mean"], 36.0);

    let path = |name: &str| folder.path().join(name).display().to_string();
    let [campaign, found] = ["track.toml", "out/diagnosis.json"].map(path);
    let [extended, library] = ["track-extended.toml", "library.sqlite"].map(path);
    let library = format!("sqlite:{library}");
    std::fs::write(&campaign, run(PROGRAM, &["run", "--print-campaign"]).out).unwrap();
    let answer = run(PROGRAM, &["extend", &campaign, "--from", &found, "--json"]).succeeded();
    let written: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(written["campaign"], *extended);
    assert_eq!(written["physics"][0], "wheel_out_of_round");
    let text = std::fs::read_to_string(&extended).unwrap();
    assert!(text.contains("\norder = 36.0\n"), "{text}");
    // Of four cases two have the wheel.
    let arguments = ["run", &extended, "--cases", "4", "--no-train", "--library", &library];
    let answer = run(PROGRAM, &[&arguments[..], &["--out", &path("campaign")]].concat());
    assert_eq!(answer.code, Some(0), "{}", answer.err);
}

#[test]
fn with_one_speed_nothing_is_more_certain_than_a_half() {
    for (speeds, other) in [(&["13"][..], "10 km/h"), (&["13", "12.6"], "9 km/h")] {
        let folder = recorded(speeds, JOINT);
        let (_, diagnosis) = diagnosed(folder.path(), &[]);
        let diagnosis = diagnosis.unwrap();
        let most = diagnosis["hypotheses"][0]["probability"].as_f64().unwrap();
        assert!(most <= 0.5, "{speeds:?}: {most}");
        let notes = diagnosis["notes"].to_string();
        let is_said =
            notes.contains("One speed only") && notes.contains(&format!("Add a pass at {other}"));
        assert!(is_said, "{notes}");
    }
}

#[test]
fn passes_without_a_track_in_them_are_refused() {
    let folder = recorded(&["13"], JOINT);
    let path = folder.path().join("recording");
    let plain = Recording::open(&path).unwrap();
    let refused = |change: &mut dyn FnMut(f64) -> f64, words: &[&str]| {
        let mut recording = plain.clone();
        for pass in &mut recording.passes {
            let samples = pass.signal.samples().iter().map(|&sample| change(sample)).collect();
            pass.signal = Signal::new(pass.signal.sample_rate_hz(), samples).unwrap();
        }
        std::fs::remove_dir_all(&path).unwrap();
        recording.write(&path).unwrap();
        let (Answer { code, err, .. }, diagnosis) = diagnosed(folder.path(), &[]);
        let line = err.lines().last().unwrap();
        assert!(code == Some(2) && diagnosis.is_none(), "{code:?}: {err}");
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    };
    refused(&mut |_| 0.0, &["pass 1", "check sensor and cable"]);
    let mut state = 1_u32;
    let mut noise = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) - 0.5
    };
    refused(&mut noise, &["passes 1 and 2", "correlation", "noise"]);
}

/// Imports a minute of a running train at 67 km/h without sleeper positions, and diagnoses it. The wheel
/// has this circumference in m.
fn is_diagnosed_by_its_wheel(file: &Path, acceleration: &str, circumference_m: f64) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("recording").display().to_string();
    let file = file.display().to_string();
    let columns = [&format!("acceleration={acceleration}"), "time=t_s", "speed=speed_kmh"];
    let columns = columns.into_iter().flat_map(|column| ["--column", column]);
    let mut arguments = vec!["import", &file, "--out", &out, "--unit", "unknown"];
    arguments.extend(columns);
    assert_eq!(run(PROGRAM, &arguments).code, Some(0));
    let (answer, diagnosis) = diagnosed(folder.path(), &[]);
    let diagnosis = diagnosis.unwrap();
    assert_eq!(answer.code, Some(1), "{}", answer.err);
    assert_eq!(accepted(&diagnosis)[0].0, "wheel_out_of_round");
    let turn_m = &diagnosis["hypotheses"][0]["parameters"]["circumference_m"]["mean"];
    assert!((turn_m.as_f64().unwrap() / circumference_m - 1.0).abs() < 0.02, "{turn_m}");
    let held_out = |side: &str| diagnosis["fit"][side]["held_out"]["score"].as_f64().unwrap();
    assert!(held_out("after") > 0.5 && held_out("before") < 0.1);
    let notes = diagnosis["notes"].to_string();
    assert!(notes.contains("sleepers: their positions are unknown"), "{notes}");
}

#[test]
fn a_running_train_without_known_sleepers_is_diagnosed_by_its_wheel() {
    let Some(shared) = shared_data() else { return };
    // By hand: 6.545 Hz at 67.38 km/h.
    is_diagnosed_by_its_wheel(&shared.join("real/aba-k1/aba-k1.csv"), "acc_left", 2.86);
}

#[test]
fn a_simulated_train_without_known_sleepers_is_diagnosed_by_its_wheel() {
    // Fourteen orders of a wheel of 2.9 m under noise, from 66 to 68 km/h.
    let (mut state, mut turns) = (1_u32, 0.13);
    let mut table = "t_s,speed_kmh,acc\n".to_owned();
    for row in 0..120_000_u32 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(state >> 8) / f64::from(1 << 24) - 0.5;
        let km_per_h = 66.0 + 2.0 * f64::from(row) / 120_000.0;
        turns += km_per_h / 3.6 / 2000.0 / 2.9;
        let orders: f64 = (7..=20).map(|order| (TAU * f64::from(order) * turns).sin()).sum();
        let (time_s, value) = (f64::from(row) / 2000.0, noise + 0.05 * orders);
        writeln!(table, "{time_s:.4},{km_per_h:.0},{value:.4}").unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("train.csv");
    std::fs::write(&file, table).unwrap();
    is_diagnosed_by_its_wheel(&file, "acc", 2.9);
}
