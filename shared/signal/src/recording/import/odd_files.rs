//! Files as programs and loggers write them, each with what would be read wrongly without a word.

use super::super::Recording;
use super::{AccelerationUnit, Imported, Layout, PositionUnit, import};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const RATE_HZ: f64 = 2000.0;
const ROWS: usize = 20_000;
const SPEED_M_S: f64 = 67.4 / 3.6;

/// An acceleration in m/s2 that never repeats.
fn acceleration(row: usize) -> f64 {
    let x = row as f64;
    8.0 * (0.3 * x + 1e-5 * x * x).sin() + 3.0 * (1.7 * x).cos()
}

fn time(row: usize) -> f64 {
    row as f64 / RATE_HZ
}

fn place(row: usize) -> f64 {
    1000.0 + SPEED_M_S * time(row)
}

fn layout() -> Layout {
    Layout {
        acceleration: vec!["acc".to_owned()],
        time: Some("t".to_owned()),
        position: Some("x".to_owned()),
        ..Layout::default()
    }
}

/// A table with these names before it and these fields a row.
fn table(folder: &Path, head: &str, row: impl Fn(usize) -> String) -> PathBuf {
    let mut text = head.to_owned();
    for index in 0..ROWS {
        writeln!(text, "{}", row(index)).unwrap();
    }
    let path = folder.join("run.csv");
    fs::write(&path, text).unwrap();
    path
}

/// `t,x,acc` with what `change` makes of a row's three values.
fn changed(folder: &Path, change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> PathBuf {
    table(folder, "t,x,acc\n", |row| {
        let [t, x, acc] = change(row, [time(row), place(row), acceleration(row)]);
        format!("{t},{x},{acc}")
    })
}

fn one(path: &Path, layout: &Layout) -> Result<Imported, String> {
    let imported = import(&[path.to_owned()], layout);
    let short = |text: String| text.replace(&format!("{}/", path.parent().unwrap().display()), "");
    imported.map(|mut all| all.remove(0)).map_err(|error| short(error.to_string()))
}

fn complaint(path: &Path, layout: &Layout) -> String {
    let text = one(path, layout).unwrap_err();
    assert!(!text.contains('\n'), "one line: {text}");
    text
}

/// Imported with the right rate, speed and samples; the notes, joined.
fn sound(path: &Path, layout: &Layout) -> String {
    let Imported { recording, notes, .. } = one(path, layout).unwrap();
    let pass = &recording.passes[0];
    assert_eq!(recording.sample_rate_hz, RATE_HZ);
    assert!((pass.speed_km_h / 67.4 - 1.0).abs() < 2e-3, "{} km/h", pass.speed_km_h);
    let mean = (0..ROWS).map(acceleration).sum::<f64>() / ROWS as f64;
    for (row, sample) in pass.signal.samples().iter().enumerate() {
        assert!((sample - acceleration(row) + mean).abs() < 1e-6, "row {row}: {sample}");
    }
    notes.join("\n")
}

#[test]
fn row_names_before_the_columns_are_seen_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let row = |row: usize| format!("{} {} {}", time(row), place(row), acceleration(row));
    // R's write.table, and pandas' to_csv with a blank or a comma.
    for (head, first) in [("\"t\" \"x\" \"acc\"\n", 1), ("t x acc\n", 0), (" t x acc\n", 0)] {
        let quote = if head.starts_with('"') { "\"" } else { "" };
        let named = |index: usize| format!("{quote}{}{quote} {}", index + first, row(index));
        let notes = sound(&table(folder.path(), head, named), &layout());
        assert!(notes.contains("taken as its name"), "{notes}");
    }
    let commas = |index: usize| format!("{index},{}", row(index).replace(' ', ","));
    let notes = sound(&table(folder.path(), "t,x,acc\n", commas), &layout());
    assert!(notes.contains("taken as its name"), "{notes}");
    // An index that counts nothing may be a column without a name.
    let other = |index: usize| format!("{},{}", 0.5 * index as f64, row(index).replace(' ', ","));
    let text = complaint(&table(folder.path(), "t,x,acc\n", other), &layout());
    assert!(text.contains("3 names, but the rows have 4 fields"), "{text}");
}

