use super::*;
use std::fmt::Write as _;

/// A dataset 58 of accelerances at node 7: `(frequency, value)` even in steps of 100 Hz.
fn dataset_58(kind: i64, direction: i64, values: &[(f64, f64)]) -> String {
    let mut text = "    -1\n    58\n".to_owned();
    for remark in ["hammer test", "NONE", "26-Nov-25", "AVERAGES 5", "NONE"] {
        writeln!(text, "{remark}").unwrap();
    }
    writeln!(
        text,
        "{kind:5}{:10}{:5}{:10} {:10}{:10}{:4} {:10}{:10}{:4}",
        1, 0, 0, "NONE", 7, direction, "NONE", 7, 3
    )
    .unwrap();
    let ordinate = if kind == FREQUENCY_RESPONSE { 5 } else { 2 };
    writeln!(
        text,
        "{ordinate:10}{:10}{:10}  0.00000E+00  1.00000E+02  0.00000E+00",
        values.len(),
        1
    )
    .unwrap();
    for axis in [18, 12, 13, 0] {
        writeln!(text, "{axis:10}    0    0    0 NONE                 NONE").unwrap();
    }
    let number = |value: f64| {
        let text = format!("{value:.5E}");
        let (digits, exponent) = text.split_once('E').unwrap();
        let exponent: i32 = exponent.parse().unwrap();
        let sign = if exponent < 0 { '-' } else { '+' };
        format!("{:>13}", format!("{digits}E{sign}{:02}", exponent.abs()))
    };
    let cells: Vec<String> = values
        .iter()
        .flat_map(|&(re, im)| if ordinate == 5 { vec![re, im] } else { vec![re] })
        .map(number)
        .collect();
    for line in cells.chunks(6) {
        writeln!(text, "{}", line.concat()).unwrap();
    }
    text + "    -1\n"
}

const NODES: &str = "    -1\n    15\n         7         0         0         0  2.37500E+00  0.00000E+00  0.00000E+00\n    -1\n";

/// Accelerances `-w^2 (2e-8 - 1e-9 i)` at 0 to 400 Hz: at the ends of fields they touch.
fn accelerances() -> Vec<(f64, f64)> {
    let scale = |k: i32| -(TAU * 100.0 * f64::from(k)).powi(2);
    (0..5).map(|k| (2e-8 * scale(k), -1e-9 * scale(k))).collect()
}

fn file(direction: i64) -> String {
    let coherence = [(0.2, 0.0), (0.99, 0.0), (0.98, 0.0), (0.97, 0.0), (0.96, 0.0)];
    [
        NODES,
        &dataset_58(FREQUENCY_RESPONSE, direction, &accelerances()),
        &dataset_58(COHERENCE, 3, &coherence),
    ]
    .concat()
}

#[test]
fn an_accelerance_with_its_coherence_becomes_a_receptance() {
    let points = read(&file(3), &Nodes::new()).unwrap();
    let [point] = &points[..] else { panic!("{}", points.len()) };
    assert_eq!((point.position_m, point.hits), (2.375, Some(5)));
    assert_eq!(point.frequencies_hz, [100.0, 200.0, 300.0, 400.0]);
    assert_eq!(point.coherence.as_deref(), Some(&[0.99, 0.98, 0.97, 0.96][..]));
    for value in &point.values {
        assert!((value / Complex64::new(2e-8, -1e-9) - 1.0).norm() < 1e-4, "{value}");
    }
    // A sensor that points upwards says so.
    assert!(read(&file(-3), &Nodes::new()).unwrap()[0].is_turned());
}

#[test]
fn numbers_that_touch_are_read_by_their_columns() {
    let line = "-1.23456E-003-2.34567E-003";
    assert!((real(line, [0, 13], "value", 1).unwrap() + 1.23456e-3).abs() < 1e-12);
    assert!((real(line, [13, 26], "value", 1).unwrap() + 2.34567e-3).abs() < 1e-12);
}

#[test]
fn a_place_may_come_from_outside() {
    let without = file(3).replacen(NODES, "", 1);
    let refused = read(&without, &Nodes::new()).unwrap_err();
    assert!(refused.to_string().contains("--node 7=METRES"), "{refused}");
    let points = read(&without, &Nodes::from([(7, 1.5)])).unwrap();
    assert_eq!(points[0].position_m, 1.5);
}

#[test]
fn a_bad_file_is_refused_by_line() {
    let refused = |text: &str| read(text, &Nodes::new()).unwrap_err().to_string();
    let change = |from: &str, to: &str| {
        let text = file(3);
        assert!(text.contains(from), "{from}");
        refused(&text.replacen(from, to, 1))
    };
    for (from, to, words) in [
        ("    58\n", "    58b     1\n", "line 6: the dataset is binary"),
        ("        18    0", "        17    0", "line 14: the abscissa has data type 17"),
        ("        13    0", "         8    0", "line 16: the denominator has data type 8"),
        ("        12    0", "         1    0", "line 15: the numerator has data type 1"),
        ("    4         1", "    9         1", "line 12: function of type 9"),
        ("NONE               7   3\n", "NONE               8   3\n", "force at node 8"),
        (
            "         5         5         1",
            "         5        50         1",
            "the file ends within",
        ),
        ("-7.89568E-03", "-7.8x568E-03", "value: `-7.8x568E-03`"),
        (" 2.37500E+00", " 2.37500E+08", "line 3: 2.375e8 m is not a valid position"),
    ] {
        let message = change(from, to);
        assert!(message.contains(words), "{words}: {message}");
    }
    assert!(refused("    -1\n   164\n         2      inch\n    -1\n").contains("code 2"));
    assert!(refused("    -1\n    58\nx\n").contains("ends within dataset 58"));
    assert!(refused(NODES).contains("no receptance"));
}
