//! Limits of a recording's values and of the size of a file in memory.

use super::error::{Fault, RecordingError};
use super::manifest::Manifest;
use super::track::numbers;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use serde_json::{Map, Value};
use std::fs::File;
use std::path::Path;
use tracktwin_parameters::Quantity;
use tracktwin_parameters::quantity::{
    PASSES, PLACE, SAMPLE_RATE, SLEEPERS, SPACING, SPEED, WHEEL_RADIUS,
};

/// Bytes of text, and of unpacked numbers, that a pass's file has at most.
const BYTES_MAX: u64 = 3_000_000_000;

/// Numbers that `nominal` may state: part, name, what it can be.
const NOMINAL: [(&str, &str, Quantity); 11] = [
    ("rail", "area_m2", Quantity::new("area of a rail", "m2", [1e-5, 0.1], [5e-4, 1e-2])),
    (
        "rail",
        "second_moment_m4",
        Quantity::new("second moment of a rail", "m4", [1e-10, 1e-2], [1e-7, 1e-4]),
    ),
    ("rail", "youngs_Pa", Quantity::new("Young's modulus", "Pa", [1e8, 1e13], [1e11, 3e11])),
    ("rail", "density_kg_m3", Quantity::new("density", "kg/m3", [100.0, 5e4], [7000.0, 8000.0])),
    ("rail", "poisson", Quantity::new("Poisson's ratio", "", [0.0, 0.5], [0.25, 0.35])),
    ("sleeper", "spacing_m", SPACING),
    (
        "sleeper",
        "half_length_m",
        Quantity::new("half length of a sleeper", "m", [0.02, 5.0], [0.2, 1.4]),
    ),
    ("sleeper", "density_kg_m3", Quantity::new("density", "kg/m3", [100.0, 5e4], [700.0, 8000.0])),
    ("wheel", "mass_kg", Quantity::new("mass of a wheel", "kg", [4.0, 1e4], [10.0, 2000.0])),
    ("wheel", "load_N", Quantity::new("wheel load", "N", [4e2, 1e6], [500.0, 2e5])),
    ("wheel", "radius_m", WHEEL_RADIUS),
];

/// Checks that every number of `recording.json` is within its limits.
pub(super) fn manifest(path: &Path, manifest: &Manifest) -> Result<(), RecordingError> {
    let check = |field: &str, of: Quantity, value: f64| {
        let checked = of.check(value);
        checked.map_err(|error| RecordingError::new(path, field, Fault::OutOfRange(error)))
    };
    check("sample_rate_Hz", SAMPLE_RATE, manifest.sample_rate_hz)?;
    if !manifest.passes.is_empty() {
        check("passes", PASSES, manifest.passes.len() as f64)?;
    }
    check("sleepers", SLEEPERS, manifest.sleepers.len() as f64)?;
    for (index, pass) in manifest.passes.iter().enumerate() {
        check(&format!("passes[{index}].speed_km_h"), SPEED, pass.speed_km_h)?;
    }
    for (index, sleeper) in manifest.sleepers.iter().enumerate() {
        check(&format!("sleepers[{index}].x_m"), PLACE, sleeper.x_m)?;
    }
    types(path, &manifest.nominal)?;
    for (part, name, of) in NOMINAL {
        if let Some(value) = stated(&manifest.nominal, part, name) {
            check(&format!("nominal.{part}.{name}"), of, value)?;
        }
    }
    Ok(())
}

/// Checks the types of the values of `nominal`. A null is as if the name were absent; as wheelbase it states that there
/// is no other wheel.
fn types(path: &Path, nominal: &Map<String, Value>) -> Result<(), RecordingError> {
    let refused = |field: String, value: &Value, expected: &'static str| {
        let fault = Fault::WrongValue { found: value.to_string(), expected };
        Err(RecordingError::new(path, &field, fault))
    };
    if let Some(value) = nominal.get("gain_known").filter(|value| !value.is_boolean()) {
        return refused("nominal.gain_known".to_owned(), value, "true or false");
    }
    for (part, name) in numbers() {
        let fields = part.map_or(Some(nominal), |part| nominal.get(part)?.as_object());
        let value = fields.and_then(|fields| fields.get(name));
        if let Some(value) = value.filter(|value| !value.is_number() && !value.is_null()) {
            let part = part.map_or(String::new(), |part| format!("{part}."));
            return refused(format!("nominal.{part}{name}"), value, "a number");
        }
    }
    Ok(())
}

fn stated(nominal: &Map<String, Value>, part: &str, name: &str) -> Option<f64> {
    nominal.get(part)?.get(name)?.as_f64()
}

/// Checks that the numbers of a file fit into memory, because all of them are loaded at once.
pub(super) fn file(path: &Path) -> Result<(), RecordingError> {
    // Values of another type are refused by the reader.
    let bytes = unpacked(path).unwrap_or_default();
    if bytes <= BYTES_MAX {
        return Ok(());
    }
    let fault = Fault::TooLarge { bytes, most: BYTES_MAX };
    Err(RecordingError::new(path, "file", fault))
}

/// Bytes of a file's numbers, or of its text.
fn unpacked(path: &Path) -> Option<u64> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match ending.to_ascii_lowercase().as_str() {
        "parquet" => {
            let reader = SerializedFileReader::new(File::open(path).ok()?).ok()?;
            let metadata = reader.metadata().file_metadata();
            let columns = metadata.schema_descr().num_columns();
            let rows = u64::try_from(metadata.num_rows()).ok()?;
            Some(rows.saturating_mul(8).saturating_mul(columns as u64))
        }
        "npz" => {
            let mut archive = zip::ZipArchive::new(File::open(path).ok()?).ok()?;
            let sizes =
                (0..archive.len()).map(|index| archive.by_index_raw(index).map(|it| it.size()));
            Some(sizes.flatten().fold(0, u64::saturating_add))
        }
        _ => Some(path.metadata().ok()?.len()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::DesignNumber;

    #[test]
    fn a_file_that_no_memory_holds_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pass.csv");
        // Sparse: it takes no room.
        File::create(&path).unwrap().set_len(BYTES_MAX + 1).unwrap();
        let error = file(&path).unwrap_err().to_string();
        assert!(error.contains("pass.csv: file: has 3.0 GB") && error.contains("split"), "{error}");
        File::create(&path).unwrap().set_len(100).unwrap();
        file(&path).unwrap();
    }

    #[test]
    fn mass_and_load_have_the_limits_of_a_track_file() {
        for (name, key) in [("mass_kg", "vehicle.mass_kg"), ("load_N", "vehicle.load_N")] {
            let stated = NOMINAL.iter().find(|it| it.1 == name).map(|it| it.2.range);
            assert_eq!(stated, DesignNumber::named(key).map(DesignNumber::range), "{key}");
        }
        // Kilonewtons.
        let load = NOMINAL.iter().find(|it| it.1 == "load_N").unwrap().2;
        let error = load.check(60.0).unwrap_err().to_string();
        assert!(error.contains("did you mean 60000?"), "{error}");
    }

    #[test]
    fn what_is_usual_of_a_nominal_value_can_be() {
        for (part, name, of) in NOMINAL {
            assert!(of.usual.iter().all(|&usual| of.check(usual).is_ok()), "{part}.{name}");
        }
    }
}
