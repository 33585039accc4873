//! Cells as text.

use serde_json::Value;
use std::io::{self, Write};
use tracktwin_library::Cell;

/// A cell as text; a missing value is empty, a series is a JSON array.
pub(in crate::commands::library) fn cell(cell: &Cell) -> String {
    match cell {
        Cell::Null => String::new(),
        Cell::Boolean(truth) => truth.to_string(),
        Cell::Text(text) => text.clone(),
        Cell::Integer(integer) => integer.to_string(),
        Cell::Real(real) => number(*real),
        Cell::Doubles(doubles) => {
            let numbers: Vec<_> = doubles.iter().copied().map(number).collect();
            format!("[{}]", numbers.join(", "))
        }
    }
}

/// The shortest text that reads back to the same number.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-5..1e15).contains(&value.abs()) || !value.is_finite() {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// A cell as JSON; NaN and infinite values are null.
pub(in crate::commands::library) fn json(cell: Cell) -> Value {
    match cell {
        Cell::Null => Value::Null,
        Cell::Boolean(truth) => truth.into(),
        Cell::Text(text) => text.into(),
        Cell::Integer(integer) => integer.into(),
        Cell::Real(real) => real.into(),
        Cell::Doubles(doubles) => doubles.into(),
    }
}

/// Rows in aligned columns; the first row holds the headings. Numbers are right-aligned.
pub(in crate::commands::library) fn table(
    rows: &[Vec<String>],
    out: &mut impl Write,
) -> io::Result<()> {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| {
        rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default()
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let is_number = |column: usize| {
        rows[1..].iter().all(|row| row[column].is_empty() || row[column].parse::<f64>().is_ok())
    };
    let right: Vec<bool> = (0..columns).map(is_number).collect();
    for row in rows {
        let cells = row.iter().zip(&widths).zip(&right).map(|((cell, &width), right)| {
            if *right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
        });
        writeln!(out, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_as_they_were() {
        for value in [0.0, 7.0, 0.1, 1.2e8, 3e-9, f64::MAX, -1.0 / 3.0] {
            assert_eq!(number(value).parse::<f64>().unwrap(), value);
        }
        assert_eq!([number(7.0), number(1.5e-7)], ["7", "1.5e-7"]);
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [["name", "n"], ["ä", "7"], ["long", "12"]];
        let rows: Vec<Vec<String>> =
            rows.iter().map(|row| row.iter().map(ToString::to_string).collect()).collect();
        let mut out = Vec::new();
        table(&rows, &mut out).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "name   n\nä      7\nlong  12\n");
    }
}