#[test]
fn rows_of_another_length_are_named_by_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let fields = |row: usize| [time(row), place(row), acceleration(row)].map(|v| v.to_string());
    for (separator, head) in [(",", "t,x,acc\n"), (" ", "t x acc\n")] {
        let short = |row: usize| fields(row)[usize::from(row == 40)..].join(separator);
        let text = complaint(&table(folder.path(), head, short), &layout());
        assert!(text.contains("line 42 has 2 fields where 3 belong"), "{text}");
    }
    let trailing = |row: usize| fields(row).join(",") + ",";
    sound(&table(folder.path(), "t,x,acc\n", trailing), &layout());
    sound(&table(folder.path(), "t,x,acc,\n", trailing), &layout());
}

#[test]
fn units_stand_in_names_or_in_a_line_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let row = |row: usize| {
        let g = acceleration(row) / 9.806_65;
        format!("{};{};{g}", 1e3 * time(row), 1e-3 * place(row)).replace('.', ",")
    };
    for head in [
        "t [ms];x [km];acc [g]\n",
        "t (ms);x (km);acc (g)\n",
        "t;x;acc\nms;km;g\n",
        "sep=;\nt;x;acc\n[ms];[km];(g)\n",
    ] {
        let notes = sound(&table(folder.path(), head, row), &layout());
        assert!(notes.contains("is read in g"), "{notes}");
    }
    let text = complaint(&table(folder.path(), "t;x;acc [mV]\n", row), &layout());
    assert!(text.contains("\"mV\", but must be one of"), "{text}");
    let told = Layout { acceleration_unit: Some(AccelerationUnit::Unknown), ..layout() };
    let notes = one(&table(folder.path(), "t [ms];x [km];acc [mV]\n", row), &told).unwrap().notes;
    assert!(notes.iter().all(|note| !note.starts_with("doubt")), "{notes:?}");
}

#[test]
fn a_title_before_the_header_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let row = |row: usize| {
        format!("{};{};{}", time(row), place(row), acceleration(row)).replace('.', ",")
    };
    for title in ["Run 4711 of 3.5.2026", "Run seven", "Seven", "Run;;", "Run;seven"] {
        let path = table(folder.path(), &format!("{title}\nt;x;acc\ns;m;m/s2\n"), row);
        let text = complaint(&path, &layout());
        let said = "(line 1 was taken as the header: delete a title, or begin it with #)";
        assert!(text.ends_with(said), "{title}: {text}");
    }
    sound(&table(folder.path(), "# Seven\nt;x;acc\ns;m;m/s2\n", row), &layout());
    sound(&table(folder.path(), "SEP=;\r\nt;x;acc\r\n", row), &layout());
}

#[test]
fn units_that_give_no_speed_or_rate_of_a_train_are_refused_with_those_that_do() {
    let folder = tempfile::tempdir().unwrap();
    for (factor, unit) in [(1e-3, "km"), (1e3, "mm")] {
        let path = changed(folder.path(), |_, [t, x, acc]| [t, factor * x, acc]);
        let text = complaint(&path, &layout());
        assert!(
            text.contains(&format!("in {unit} it is 67.4 km/h: use --position-unit")),
            "{text}"
        );
        let position_unit = match unit {
            "km" => PositionUnit::Kilometre,
            _ => PositionUnit::Millimetre,
        };
        sound(&path, &Layout { position_unit: Some(position_unit), ..layout() });
    }
    let path = changed(folder.path(), |_, [t, x, acc]| [1e9 * t, x, acc]);
    let text = complaint(&path, &layout());
    assert!(text.contains("in ns it is 2000 Hz: use --time-unit"), "{text}");
}

