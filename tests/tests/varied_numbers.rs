//! Campaigns that vary numbers of the description, from the command line.

use std::collections::HashSet;
use std::fs;
use system_tests::run;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Campaign with a coarse, short model.
const CAMPAIGN: &str = "name = \"varied\"\nseed = 5\ncases = 4\nspeeds_km_h = [7, 13]\n\
    [simulation]\nspans = 22\nrail_elements_per_span = 2\nsleeper_elements = 2\n\
    [parameters]\nvehicle.mass_kg = [40, 48]\ntrack.sleeper.spacing_m = [0.12, 0.13]\n";

/// The drawn numbers of each case.
const DRAWN: &str = "select cast(drawn ->> 'vehicle.mass_kg' as double precision),
        cast(drawn ->> 'track.sleeper.spacing_m' as double precision)
    from result_with_parameters where speed_km_h = 13 order by sobol_index";

#[test]
fn what_was_drawn_for_each_case_is_in_the_library_and_survives_export_and_copy() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let [campaign, out, tables] = ["varied.toml", "out", "tables"].map(path);
    let [original, imported, copied] = ["a", "b", "c"].map(|name| format!("sqlite:{}", path(name)));
    fs::write(&campaign, CAMPAIGN).unwrap();
    let tell = |arguments: &[&str]| run(PROGRAM, arguments).succeeded();
    tell(&["run", &campaign, "--no-train", "--out", &out, "--library", &original]);
    tell(&["library", "export", "--out", &tables, "--library", &original]);
    tell(&["library", "import", &tables, "--library", &imported]);
    tell(&["library", "copy", "--from", &original, "--to", &copied]);
    let drawn =
        |library: &str| tell(&["library", "sql", DRAWN, "--library", library, "--format", "csv"]);
    let expected = drawn(&original);
    let rows: HashSet<&str> = expected.lines().skip(1).collect();
    assert_eq!(rows.len(), 4, "{expected}");
    for row in rows {
        let numbers: Vec<f64> = row.split(',').map(|number| number.parse().unwrap()).collect();
        assert!((40.0..=48.0).contains(&numbers[0]), "{row}");
        assert!((0.12..=0.13).contains(&numbers[1]), "{row}");
    }
    for other in [&imported, &copied] {
        assert_eq!(drawn(other), expected);
        tell(&["library", "verify", "--library", other]);
    }
}
