//! Limits of a recording's values and of the size of a file in memory.

use super::error::{Fault, RecordingError};
use super::manifest::Manifest;
use super::track::{RAIL, SLEEPER, WHEEL, WHEELBASE, numbers};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use serde_json::{Map, Value};
use std::fs::File;
use std::path::Path;
use tracktwin_parameters::quantity::{PASSES, PLACE, SAMPLE_RATE, SLEEPERS, SPEED};
use tracktwin_parameters::{DesignNumber, Quantity};

/// Bytes of text, and of unpacked numbers, that a pass's file has at most.
const BYTES_MAX: u64 = 3_000_000_000;

/// A number of `nominal`: part, name, key in a track file, what it is, usual values.
type Nominal = (Option<&'static str>, &'static str, &'static str, &'static str, [f64; 2]);

/// Numbers that `nominal` may state.
const NOMINAL: [Nominal; 20] = [
    (RAIL, "area_m2", "track.rail.area_m2", "area of a rail", [5e-4, 1e-2]),
    (
        RAIL,
        "second_moment_m4",
        "track.rail.second_moment_m4",
        "second moment of a rail",
        [1e-7, 1e-4],
    ),
    (RAIL, "youngs_Pa", "track.rail.youngs_Pa", "Young's modulus of a rail", [1.9e11, 2.2e11]),
    (RAIL, "density_kg_m3", "track.rail.density_kg_m3", "density of a rail", [7000.0, 8000.0]),
    (RAIL, "poisson", "track.rail.poisson", "Poisson's ratio", [0.25, 0.35]),
    (RAIL, "shear_coefficient", "track.rail.shear_coefficient", "shear coefficient", [0.3, 0.9]),
    (None, "rail_damping_s", "track.rail.damping_s", "damping of the rail", [0.0, 1e-5]),
    (None, "railhead_radius_m", "track.railhead_radius_m", "radius of the railhead", [0.05, 0.5]),
    (SLEEPER, "spacing_m", "track.sleeper.spacing_m", "sleeper spacing", [0.1, 0.8]),
    (
        SLEEPER,
        "half_length_m",
        "track.sleeper.half_length_m",
        "half length of a sleeper",
        [0.2, 1.4],
    ),
    (SLEEPER, "rail_seat_m", "track.sleeper.rail_seat_m", "place of the rail seat", [0.0, 0.8]),
    (SLEEPER, "area_m2", "track.sleeper.area_m2", "area of a sleeper", [5e-4, 0.08]),
    (
        SLEEPER,
        "second_moment_m4",
        "track.sleeper.second_moment_m4",
        "second moment of a sleeper",
        [1e-8, 5e-4],
    ),
    (
        SLEEPER,
        "youngs_Pa",
        "track.sleeper.youngs_Pa",
        "Young's modulus of a sleeper",
        [1e10, 2.2e11],
    ),
    (
        SLEEPER,
        "density_kg_m3",
        "track.sleeper.density_kg_m3",
        "density of a sleeper",
        [700.0, 8000.0],
    ),
    (SLEEPER, "poisson", "track.sleeper.poisson", "Poisson's ratio", [0.15, 0.45]),
    (
        SLEEPER,
        "shear_coefficient",
        "track.sleeper.shear_coefficient",
        "shear coefficient",
        [0.3, 0.9],
    ),
    (WHEEL, "mass_kg", "vehicle.mass_kg", "mass of a wheel", [10.0, 2000.0]),
    (WHEEL, "load_N", "vehicle.load_N", "wheel load", [500.0, 2e5]),
    (WHEEL, "radius_m", "vehicle.radius_m", "radius of a wheel", [0.05, 0.6]),
];

/// Distance of the two wheels of a bogie.
const WHEELBASE_M: Quantity = Quantity::new("wheelbase of a bogie", "m", [0.05, 30.0], [0.2, 3.5]);

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
    for (part, name, of) in nominal_quantities() {
        if let Some(value) = stated(&manifest.nominal, part, name) {
            check(&path_of(part, name), of, value)?;
        }
    }
    if let Some(value) = stated(&manifest.nominal, WHEEL, WHEELBASE) {
        // Its sign has no meaning.
        check(&path_of(WHEEL, WHEELBASE), WHEELBASE_M, value.abs())?;
    }
    Ok(())
}

/// Part, name and limits of the numbers of `nominal` that a track file has as well, with the same range.
fn nominal_quantities() -> impl Iterator<Item = (Option<&'static str>, &'static str, Quantity)> {
    NOMINAL.into_iter().filter_map(|(part, name, key, what, usual)| {
        let number = DesignNumber::named(key)?;
        Some((part, name, Quantity::new(what, number.unit(), number.range(), usual)))
    })
}

fn path_of(part: Option<&str>, name: &str) -> String {
    part.map_or(format!("nominal.{name}"), |part| format!("nominal.{part}.{name}"))
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
            return refused(path_of(part, name), value, "a number");
        }
    }
    Ok(())
}

fn stated(nominal: &Map<String, Value>, part: Option<&str>, name: &str) -> Option<f64> {
    let fields = part.map_or(Some(nominal), |part| nominal.get(part)?.as_object())?;
    fields.get(name)?.as_f64()
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
    fn every_number_of_nominal_has_limits() {
        let limited: Vec<_> = nominal_quantities().map(|(part, name, _)| (part, name)).collect();
        assert_eq!(limited.len(), NOMINAL.len(), "a key is not that of a track file");
        for number in numbers() {
            assert!(number == (WHEEL, WHEELBASE) || limited.contains(&number), "{number:?}");
        }
        // Kilonewtons.
        let load = nominal_quantities().find(|it| it.1 == "load_N").unwrap().2;
        let error = load.check(60.0).unwrap_err().to_string();
        assert!(error.contains("did you mean 60000?"), "{error}");
    }

    #[test]
    fn what_is_usual_of_a_nominal_value_can_be() {
        for (part, name, of) in nominal_quantities() {
            let ends = of.usual.iter().chain(&of.range);
            assert!(ends.copied().all(|value| of.check(value).is_ok()), "{part:?}.{name}");
        }
    }
}