#[test]
fn two_statements_of_one_thing_must_agree() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |_, values| values);
    let rate = Layout { sample_rate_hz: Some(10_000.0), ..layout() };
    let text = complaint(&path, &rate);
    assert!(text.contains("is 10000 Hz, but column t advances at 2000 Hz"), "{text}");
    sound(&path, &Layout { sample_rate_hz: Some(2000.0), ..layout() });
    // Where the column was not named as times, it is only said.
    let unnamed = Layout { time: None, position: None, speed_km_h: Some(67.4), ..rate };
    let notes = one(&path, &unnamed).unwrap().notes.join("\n");
    assert!(notes.contains("doubt: run.csv: column t advances at 2000 Hz"), "{notes}");
    let text = complaint(&path, &Layout { speed_km_h: Some(80.0), ..layout() });
    assert!(text.contains("67.4 km/h in m, but the stated speed is 80 km/h"), "{text}");
    let path = table(folder.path(), "t,x,v,acc\n", |row| {
        format!("{},{},18.7,{}", time(row), place(row), acceleration(row))
    });
    let text = complaint(&path, &Layout { speed: Some("v".to_owned()), ..layout() });
    assert!(text.contains("the speed column is 18.7 km/h"), "{text}");
}

#[test]
fn positions_in_steps_give_the_right_speed_and_no_sleepers() {
    let folder = tempfile::tempdir().unwrap();
    let rounded = |step: f64| move |_, [t, x, acc]: [f64; 3]| [t, (x / step).round() * step, acc];
    let held = |row: usize, [t, _, acc]: [f64; 3]| [t, place(row / 2000 * 2000), acc];
    for path in [changed(folder.path(), rounded(1.0)), changed(folder.path(), held)] {
        let notes = sound(&path, &layout());
        assert!(notes.contains("the positions advance in steps of"), "{notes}");
        let text = complaint(&path, &Layout { sleeper_m: Some(1000.0), ..layout() });
        assert!(text.contains("steps above 0.15 m cannot separate sleepers"), "{text}");
    }
    let path = changed(folder.path(), rounded(0.05));
    sound(&path, &Layout { sleeper_m: Some(1000.0), ..layout() });
}

#[test]
fn a_pass_towards_smaller_positions_is_turned_and_both_ways_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |_, [t, x, acc]| [t, 2000.0 - x, acc]);
    let layout = Layout { sleeper_m: Some(900.0), ..layout() };
    assert!(sound(&path, &layout).contains("the opposite sign"));
    let recording = one(&path, &layout).unwrap().recording;
    assert!(recording.sleepers.iter().any(|sleeper| (sleeper.x_m + 900.0).abs() < 1e-9));
    let other = folder.path().join("other.csv");
    fs::rename(&path, &other).unwrap();
    let path = changed(folder.path(), |row, [t, x, _]| [t, x, acceleration(row + 7).powi(3)]);
    let text = import(&[other, path], &layout).unwrap_err().to_string();
    assert!(text.contains("import each direction separately"), "{text}");
}

#[test]
fn a_stated_sleeper_far_from_the_passes_is_refused_with_their_range() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |_, values| values);
    let stated = |sleeper_m| Layout { sleeper_m: Some(sleeper_m), ..layout() };
    let text = complaint(&path, &stated(1.0501));
    let range = "the passes cover 1000 to 1187.2128";
    assert!(text.starts_with(&format!("run.csv: sleeper_m: is 1.0501 m, but {range}")), "{text}");
    assert!(text.ends_with("inside them: 1050.1 m if it was in km"), "{text}");
    let text = complaint(&path, &stated(1_050_100.0));
    assert!(text.ends_with(": 1050.1 m if it was in mm, or in m with positions in km"), "{text}");
    assert!(complaint(&path, &stated(900.0)).ends_with("a sleeper inside them"));
    one(&path, &stated(995.0)).unwrap();
    // With the sign of the file.
    let path = changed(folder.path(), |_, [t, x, acc]| [t, 2000.0 - x, acc]);
    let text = complaint(&path, &stated(-900.0));
    assert!(text.contains("is -900 m, but the passes cover 812.787") && text.contains("to 1000 m"));
}

