//! With `--json`, standard output is one JSON value with the content of the text output.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::fs;
use system_tests::{COARSE_MODEL, run};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Output of a command with `--json`.
fn printed(arguments: &[&str]) -> Value {
    let out = run(PROGRAM, &[arguments, &["--json"]].concat()).succeeded();
    serde_json::from_str(&out).unwrap()
}

#[test]
fn a_simulation_tells_its_passes_and_the_catalogue_its_kinds() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ride").display().to_string();
    let coarse = ["--spans", "16", "--rail-elements", "2", "--sleeper-elements", "2"];
    let simulate = ["simulate", "--out", &out, "--speed", "13", "--time-step", "5e-5"];
    let simulated = printed(&[&simulate[..], &coarse].concat());
    assert_eq!(simulated["recording"], *out);
    assert_eq!(simulated["passes"][0]["speed_km_h"], 13.0);
    assert!(simulated["passes"][0]["contact_loss_share"].is_f64(), "{simulated}");

    let kinds = printed(&["simulate", "--extend", "list"]);
    let joint = kinds.as_array().unwrap().iter().find(|kind| kind["physics"] == "rail_joint");
    let names = joint.unwrap()["parameters"].as_array().unwrap().iter().map(|it| &it["name"]);
    assert_eq!(
        names.collect::<Vec<_>>(),
        [
            "dip_m",
            "length_m",
            "dip_exponent",
            "dip_length_ratio",
            "bending_factor",
            "bending_length_m"
        ]
    );
}

#[test]
fn a_run_tells_what_it_made_and_the_training_how_good_the_models_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (campaign, out, models) = (path("campaign.toml"), path("out"), path("models"));
    let library = format!("sqlite:{}", path("library.sqlite"));
    fs::write(&campaign, format!("name = \"json\"\ncases = 200\n{COARSE_MODEL}")).unwrap();
    // Its speeds are not those of the sample recording.
    let made = printed(&["run", &campaign, "--out", &out, "--library", &library]);
    assert_eq!(made["library"], *path("library.sqlite"));
    assert_eq!(made["models"], *path("out/models"));
    assert!(made["evaluation"].is_null(), "{made}");

    let trained = printed(&["train", "--out", &models, "--library", &library]);
    let file = fs::read_to_string(format!("{models}/mase.json")).unwrap();
    assert_eq!(trained, serde_json::from_str::<Value>(&file).unwrap());
    assert_eq!(trained["cases"], 200);
}
