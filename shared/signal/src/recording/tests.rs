//! Recordings written, read back, and broken on purpose, one fault at a time.

use super::{Pass, Recording, Sleeper};
use crate::Signal;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use test_needs::{reference, shared_data};

const RATE_HZ: f64 = 1e4;

/// Half a metre at 10 km/h over three sleepers, two passes.
fn recording() -> Recording {
    let step_m = 10.0 / 3.6 / RATE_HZ;
    let pass = |number: f64| {
        let position_m: Vec<f64> = (0..1800).map(|i| f64::from(i) * step_m).collect();
        let samples = position_m.iter().map(|x| (number * 200.0 * x).sin()).collect();
        let signal = Signal::new(RATE_HZ, samples).unwrap();
        Pass {
            file: String::new(),
            speed_km_h: 10.0,
            axle: None,
            signal,
            position_m,
            contact_loss_share: None,
        }
    };
    let sleeper = |(id, x_m): (&str, f64)| Sleeper { id: id.to_owned(), x_m };
    let nominal = json!({"sleeper": {"spacing_m": 0.125}});
    Recording {
        name: "short".to_owned(),
        sample_rate_hz: RATE_HZ,
        channel: "vertical axle-box acceleration, positive downwards".to_owned(),
        passes: vec![pass(1.0), pass(2.0)],
        sleepers: [("SN1", 0.125), ("SN2", 0.25), ("SN3", 0.375)].map(sleeper).to_vec(),
        nominal: nominal.as_object().unwrap().clone(),
        spacing_m: 0.125,
        doubts: Vec::new(),
    }
}

/// A written recording whose `recording.json` was changed by `change`.
fn folder(change: impl FnOnce(&mut Value)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    recording().write(folder.path()).unwrap();
    let path = folder.path().join("recording.json");
    let mut root: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    change(&mut root);
    fs::write(path, root.to_string()).unwrap();
    folder
}

/// The message that opening gives after `change`, without the folder's name.
fn message(change: impl FnOnce(&mut Value)) -> String {
    complaint(folder(change).path())
}

fn complaint(folder: &Path) -> String {
    let text = Recording::open(folder).unwrap_err().to_string();
    assert!(!text.contains('\n'), "one line: {text}");
    text.replace(&format!("{}/", folder.display()), "")
}

/// The message for a recording whose single pass is this CSV file.
fn csv_message(text: &str) -> String {
    let folder = folder(|root| {
        root["passes"] = json!([{"file": "pass.csv", "speed_km_h": 10.0}]);
    });
    fs::write(folder.path().join("pass.csv"), text).unwrap();
    complaint(folder.path())
}

/// A CSV pass of 1800 rows, where `row` may change a row's three values.
fn csv(row: impl Fn(usize, &mut [f64; 3])) -> String {
    let mut lines = vec!["time_s,position_m,acceleration_m_s2".to_owned()];
    for index in 0..1800 {
        let time = index as f64 / RATE_HZ;
        let mut values = [time, time * 10.0 / 3.6, 1.0];
        row(index, &mut values);
        lines.push(values.map(|value| value.to_string()).join(","));
    }
    lines.join("\n")
}

#[test]
fn a_written_recording_reads_back_alike() {
    let (before, folder) = (recording(), folder(|_| ()));
    let after = Recording::open(folder.path()).unwrap();
    assert_eq!(after.sleepers, before.sleepers);
    assert_eq!(after.nominal, before.nominal);
    assert_eq!(after.channel, before.channel);
    assert_eq!(after.passes[1].file, "pass-10kmh-2.parquet");
    for (a, b) in after.passes.iter().zip(&before.passes) {
        assert_eq!(a.position_m, b.position_m);
        for (x, y) in a.signal.samples().iter().zip(b.signal.samples()) {
            assert_eq!(*x, f64::from(*y as f32));
        }
    }
}