#[test]
fn a_counter_that_restarts_is_refused_at_its_row_with_the_signs_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    // Reset to zero; 16 bits that count centimetres; a counter down to zero.
    let reset = |row: usize, x: f64| if row < 12_000 { x } else { x - place(12_000) };
    let full = |_, x: f64| (100.0 * x - 42_000.0).rem_euclid(65_536.0) / 100.0;
    let down = |_, x: f64| (1100.0 - x).rem_euclid(655.36);
    for (counter, said) in [
        (&reset as &dyn Fn(usize, f64) -> f64, "restarts at row 12001, from 1112.323"),
        (&full, "restarts at row 8052, from 655.3"),
        (&down, "restarts at row 10684, from 0.00"),
    ] {
        let path = changed(folder.path(), |row, [t, x, acc]| [t, counter(row, x), acc]);
        let text = complaint(&path, &layout());
        assert!(text.contains(said) && !text.contains('-'), "{said}: {text}");
        assert!(text.ends_with("split the pass there into two files"), "{text}");
    }
    let path = changed(folder.path(), |row, [t, x, acc]| {
        [t, if row == 700 { 2000.01 - x } else { 2000.0 - x }, acc]
    });
    let text = complaint(&path, &layout());
    assert!(text.contains("increases from 993.4565") && text.contains("at row 701"), "{text}");
}

#[test]
fn coarse_clocks_are_straightened_and_gaps_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |_, [t, x, acc]| [(t * 100.0).floor() / 100.0, x, acc]);
    let notes = sound(&path, &layout());
    assert!(notes.contains("advances in steps of 10 ms"), "{notes}");
    let by = |seconds: f64| {
        changed(folder.path(), |row, [t, x, acc]| [if row < 500 { t } else { t + seconds }, x, acc])
    };
    let omit = "or state `--sample-rate HZ`";
    // The clock was set back, but no sample is missing.
    let text = complaint(&by(-0.1), &layout());
    assert!(text.contains("to row 501") && text.contains(omit), "{text}");
    let path = by(0.5);
    let text = complaint(&path, &layout());
    assert!(text.contains("to row 501") && !text.contains(omit), "{text}");
    let rate = Layout { sample_rate_hz: Some(RATE_HZ), time: None, ..layout() };
    let notes = one(&path, &rate).unwrap().notes.join("\n");
    assert!(notes.contains("column t has a gap before row 501"), "{notes}");
}

#[test]
fn copies_do_not_count_as_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |_, values| values);
    let copy = folder.path().join("copy.csv");
    fs::rename(&path, &copy).unwrap();
    for (factor, said) in [(1.0, "is a copy of copy.csv; "), (1.5, "copy.csv, times 1.500; ")] {
        let path = changed(folder.path(), |_, [t, x, acc]| [t, x, factor * acc]);
        let text = import(&[copy.clone(), path], &layout()).unwrap_err().to_string();
        assert!(text.contains(said), "{text}");
    }
    // In a folder it is left out and not refused: simulated passes without noise repeat to the bit.
    let [once, twice] = ["once", "twice"].map(|name| folder.path().join(name));
    let told = Layout { spacing_m: Some(0.6), ..layout() };
    let mut recording = one(&copy, &told).unwrap().recording;
    recording.write(&once).unwrap();
    recording.passes.extend([recording.passes[0].clone(), recording.passes[0].clone()]);
    recording.write(&twice).unwrap();
    let [once, twice] = [once, twice].map(|path| Recording::open(path).unwrap());
    assert_eq!(format!("{:?}", twice.passes), format!("{:?}", once.passes));
    let doubts = twice.doubts;
    let is_said =
        |doubt: &String| doubt.starts_with("left out: ") && doubt.contains("is a copy of pass-");
    assert!(doubts.len() == 2 && doubts.iter().all(is_said), "{doubts:?}");
}

