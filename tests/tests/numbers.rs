//! Invalid numbers are refused when they are read, with one line and exit code 2. No memory is allocated
//! for them.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fs;
use std::process::Command;
use system_tests::Answer;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// Limit of a command's address space in KiB; less than an unchecked number would need.
const MEMORY_KIB: &str = "4000000";

/// Runs a program with this limit.
fn bounded(program: &str, arguments: &[&str]) -> Answer {
    let script = format!("ulimit -v {MEMORY_KIB}; exec \"$0\" \"$@\"");
    let output = Command::new("sh").args(["-c", &script, program]).args(arguments).output();
    let output = output.unwrap();
    Answer {
        code: output.status.code(),
        out: String::from_utf8_lossy(&output.stdout).into_owned(),
        err: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

fn refused(program: &str, arguments: &[&str]) -> String {
    let Answer { code, out, err } = bounded(program, arguments);
    assert_eq!(code, Some(2), "{arguments:?}: {err}");
    assert!(out.is_empty(), "{arguments:?}: {out}");
    assert!(!err.contains("panicked"), "{arguments:?}: {err}");
    err
}

/// Texts that are not valid for any quantity.
const NONE: [&str; 9] = ["NaN", "inf", "-inf", "1e400", "", "many", "0x10", "-1e300", "1e300"];

#[test]
fn no_flag_takes_a_number_that_is_none() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name).display().to_string();
    let (out, file) = (path("out"), path("out.csv"));
    let simulate = ["simulate", "--out", &out];
    let receptance = ["receptance", "--at", "sleeper", "--out", &file];
    let import = ["import", "none.csv", "--out", &out];
    let library = ["--library", "sqlite:none.sqlite"];
    let status = [&["status", "--watch"][..], &library].concat();
    let coordinator = [&["coordinator", "--campaign", "none.toml"][..], &library].concat();
    let worker = ["--coordinator", "http://127.0.0.1:1"];
    let flags: [(&str, &[&str], &[&str]); 8] = [
        (
            PROGRAM,
            &simulate,
            &[
                "--speed",
                "--spans",
                "--passes",
                "--unrepeated",
                "--noise",
                "--resolution",
                "--odometer",
                "--rail-elements",
                "--sleeper-elements",
                "--time-step",
                "--seed",
            ],
        ),
        (PROGRAM, &receptance, &["--spans", "--from", "--to", "--points", "--at"]),
        (
            PROGRAM,
            &import,
            &["--sample-rate", "--speed", "--spacing", "--sleeper", "--wheel-radius"],
        ),
        (PROGRAM, &["run", "--out", &out], &["--cases", "--cores"]),
        (PROGRAM, &["trial", "--out", &out], &["--cases", "--seed"]),
        (PROGRAM, &status, &["--every"]),
        (PROGRAM, &coordinator, &["--cases", "--lease", "--audit"]),
        (WORKER, &worker, &["--cores", "--idle-exit", "--give-up-after"]),
    ];
    for (program, before, names) in flags {
        for name in names {
            for number in NONE {
                let flag = format!("{name}={number}");
                let error = refused(program, &[before, &[&flag]].concat());
                assert!(error.contains(name), "{flag}: {error}");
            }
        }
    }
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
}

#[test]
fn numbers_that_no_track_or_machine_has_are_refused_with_what_can_be() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out").display().to_string();
    for (arguments, words) in [
        (&["simulate", "--speed=0.0001"][..], &["0.5 to 500 km/h"][..]),
        (&["simulate", "--speed=0.5", "--spans=1000"], &["samples", "GB", "--time-step"]),
        (&["simulate", "--spans=1000000000"], &["2 to 1000"]),
        (&["simulate", "--speed=10", "--speed=13", "--speed=10"], &["--speed 10", "--passes 2"]),
        (&["simulate", "--speed=200", "--sample-rate=1000"], &["--sample-rate", "filter"]),
        (&["simulate", "--passes=1000000000"], &["1 to 1000"]),
        (&["simulate", "--passes=1000", "--speed=1"], &["samples", "GB"]),
        (&["simulate", "--rail-elements=1000000"], &["1 to 64"]),
        (&["simulate", "--time-step=1e-12"], &["1e-7 to", " s;"]),
        (&["simulate", "--set=ballast_stiffness_N_m=1"], &["N/m", "4000 to"]),
        (&["simulate", "--set=ballast_stiffness_N_m=12"], &["did you mean 1.2e7?"]),
        (&["simulate", "--set=ballast_stiffness_N_m=1e30"], &["N/m", "can be"]),
        (&["simulate", "--extend=wheel_flat:length_m=1e9"], &["length_m", "can be"]),
        (&["simulate", "--extend=second_wheel:distance_m=1e9"], &["distance_m", "can be"]),
        (
            &["receptance", "--at=sleeper", "--set=ballast_stiffness_N_m@SN3=1e7"],
            &["remove the sleepers"],
        ),
        (
            &["hammer", "simulate", "--set=ballast_stiffness_N_m@SN12=1e7"],
            &["SN12 does not exist; the last sleeper is SN11"],
        ),
        (&["import", "f.csv", "--spacing=1e-6"], &["0.05 to 2 m"]),
        (&["import", "f.csv", "--spacing=600"], &["600 m is not a valid", "did you mean 0.6?"]),
        (&["import", "f.csv", "--speed=9999"], &["0.5 to 500 km/h"]),
        (&["run", "--cases=4000000000"], &["1 to 1e7"]),
        (&["run", "--cores=1000000000"], &["1 to 4096"]),
    ] {
        let error = refused(PROGRAM, &[arguments, &["--out", &out]].concat());
        for word in words {
            assert!(error.contains(word), "{arguments:?}: `{word}` is missing in: {error}");
        }
    }
}