#[test]
fn fields_that_users_add_are_passed_over() {
    let folder = folder(|root| {
        root["weather"] = json!("rain");
        root["passes"][0]["driver"] = json!({"name": "A"});
    });
    assert_eq!(Recording::open(folder.path()).unwrap().passes.len(), 2);
}

#[test]
fn what_recording_json_states_is_read_without_passes() {
    let folder = folder(|root| drop(root.as_object_mut().unwrap().remove("passes")));
    assert!(complaint(folder.path()).contains("passes"));
    let (section, expected) = (Recording::without_passes(folder.path()).unwrap(), recording());
    assert_eq!((section.passes.len(), section.sleepers), (0, expected.sleepers));
    assert_eq!((section.sample_rate_hz, section.spacing_m), (RATE_HZ, 0.125));
    assert_eq!(section.nominal, expected.nominal);
}

#[test]
fn a_window_holds_the_samples_within_half_a_spacing() {
    let recording = recording();
    let window = recording.window(0, 1).unwrap();
    let positions = &recording.passes[0].position_m;
    assert!(positions[window.start] >= 0.1875 && positions[window.start - 1] < 0.1875);
    assert!(positions[window.end - 1] <= 0.3125 && positions[window.end] > 0.3125);
    // One spacing at 10 km/h is 450 samples, one more or less at the ends.
    assert!(window.len().abs_diff(450) <= 1, "{}", window.len());
}

#[test]
fn a_sleeper_at_the_end_has_half_a_window_and_one_outside_has_none() {
    let mut recording = recording();
    recording.sleepers[0].x_m = 0.0;
    recording.sleepers[2].x_m = 0.6;
    assert!((recording.window_share(0, 0) - 0.5).abs() < 1e-12);
    assert!(recording.window(0, 0).unwrap().len().abs_diff(226) <= 1);
    assert_eq!(recording.window(0, 2), None);
}

#[test]
fn spacing_comes_from_the_sleepers_where_none_is_stated() {
    let folder = folder(|root| root["nominal"] = json!({}));
    assert_eq!(Recording::open(folder.path()).unwrap().spacing_m, 0.125);
}

#[test]
fn csv_passes_are_read() {
    let folder = folder(|root| root["passes"][0]["file"] = json!("pass.csv"));
    fs::write(folder.path().join("pass.csv"), csv(|_, _| ())).unwrap();
    let recording = Recording::open(folder.path()).unwrap();
    assert_eq!(recording.passes[0].signal.len(), 1800);
}

#[test]
fn a_missing_or_broken_manifest_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let text = complaint(empty.path());
    assert!(
        text.ends_with(
            ": recording: the folder holds no recording.json; create one with `tracktwin import`"
        ),
        "{text}"
    );
    let text = complaint(&empty.path().join("gone"));
    assert!(
        text.contains("gone: recording: the folder does not exist; correct its name"),
        "{text}"
    );
    fs::write(empty.path().join("recording.json"), "{\"format\": ").unwrap();
    let text = complaint(empty.path());
    assert!(text.starts_with("recording.json: file: is not valid JSON (EOF"), "{text}");
}

#[test]
fn every_field_that_is_needed_is_asked_for_by_name() {
    let without = |field: &str| {
        message(|root| {
            root.as_object_mut().unwrap().remove(field);
        })
    };
    for field in ["format", "sample_rate_Hz", "passes", "sleepers"] {
        let text = without(field);
        assert!(text.starts_with(&format!("recording.json: {field}: is missing; add ")), "{text}");
    }
    assert_eq!(
        message(|root| root["passes"][1]["speed_km_h"] = json!("10")),
        "recording.json: passes[1].speed_km_h: is \"10\"; give the nominal speed in km/h"
    );
    assert_eq!(
        message(|root| root["sleepers"][2]["id"] = json!("SN1")),
        "recording.json: sleepers: duplicate sleeper id SN1; give every sleeper a unique id"
    );
    let text = message(|root| root["format"] = json!("aba-recording/2"));
    assert!(text.contains("\"aba-recording/1\""), "{text}");
    let text = message(|root| root["notes"] = json!(["one", 2]));
    assert_eq!(text, "recording.json: notes: is [\"one\",2]; give a list of texts");
    let text = message(|root| root["passes"] = json!([]));
    assert!(text.starts_with("recording.json: passes: is []; give"), "{text}");
}

