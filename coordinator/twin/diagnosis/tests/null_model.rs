//! The version of null models: differences of a small one, as they were when it was last raised.

use std::path::Path;
use tracktwin_diagnosis::{Bands, Forward, NullModel, Section};
use tracktwin_parameters::TrackDesign;

/// Processors sum in another order: differences are alike up to this, in neper.
const ALIKE_NEPER: f64 = 1e-7;
/// Set to write the file anew.
const WRITE: &str = "TRACKTWIN_WRITE_GOLDEN";

#[test]
fn differences_are_those_of_the_version_of_null_models() {
    let section = Section::new(TrackDesign::v_track(), 3, 1.0);
    let forward = Forward::new(section, Bands::new(100.0, 3300.0), &[10.0], vec![0.0]);
    let values = NullModel::grid_values(&forward, &forward.unknowns.typical());
    let null = NullModel::simulate(&forward, &values, 1, 7, &|_| ()).unwrap();
    let now = null.differences.concat();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/null_model.json");
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, serde_json::to_string_pretty(&now).unwrap() + "\n").unwrap();
    }
    let kept: Vec<f64> = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let alike = now.iter().zip(&kept).all(|(now, kept)| (now - kept).abs() < ALIKE_NEPER);
    assert!(
        alike && now.len() == kept.len(),
        "differences of version {} are other than those in null_model.json. If null models were \
         meant to change, raise NullModel::VERSION, set {WRITE}=1, run this test, and commit the file",
        NullModel::VERSION
    );
}