/// A campaign file with an additional line or section.
fn campaign(line: &str) -> String {
    match line.strip_prefix('[') {
        Some(_) => format!("name = \"c\"\nseed = 1\ncases = 8\n{line}\n"),
        None => format!("{line}\nname = \"c\"\nseed = 1\n"),
    }
}

#[test]
fn no_file_takes_a_number_that_is_none() {
    let home = tempfile::tempdir().unwrap();
    let path = |name: &str| home.path().join(name).display().to_string();
    let (file, out) = (path("c.toml"), path("out"));
    for line in [
        "cases = 4000000000",
        "cases = -1",
        "cases = 0",
        "cases = 1e300",
        "cases = 8\nspeeds_km_h = [1e-9]",
        "cases = 8\nspeeds_km_h = [1e9]",
        "cases = 8\nspeeds_km_h = [nan]",
        "cases = 8\nspeeds_km_h = [inf]",
        "[simulation]\nspans = 1000000000",
        "[simulation]\nspans = 0",
        "[simulation]\nrail_elements_per_span = 1000000",
        "[simulation]\nsleeper_elements = 0",
        "[simulation]\ntime_step_s = 1e-30",
        "[simulation]\ntime_step_s = 1e-8",
        "[simulation]\ntime_step_s = nan",
        "[simulation]\nrun_in_spans = 1e300",
        "[features]\nvoices_per_octave = 4000000000",
        "[features]\nreference_rate_hz = 1e30",
        "[features]\ninstant_rate_hz = 1e9",
        "[features]\nmargin_s = 1e9",
        "[features]\nlowest_hz = 1e-300",
        "[features]\nfloor_m2_s4 = -1",
        "[parameters]\nballast_stiffness_N_m = 1e-9",
        "[parameters]\nballast_stiffness_N_m = [1e-9, 1e7]",
        "[parameters]\nballast_stiffness_N_m = [1e7, inf]",
        "[parameters]\nballast_stiffness_N_m = { low = nan, high = 1e7, scale = \"linear\" }",
        "[[extension]]\nphysics = \"hanging_sleeper\"\ngap_m = [1e-5, 1e30]",
        "[[extension]]\nphysics = \"hanging_sleeper\"\ngap_m = 1e-4\nshare = 7",
    ] {
        fs::write(&file, campaign(line)).unwrap();
        let error = refused(PROGRAM, &["run", &file, "--no-train", "--out", &out]);
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
        assert!(error.contains("c.toml"), "{error}");
    }
    for line in [
        "spacing_m = 600",
        "spacing_m = nan",
        "sample_rate_Hz = 0",
        "speed_km_h = 1e9",
        "wheel_radius_m = -1",
        "sleeper_m = inf",
    ] {
        fs::write(&file, line).unwrap();
        let error = refused(PROGRAM, &["import", "f.csv", "--out", &out, "--layout", &file]);
        assert!(error.contains("c.toml") && error.contains("can be"), "{error}");
    }
    assert!(!home.path().join("out").exists());
}

#[test]
fn no_recording_takes_a_number_that_is_none() {
    let home = tempfile::tempdir().unwrap();
    let manifest = |rate: &str, speed: &str, x_m: &str, nominal: &str| {
        format!(
            r#"{{"format": "aba-recording/1", "sample_rate_Hz": {rate},
            "passes": [{{"file": "pass.csv", "speed_km_h": {speed}}}],
            "sleepers": [{{"id": "SN1", "x_m": {x_m}}}], "nominal": {nominal}}}"#
        )
    };
    let spacing = |m: &str| format!(r#"{{"sleeper": {{"spacing_m": {m}}}}}"#);
    let usual = spacing("0.125");
    for (field, text) in [
        ("sample_rate_Hz", manifest("1e300", "13", "0.25", &usual)),
        ("sample_rate_Hz", manifest("0.001", "13", "0.25", &usual)),
        ("speed_km_h", manifest("10000", "1e9", "0.25", &usual)),
        ("speed_km_h", manifest("10000", "1e-9", "0.25", &usual)),
        ("x_m", manifest("10000", "13", "1e30", &usual)),
        ("spacing_m", manifest("10000", "13", "0.25", &spacing("1e-9"))),
        ("spacing_m", manifest("10000", "13", "0.25", &spacing("600"))),
        (
            "mass_kg",
            manifest(
                "10000",
                "13",
                "0.25",
                r#"{"sleeper": {"spacing_m": 0.125}, "wheel": {"mass_kg": -4}}"#,
            ),
        ),
    ] {
        fs::write(home.path().join("recording.json"), text).unwrap();
        fs::write(home.path().join("pass.csv"), "time_s,position_m,acceleration_m_s2\n").unwrap();
        let error = refused(PROGRAM, &["inspect", &home.path().display().to_string()]);
        assert!(error.contains(field) && error.contains("can be"), "{field}: {error}");
    }
    let sleepers: Vec<String> =
        (0..200_000).map(|n| format!(r#"{{"id": "SN{n}", "x_m": {n}}}"#)).collect();
    let text = manifest("10000", "13", "0.25", &usual);
    let many = text.replace(r#"{"id": "SN1", "x_m": 0.25}"#, &sleepers.join(","));
    fs::write(home.path().join("recording.json"), many).unwrap();
    let error = refused(PROGRAM, &["inspect", &home.path().display().to_string()]);
    assert!(error.contains("sleepers: 200000 is not a valid number of sleepers"), "{error}");
}