#[test]
fn a_missing_pass_and_an_unknown_kind_are_named() {
    let text = message(|root| root["passes"][0]["file"] = json!("gone.parquet"));
    assert!(text.starts_with("gone.parquet: file: the file does not exist"), "{text}");
    let text = message(|root| root["passes"][0]["file"] = json!("recording.json"));
    assert!(text.contains("neither .parquet nor .csv"), "{text}");
}

#[test]
fn a_missing_column_is_named_with_those_present() {
    let text = csv_message("time_s,acc\n0,1\n");
    assert_eq!(
        text,
        "pass.csv: position_m: the column is missing; rename one of the file's columns: time_s, acc"
    );
}

#[test]
fn a_value_that_is_no_number_is_named_by_its_row() {
    let text = csv_message("time_s,position_m,acceleration_m_s2\n0,0,1\n1e-4,1e-3,oops\n");
    assert!(text.starts_with("pass.csv: acceleration_m_s2: row 2 is \"oops\""), "{text}");
    let text = csv_message(&csv(|index, values| {
        if index == 6 {
            values[2] = f64::NAN;
        }
    }));
    assert!(text.starts_with("pass.csv: acceleration_m_s2: row 7 is NaN"), "{text}");
    let text = csv_message(&csv(|index, values| {
        if index % 10 != 0 {
            values[1] = f64::NAN;
        }
    }));
    assert!(text.starts_with("pass.csv: position_m: 1620 of 1800 rows are empty or"), "{text}");
}

#[test]
fn a_pass_without_rows_is_refused() {
    let text = csv_message("time_s,position_m,acceleration_m_s2\n");
    assert!(text.starts_with("pass.csv: time_s: has 0 rows"), "{text}");
}

#[test]
fn a_file_that_is_no_parquet_is_refused() {
    let folder = folder(|root| root["passes"][0]["file"] = json!("text.parquet"));
    fs::write(folder.path().join("text.parquet"), "time_s").unwrap();
    let text = complaint(folder.path());
    assert!(text.starts_with("text.parquet: file: unreadable ("), "{text}");
}

#[test]
fn a_compression_that_is_not_supported_is_named() {
    let folder = folder(|root| root["passes"][0]["file"] = json!("gzip.parquet"));
    let file = include_bytes!("../../tests/gzip.parquet");
    fs::write(folder.path().join("gzip.parquet"), file).unwrap();
    let text = complaint(folder.path());
    assert!(text.starts_with("gzip.parquet: file: its compression is not supported"), "{text}");
}

#[test]
fn a_wrong_sample_rate_is_found_by_the_times() {
    let text = message(|root| root["sample_rate_Hz"] = json!(20000));
    assert!(
        text.starts_with("recording.json: sample_rate_Hz: is 20000 Hz but `time_s` of pass-10kmh-1.parquet advances at 10000 Hz"),
        "{text}"
    );
}

#[test]
fn a_gap_in_time_is_named_by_its_row() {
    let text = csv_message(&csv(|index, values| {
        if index >= 900 {
            values[0] += 0.001;
        }
    }));
    assert!(text.starts_with("pass.csv: time_s: the step to row 901 is 0.0011 s"), "{text}");
    assert!(text.contains("step to row 901"), "{text}");
}

#[test]
fn a_short_gap_in_time_is_told_by_the_declared_rate() {
    // The mean step is longer by a tenth.
    let text = csv_message(&csv(|index, values| {
        if index >= 900 {
            values[0] += 0.01;
        }
    }));
    assert!(text.contains("but 0.0001 s is expected"), "{text}");
}

