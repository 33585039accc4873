//! Tables of every kind with the same content, and layouts that don't suffice.

use super::super::Recording;
use super::{AccelerationUnit, Layout, PositionUnit, Table, import};
use npyz::WriterBuilder;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

const RATE_HZ: f64 = 2000.0;
const ROWS: usize = 400;

fn value(row: usize) -> f64 {
    // Exact in single precision and in few digits.
    f64::from((row % 17) as u8) * 0.25 - 2.0
}

fn layout() -> Layout {
    Layout {
        acceleration: vec!["acc".to_owned()],
        sample_rate_hz: Some(RATE_HZ),
        speed_km_h: Some(36.0),
        ..Layout::default()
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn csv(folder: &Path, head: &str, separator: &str, comma: bool) -> PathBuf {
    let path = folder.join("pass.csv");
    let number = |value: f64| {
        let text = value.to_string();
        if comma { text.replace('.', ",") } else { text }
    };
    let row = |row: usize| [number(row as f64 / RATE_HZ), number(value(row))].join(separator);
    let rows: Vec<String> = (0..ROWS).map(row).collect();
    fs::write(&path, format!("{head}{}\n", rows.join("\n"))).unwrap();
    path
}

fn npy(shape: &[u64], values: &[f64]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .shape(shape)
        .writer(&mut bytes)
        .begin_nd()
        .unwrap();
    writer.extend(values.iter()).unwrap();
    writer.finish().unwrap();
    bytes
}

/// A MATLAB file of version 5 with one matrix of doubles, stored column by column.
fn mat(name: &str, rows: u32, columns: u32, values: &[f64]) -> Vec<u8> {
    let element = |kind: u32, data: &[u8]| {
        let mut bytes = kind.to_le_bytes().to_vec();
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let doubles: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let size: Vec<u8> = [rows, columns].iter().flat_map(|size| size.to_le_bytes()).collect();
    // Class 6 is a matrix of doubles; then sizes (int32), name (int8), values (double).
    let matrix = [
        element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
        element(5, &size),
        element(1, name.as_bytes()),
        element(9, &doubles),
    ];
    let mut bytes = vec![b' '; 116];
    bytes[..6].copy_from_slice(b"MATLAB");
    bytes.extend([0; 8]);
    bytes.extend(0x0100u16.to_le_bytes());
    bytes.extend(b"IM");
    bytes.extend(element(14, &matrix.concat()));
    bytes
}

fn samples(path: &Path, layout: &Layout) -> Vec<f64> {
    let imported = import(&[path.to_owned()], layout).unwrap();
    imported[0].recording.passes[0].signal.samples().to_vec()
}

fn expected() -> Vec<f64> {
    let mean = (0..ROWS).map(value).sum::<f64>() / ROWS as f64;
    (0..ROWS).map(|row| value(row) - mean).collect()
}

fn complaint(path: &Path, layout: &Layout) -> String {
    let text = import(&[path.to_owned()], layout).unwrap_err().to_string();
    assert!(!text.contains('\n'), "one line: {text}");
    text.replace(&format!("{}/", path.parent().unwrap().display()), "")
}

#[test]
fn text_tables_read_alike_whatever_separates_their_fields() {
    let folder = folder();
    for (head, separator, comma) in [
        ("t,acc\n", ",", false),
        ("# from a logger\nt;acc\n", ";", true),
        ("t\tacc\n", "\t", false),
    ] {
        let path = csv(folder.path(), head, separator, comma);
        assert_eq!(samples(&path, &layout()), expected(), "{separator:?}");
    }
    for blanks in [" ", "    "] {
        let path = csv(folder.path(), "", blanks, false);
        let unnamed = Layout { acceleration: vec!["column-2".to_owned()], ..layout() };
        assert_eq!(samples(&path, &unnamed), expected());
    }
    // Columns that are aligned by blanks.
    let path = csv(folder.path(), "t      acc\n", "   ", false);
    assert_eq!(samples(&path, &layout()), expected());
}

#[test]
fn numpy_arrays_matrices_and_archives_are_read() {
    let folder = folder();
    let values: Vec<f64> = (0..ROWS).map(value).collect();
    let path = folder.path().join("pass.npy");
    let single = Layout { acceleration: vec!["column".to_owned()], ..layout() };
    fs::write(&path, npy(&[ROWS as u64], &values)).unwrap();
    assert_eq!(samples(&path, &single), expected());
    // Two rows: times and accelerations, lying on their side.
    let both: Vec<f64> = (0..ROWS).map(|row| row as f64).chain(values.clone()).collect();
    fs::write(&path, npy(&[2, ROWS as u64], &both)).unwrap();
    let second = Layout { acceleration: vec!["column-2".to_owned()], ..layout() };
    assert_eq!(samples(&path, &second), expected());
    let path = folder.path().join("pass.npz");
    let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    archive.start_file("acc.npy", zip::write::SimpleFileOptions::default()).unwrap();
    archive.write_all(&npy(&[ROWS as u64], &values)).unwrap();
    archive.start_file("x.npy", zip::write::SimpleFileOptions::default()).unwrap();
    archive.write_all(&npy(&[4], &[0.0, 0.5, 1.0, 1.5])).unwrap();
    archive.finish().unwrap();
    assert_eq!(samples(&path, &layout()), expected());
    let text = complaint(&path, &Layout { position: Some("x".to_owned()), ..layout() });
    assert!(text.starts_with("pass.npz: position: has 4 rows, but the other columns"), "{text}");
    assert!(text.contains("numpy.interp"), "{text}");
}

#[test]
fn matlab_matrices_are_read() {
    let folder = folder();
    let path = folder.path().join("pass.mat");
    let values: Vec<f64> = (0..ROWS).map(value).collect();
    fs::write(&path, mat("acc", ROWS as u32, 1, &values)).unwrap();
    assert_eq!(samples(&path, &layout()), expected());
    let both: Vec<f64> = (0..ROWS).map(|row| row as f64).chain(values).collect();
    fs::write(&path, mat("acc", ROWS as u32, 2, &both)).unwrap();
    let second = Layout { acceleration: vec!["acc-2".to_owned()], ..layout() };
    assert_eq!(samples(&path, &second), expected());
}

#[test]
fn a_recordings_own_parquet_pass_is_a_table_too() {
    let folder = folder();
    let path = csv(folder.path(), "t,acc\n", ",", false);
    let imported = import(&[path], &layout()).unwrap().remove(0);
    imported.recording.write(folder.path()).unwrap();
    let table = Table::read(&folder.path().join("pass-36kmh-1.parquet")).unwrap();
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["time_s", "position_m", "acceleration_m_s2"]);
}

#[test]
fn an_imported_recording_opens_again() {
    let folder = folder();
    let path = csv(folder.path(), "t,acc\n", ",", false);
    let out = folder.path().join("recording");
    let with_sleepers = Layout { sleeper_m: Some(0.3), ..layout() };
    for (layout, sleepers) in [(layout(), 0), (with_sleepers, 3)] {
        import(std::slice::from_ref(&path), &layout).unwrap()[0].recording.write(&out).unwrap();
        let recording = Recording::open(&out).unwrap();
        // Two metres at 36 km/h: sleepers at 0.3, 0.9 and 1.5 m.
        assert_eq!(recording.sleepers.len(), sleepers);
        assert_eq!(recording.sample_rate_hz, RATE_HZ);
        assert_eq!(recording.spacing_m, 0.6);
    }
}

#[test]
fn doubts_and_corrections_are_kept_in_the_recording_and_read_back() {
    let folder = folder();
    let path = csv(folder.path(), "t,acc [g]\n", ",", false);
    let told = Some(AccelerationUnit::MetrePerSecondSquared);
    let doubted = Layout { acceleration_unit: told, ..layout() };
    let [once, twice] = ["once", "twice"].map(|name| folder.path().join(name));
    import(std::slice::from_ref(&path), &doubted).unwrap()[0].recording.write(&once).unwrap();
    let recording = Recording::open(&once).unwrap();
    let [spacing, unit] = &recording.doubts[..] else { panic!("{:?}", recording.doubts) };
    assert_eq!(spacing, "a sleeper spacing of 0.6 m is assumed; state it with --spacing");
    assert!(unit.starts_with("doubt: pass.csv: acc [g] is read in m/s2"), "{unit}");
    // Read and written again, nothing is said twice.
    recording.write(&twice).unwrap();
    assert_eq!(Recording::open(&twice).unwrap().doubts, recording.doubts);
}

#[test]
fn units_signs_and_places_come_out_in_si() {
    let folder = folder();
    let path = csv(folder.path(), "t,acc\n", ",", false);
    let g = Layout { acceleration_unit: Some(AccelerationUnit::G), upwards: true, ..layout() };
    let (found, expected) = (samples(&path, &g), expected());
    assert!(found.iter().zip(&expected).all(|(a, b)| (a + 9.80665 * b).abs() < 1e-12));
    let places_in = |unit| Layout {
        position: Some("t".to_owned()),
        position_unit: Some(unit),
        spacing_m: Some(0.05),
        ..layout()
    };
    // 10 m/s in millimetres.
    let millimetres = folder.path().join("millimetres.csv");
    let row = |row: usize| format!("{},{}\n", 1e4 * row as f64 / RATE_HZ, value(row));
    let rows: String = (0..ROWS).map(row).collect();
    std::fs::write(&millimetres, format!("t,acc\n{rows}")).unwrap();
    let layout = Layout { speed_km_h: None, ..places_in(PositionUnit::Millimetre) };
    let recording = import(&[millimetres], &layout).unwrap().remove(0).recording;
    let places = &recording.passes[0].position_m;
    assert!((places[ROWS - 1] - 10.0 * (ROWS - 1) as f64 / RATE_HZ).abs() < 1e-9);
    assert!((recording.passes[0].speed_km_h - 36.0).abs() < 1e-9);
    // A column of times read as kilometres: 3600 km/h.
    let text = complaint(&path, &places_in(PositionUnit::Kilometre));
    assert!(text.contains("advances at 3600 km/h in km, which no pass does; in m it is"), "{text}");
}

#[test]
fn the_sample_rate_comes_from_the_times_where_it_is_not_stated() {
    let folder = folder();
    let path = csv(folder.path(), "t,acc\n", ",", false);
    let timed = Layout { sample_rate_hz: None, time: Some("t".to_owned()), ..layout() };
    assert_eq!(import(&[path], &timed).unwrap()[0].recording.sample_rate_hz, RATE_HZ);
}

#[test]
fn a_layout_that_does_not_suffice_says_what_is_missing() {
    let folder = folder();
    let path = csv(folder.path(), "t,acc\n", ",", false);
    let text = complaint(&path, &Layout { acceleration: Vec::new(), ..layout() });
    assert_eq!(
        text,
        "pass.csv: acceleration: is missing; state it with `--column acceleration=NAME` (the columns of the file are t, acc)"
    );
    let text = complaint(&path, &Layout { sample_rate_hz: None, ..layout() });
    assert_eq!(
        text,
        "pass.csv: sample_rate_Hz: is missing; state `--sample-rate HZ` or `--column time=NAME`"
    );
    let text = complaint(&path, &Layout { speed_km_h: None, ..layout() });
    assert!(text.starts_with("pass.csv: speed_km_h: is missing; state `--speed KMH`, "), "{text}");
    let text = complaint(&path, &Layout { acceleration: vec!["left".to_owned()], ..layout() });
    assert!(
        text.contains("the column is missing; rename one of the file's columns: t, acc"),
        "{text}"
    );
}

#[test]
fn what_is_no_number_is_named_by_its_row() {
    let folder = folder();
    let path = folder.path().join("pass.csv");
    fs::write(&path, "t,acc,remark\n0,1,start\n1,n/a,\n2,3,end\n").unwrap();
    let text = complaint(&path, &layout());
    assert!(text.starts_with("pass.csv: acc: row 2 is \"n/a\"; leave that row out"), "{text}");
    fs::write(folder.path().join("pass.odd"), "").unwrap();
    let text = complaint(&folder.path().join("pass.odd"), &layout());
    assert!(text.starts_with("pass.odd: file: the extension is not one of .csv"), "{text}");
    fs::write(folder.path().join("pass.mat"), "MATLAB 7.3 ...").unwrap();
    let text = complaint(&folder.path().join("pass.mat"), &layout());
    assert!(text.contains("-v7"), "{text}");
}
