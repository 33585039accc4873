//! Binary files whose columns are no plain numbers: types with a unit, and kinds that are refused.

use super::{Layout, Table, import};
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as PhysicalType};
use parquet::data_type::{DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;

use parquet::schema::types::Type;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const RATE_HZ: i64 = 2000;
const ROWS: i64 = 4000;

fn acceleration() -> Vec<f64> {
    (0..ROWS).map(|row| (0.3 * row as f64 + 1e-5 * (row * row) as f64).sin()).collect()
}

/// Columns `t`, whole numbers of this type, and `acc`.
fn parquet(
    folder: &Path,
    kind: Option<LogicalType>,
    pandas: Option<&str>,
    time: impl Fn(i64) -> i64,
) -> PathBuf {
    let path = folder.join("run.parquet");
    let column = |name: &str, physical, logical| {
        let column = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(logical);
        Arc::new(column.build().unwrap())
    };
    let fields =
        vec![column("t", PhysicalType::INT64, kind), column("acc", PhysicalType::DOUBLE, None)];
    let schema = Type::group_type_builder("schema").with_fields(fields).build().unwrap();
    let entry = |text: &str| KeyValue::new("pandas".to_owned(), text.to_owned());
    let properties = WriterProperties::builder()
        .set_key_value_metadata(pandas.map(|text| vec![entry(text)]))
        .build();
    let file = File::create(&path).unwrap();
    let mut writer =
        SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let times: Vec<i64> = (0..ROWS).map(time).collect();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int64Type>().write_batch(&times, None, None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<DoubleType>().write_batch(&acceleration(), None, None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    path
}

fn layout() -> Layout {
    Layout {
        acceleration: vec!["acc".to_owned()],
        time: Some("t".to_owned()),
        speed_km_h: Some(67.0),
        ..Layout::default()
    }
}

fn complaint(path: &Path) -> String {
    import(&[path.to_owned()], &layout()).unwrap_err().to_string()
}

#[test]
fn timestamps_and_durations_are_seconds_whatever_they_count() {
    let folder = tempfile::tempdir().unwrap();
    // 2026, where nanoseconds have more digits than a double.
    let begin = 1_767_225_600;
    for (unit, per_second) in [(TimeUnit::MICROS, 1_000_000), (TimeUnit::NANOS, 1_000_000_000)] {
        let kind = LogicalType::timestamp(true, unit);
        let time = |row: i64| begin * per_second + row * per_second / RATE_HZ;
        let path = parquet(folder.path(), Some(kind), None, time);
        let imported = import(&[path], &layout()).unwrap();
        assert_eq!(imported[0].recording.sample_rate_hz, RATE_HZ as f64, "{per_second}");
    }
    // In whole milliseconds two samples share one.
    let kind = LogicalType::timestamp(true, TimeUnit::MILLIS);
    let path = parquet(folder.path(), Some(kind), None, |row| begin * 1000 + row * 1000 / RATE_HZ);
    let imported = import(&[path], &layout()).unwrap();
    assert_eq!(imported[0].recording.sample_rate_hz, RATE_HZ as f64);
    assert!(imported[0].notes.join("\n").contains("in steps of 1.0 ms"));
    let pandas =
        r#"{"columns": [{"name": "t", "field_name": "t", "numpy_type": "timedelta64[ns]"}]}"#;
    let nanoseconds = |row: i64| row * 1_000_000_000 / RATE_HZ;
    let path = parquet(folder.path(), None, Some(pandas), nanoseconds);
    assert_eq!(import(&[path], &layout()).unwrap()[0].recording.sample_rate_hz, RATE_HZ as f64);
    // Without a word in the file the rate gives it away.
    let path = parquet(folder.path(), None, None, nanoseconds);
    assert!(complaint(&path).contains("in ns it is 2000 Hz"));
}

/// A MATLAB file with one variable `acc` of this class and these flags, and its parts as doubles.
fn mat(folder: &Path, class: u8, flags: u8, parts: &[&[f64]]) -> PathBuf {
    let element = |kind: u32, data: &[u8]| {
        let mut bytes = kind.to_le_bytes().to_vec();
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let size: Vec<u8> = [ROWS as u32, 1].iter().flat_map(|size| size.to_le_bytes()).collect();
    let mut matrix = element(6, &[class, flags, 0, 0, 0, 0, 0, 0]);
    matrix.extend(element(5, &size));
    matrix.extend(element(1, b"acc"));
    for part in parts {
        let bytes: Vec<u8> = part.iter().flat_map(|value| value.to_le_bytes()).collect();
        matrix.extend(element(9, &bytes));
    }
    let mut bytes = vec![b' '; 116];
    bytes[..6].copy_from_slice(b"MATLAB");
    bytes.extend([0; 8]);
    bytes.extend(0x0100u16.to_le_bytes());
    bytes.extend(b"IM");
    bytes.extend(element(14, &matrix));
    let path = folder.join("run.mat");
    fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn arrays_of_matlab_that_are_no_real_numbers_say_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let values = acceleration();
    let kind = |class, flags, parts: &[&[f64]]| {
        let table = Table::read(&mat(folder.path(), class, flags, parts)).unwrap();
        table.column("acc").map(|column| column.values.len()).map_err(|error| error.to_string())
    };
    assert_eq!(kind(6, 0, &[&values]), Ok(ROWS as usize));
    for (class, flags, said) in [
        (6, 0x08, "complex numbers"),
        (2, 0, "a structure"),
        (1, 0, "a cell array"),
        (4, 0, "text"),
    ] {
        let parts: &[&[f64]] = if flags == 0 { &[] } else { &[&values, &values] };
        let text = kind(class, flags, parts).unwrap_err();
        assert!(text.contains(&format!("acc: holds {said}")), "{text}");
    }
}

/// A NumPy array `acc` of this kind.
fn npy(folder: &Path, kind: &str, bytes: &[u8]) -> PathBuf {
    let mut head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({ROWS},), }}");
    head += &" ".repeat((10 + head.len() + 1).next_multiple_of(64) - head.len() - 11);
    head.push('\n');
    let mut all = b"\x93NUMPY\x01\x00".to_vec();
    all.extend((head.len() as u16).to_le_bytes());
    all.extend(head.as_bytes());
    all.extend(bytes);
    let path = folder.join("run.npy");
    fs::write(&path, all).unwrap();
    path
}

#[test]
fn numpy_arrays_of_any_order_and_precision_are_read_and_others_say_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let values = acceleration();
    let be: Vec<u8> = values.iter().flat_map(|value| value.to_be_bytes()).collect();
    let table = Table::read(&npy(folder.path(), ">f8", &be)).unwrap();
    assert_eq!(table.column("column").unwrap().values, values);
    let half: Vec<u8> =
        values.iter().flat_map(|value| half::f16::from_f64(*value).to_le_bytes()).collect();
    let table = Table::read(&npy(folder.path(), "<f2", &half)).unwrap();
    let found = &table.column("column").unwrap().values;
    assert!(found.iter().zip(&values).all(|(a, b)| (a - b).abs() < 1e-3));
    for (kind, width, said) in [
        ("<c16", 16, "complex numbers"),
        ("|b1", 1, "Boolean values"),
        ("<U4", 16, "texts"),
        ("<m8[ns]", 8, "times in seconds"),
        ("|O", 8, "Python objects"),
    ] {
        let bytes = vec![0; width * ROWS as usize];
        let table = Table::read(&npy(folder.path(), kind, &bytes)).unwrap();
        let text = table.column("column").unwrap_err().to_string();
        assert!(text.contains(said), "{kind}: {text}");
    }
}

#[test]
fn an_array_whose_head_promises_more_than_its_file_holds_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npy");
    // The first overflows when it is multiplied, the second would take a terabyte.
    for shape in ["9223372036854775808, 2", "1000000000, 125"] {
        let head = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(u16::try_from(head.len()).unwrap().to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend([0; 64]);
        std::fs::write(&path, bytes).unwrap();
        let error = Table::read(&path).unwrap_err().to_string();
        assert!(error.contains("more numbers than the file holds"), "{error}");
    }
}