#[test]
fn columns_between_semicolons_are_told_by_their_mend() {
    let text = csv_message(&csv(|_, _| ()).replace(',', ";"));
    assert!(text.contains("not separated by commas"), "{text}");
}

#[test]
fn a_position_that_runs_back_is_named_by_its_row() {
    let text = csv_message(&csv(|index, values| {
        if index == 100 {
            values[1] -= 0.01;
        }
    }));
    assert!(text.starts_with("pass.csv: position_m: decreases from"), "{text}");
    assert!(text.contains("at row 101"), "{text}");
}

#[test]
fn a_wrong_speed_a_short_pass_and_a_foreign_place_are_refused() {
    let text = message(|root| root["passes"][1]["speed_km_h"] = json!(13));
    assert!(text.starts_with("recording.json: passes[1].speed_km_h: is 13 km/h"), "{text}");
    let text = message(|root| root["nominal"]["wheel"] = json!({"mass_kg": "44"}));
    assert!(text.contains("nominal.wheel.mass_kg: is \"44\"; give a number"), "{text}");
    let text = message(|root| root["nominal"]["gain_known"] = json!("false"));
    assert!(text.contains("nominal.gain_known: is \"false\"; give true or false"), "{text}");
    let text = message(|root| root["nominal"]["sleeper"]["spacing_m"] = json!(0.6));
    assert!(text.contains("covers 0.500 m; the window of one sleeper needs 0.6 m"), "{text}");
    let text = message(|root| {
        for sleeper in root["sleepers"].as_array_mut().unwrap() {
            sleeper["x_m"] = json!(sleeper["x_m"].as_f64().unwrap() + 100.0);
        }
    });
    assert!(text.starts_with("recording.json: sleepers: no sleeper lies inside a pass"), "{text}");
}

#[test]
fn an_independent_recording_opens_with_a_window_for_every_sleeper() {
    let recording = Recording::open(reference().join("recordings/dev-01")).unwrap();
    assert_eq!(recording.name, "dev-01");
    assert_eq!((recording.passes.len(), recording.sleepers.len()), (6, 29));
    assert_eq!(recording.speeds_km_h(), [7.0, 10.0, 13.0]);
    for pass in 0..6 {
        let expected = 0.125 / (recording.passes[pass].speed_km_h / 3.6) * 1e5;
        for sleeper in 1..28 {
            let length = recording.window(pass, sleeper).unwrap().len() as f64;
            // The odometer's scale drifts by less than a per cent.
            assert!((length / expected - 1.0).abs() < 0.01, "{length} against {expected}");
        }
    }
}

#[test]
fn recordings_of_the_checkout_are_passes_of_those_that_they_are_cut_from() {
    let Some(shared) = shared_data() else { return };
    for entry in std::fs::read_dir(reference().join("recordings")).unwrap() {
        let kept = Recording::open(entry.unwrap().path()).unwrap();
        let whole = Recording::open(shared.join("recordings").join(&kept.name)).unwrap();
        assert_eq!((&kept.sleepers, &kept.nominal), (&whole.sleepers, &whole.nominal));
        for pass in &kept.passes {
            let same = |other: &&Pass| {
                Path::new(&other.file).file_name() == Path::new(&pass.file).file_name()
            };
            let origin = whole.passes.iter().find(same).unwrap();
            let single =
                |pass: &Pass| pass.signal.samples().iter().map(|&a| a as f32).collect::<Vec<_>>();
            assert!(single(pass) == single(origin), "{}: {}", kept.name, pass.file);
            // Positions are kept to ten nanometres.
            let mut pairs = pass.position_m.iter().zip(&origin.position_m);
            assert_eq!(pass.position_m.len(), origin.position_m.len());
            assert!(pairs.all(|(kept, x)| (kept - x).abs() < 6e-9), "{}: {}", kept.name, pass.file);
        }
    }
}