#[test]
fn what_stands_for_a_number_or_for_another_column_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = table(folder.path(), "t,x,acc,acc\n", |row| {
        format!("{},{},1,{}", time(row), place(row), acceleration(row))
    });
    let text = complaint(&path, &layout());
    assert!(text.contains("columns 3 and 4 have this name"), "{text}");
    for missing in ["-9999", "NaN", "#N/A", ""] {
        let path = table(folder.path(), "t,x,acc\n", |row| {
            let acc = acceleration(row).to_string();
            let acc = if row == 76 { missing } else { &acc };
            format!("{},{},{acc}", time(row), place(row))
        });
        let text = complaint(&path, &layout());
        assert!(text.starts_with("run.csv: acc: row 77 is"), "{missing}: {text}");
    }
    for missing in ["NaN", ""] {
        let path = table(folder.path(), "t,x,acc\n", |row| {
            let x = if row % 200 == 0 { place(row).to_string() } else { missing.to_owned() };
            format!("{},{x},{}", time(row), acceleration(row))
        });
        let text = complaint(&path, &layout());
        assert!(text.starts_with("run.csv: x: 19900 of 20000 rows are empty"), "{text}");
        assert!(text.contains("numpy.interp), or import with --speed instead"), "{text}");
    }
    let path = table(folder.path(), "t,x,acc\n", |row| {
        format!("2024-05-01 12:00:{},{},{}", time(row), place(row), acceleration(row))
    });
    assert!(complaint(&path, &layout()).contains("t: holds texts such as \"2024-05-01"));
    for (text, said) in [("", "has 0 rows"), ("t,x,acc\n", "has 0 rows")] {
        fs::write(folder.path().join("run.csv"), text).unwrap();
        let complaint = complaint(&folder.path().join("run.csv"), &layout());
        assert!(complaint.contains(said), "{complaint}");
    }
}

#[test]
fn a_tachometers_pulses_are_no_speeds() {
    let folder = tempfile::tempdir().unwrap();
    let path = table(folder.path(), "t,tacho,acc\n", |row| {
        format!("{},{},{}", time(row), u8::from(row / 20 % 2 == 0), acceleration(row))
    });
    let text =
        complaint(&path, &Layout { position: None, speed: Some("tacho".into()), ..layout() });
    assert!(text.contains("tachometer pulses, not speeds"), "{text}");
}

#[test]
fn files_of_loggers_are_named_with_their_mend() {
    let folder = tempfile::tempdir().unwrap();
    for (name, begin, said) in [
        ("a.dat", &b"|CF,2,1,1;|CK,1,3"[..], "imc FAMOS"),
        ("a.uff", b"    -1\r\n    58\r\n", "pyuff"),
        ("a.txt", b"    -1\n    58\n", "pyuff"),
        ("a.bin", b"\x94\x13\x0c\x0c\0\0", "catman"),
        ("a.tdms", b"TDSm", "npTDMS"),
        ("a.mat", b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "'-v7'"),
        ("a.csv", b"\x1f\x8b\x08\0", "gunzip"),
        ("a.xlsx", b"PK\x03\x04", "save its sheet as CSV"),
        ("a.csv", b"PK\x03\x04", "an archive or a spreadsheet"),
        ("a.csv", b"t,acc\n0,\0\0\x03", "is not text (byte 9 is 0x00)"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, begin).unwrap();
        let text = complaint(&path, &layout());
        assert!(text.contains(said), "{name}: {text}");
    }
}

#[test]
fn two_clocks_of_one_recorder_have_one_rate_and_two_recorders_have_not() {
    let folder = tempfile::tempdir().unwrap();
    let passes = |clock: f64| {
        let pass = |name: &str, clock: f64, hertz: f64| {
            let sub = folder.path().join(name);
            fs::create_dir_all(&sub).unwrap();
            changed(&sub, |_, [t, x, acc]| [clock * t, x, acc + (hertz * t).sin()])
        };
        import(&[pass("a", 1.0, 700.0), pass("b", clock, 900.0)], &layout())
    };
    let both = passes(1.0 + 3e-5).unwrap().remove(0).recording;
    assert_eq!((both.passes.len(), both.sample_rate_hz), (2, RATE_HZ));
    let error = passes(1.002).unwrap_err().to_string();
    assert!(error.contains("run.csv is 2000 Hz") && error.contains("--sample-rate HZ"), "{error}");
}
