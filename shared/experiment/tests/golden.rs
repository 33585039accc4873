//! The version of the physics: compares the features of some cases with those stored at the last change
//! of the version.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::collections::BTreeMap;
use std::path::Path;
use tracktwin_experiment::{Case, Experiment, Outcome, Simulate, Simulation};
use tracktwin_parameters::{Parameter, ParameterSet, TrackDesign};
use tracktwin_track::extension::{Kind, PlaceKind};

/// Every so many bins are kept.
const BINS_APART: usize = 8;
/// Processors sum in another order: features differ by less than this, in neper. Results of workers that
/// differ by as little are one result.
const ALIKE_NEPER: f64 = 1e-9;
/// Set to write the file anew.
const WRITE: &str = "TRACKTWIN_WRITE_GOLDEN";

type Golden = BTreeMap<String, Vec<f64>>;

fn v_track() -> Experiment {
    Experiment::new(TrackDesign::v_track())
}

/// The track with typical values of a kind, near the sleeper that is evaluated.
fn with(kind: &Kind) -> Experiment {
    let spacing_m = TrackDesign::v_track().sleeper.spacing_m;
    let x_m = v_track().sleeper() as f64 * spacing_m;
    let mut extension = serde_json::json!({ "physics": kind.physics });
    match kind.place {
        PlaceKind::Nowhere => {}
        PlaceKind::Point => extension["x_m"] = serde_json::json!([x_m, x_m]),
        PlaceKind::Stretch => extension["x_m"] = serde_json::json!([x_m - spacing_m, x_m]),
        PlaceKind::Sleepers => extension["sleepers"] = serde_json::json!([v_track().sleeper()]),
    }
    for parameter in kind.parameters.iter().filter(|parameter| parameter.typical != 0.0) {
        extension[parameter.name] = serde_json::json!(parameter.typical);
    }
    let extensions = vec![serde_json::from_value(extension).unwrap()];
    Experiment { speeds_km_h: vec![13.0], extensions, ..v_track() }
}

fn features(experiment: Experiment, parameters: ParameterSet) -> Vec<f64> {
    let experiment = experiment.checked().unwrap();
    let case = Case { index: 0, parameters, surface_seed: 7 };
    let outcomes = Simulation::new(&experiment).unwrap().simulate(&[case]);
    let Outcome::Finished(passes) = &outcomes[0] else { panic!("{:?}", outcomes[0]) };
    let bins = passes.iter().flat_map(|pass| pass.features.log_power.iter().step_by(BINS_APART));
    bins.copied().collect()
}

fn golden() -> Golden {
    let nominal = ParameterSet::nominal();
    let soft = nominal
        .with(Parameter::RailpadStiffness, Parameter::RailpadStiffness.range()[0])
        .with(Parameter::BallastStiffness, Parameter::BallastStiffness.range()[0])
        .with(Parameter::IrregularityLevel, Parameter::IrregularityLevel.range()[1]);
    let real_scale = Experiment {
        speeds_km_h: vec![50.0],
        ..Experiment::new(TrackDesign::v_track().enlarged(5.0))
    };
    let tracks = [
        ("nominal", v_track(), nominal),
        ("soft track, high level", v_track(), soft),
        ("five times as large", real_scale, nominal),
    ];
    let kinds = Kind::all().map(|kind| (kind.physics, with(kind), nominal));
    let cases = tracks.into_iter().chain(kinds);
    cases.map(|(name, experiment, set)| (name.to_owned(), features(experiment, set))).collect()
}

#[test]
fn features_are_those_of_the_version_of_the_physics() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden.json");
    let now = golden();
    if std::env::var_os(WRITE).is_some() {
        let text = serde_json::to_string_pretty(&now).unwrap() + "\n";
        std::fs::write(&path, text).unwrap();
    }
    let kept: Golden = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    assert!(kept.keys().eq(now.keys()), "other cases; set {WRITE}=1 and run the test again");
    for (name, features) in &now {
        let mut pairs = features.iter().zip(&kept[name]);
        let alike = pairs.all(|(now, kept)| (now - kept).abs() < ALIKE_NEPER);
        assert!(
            alike && features.len() == kept[name].len(),
            "{name}: features differ from those in golden.json. If the physics was meant to \
             change, raise its version: set {WRITE}=1, run this test, and commit golden.json"
        );
    }
}
