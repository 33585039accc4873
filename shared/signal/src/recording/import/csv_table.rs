//! Text tables: separated by comma, semicolon, tab or blanks, with or without a line of names.

use super::super::error::{Fault, RecordingError};
use super::table::Column;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Reads all columns; what is no number is noted once a column.
pub(super) fn read(path: &Path) -> Result<Vec<Column>, RecordingError> {
    let unreadable =
        |reason: String| RecordingError::new(path, "file", Fault::Unreadable { reason });
    let first = first_line(path).map_err(|error| unreadable(error.to_string()))?;
    let delimiter = delimiter(&first);
    // Blanks separate however many there are.
    let counts = |field: &&str| delimiter != b' ' || !field.is_empty();
    let begin: Vec<&str> = first.split(char::from(delimiter)).filter(counts).collect();
    let named = begin.iter().all(|field| number(field, delimiter).is_none());
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .flexible(delimiter == b' ')
        .has_headers(named)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|error| unreadable(error.to_string()))?;
    let mut columns: Vec<Column> = if named {
        let names = reader.headers().map_err(|error| unreadable(error.to_string()))?;
        // Some programs begin a file with a byte order mark.
        let name = |text: &str| text.trim_start_matches('\u{feff}').to_owned();
        names
            .iter()
            .filter(counts)
            .map(|text| Column { name: name(text), ..Column::default() })
            .collect()
    } else {
        let name = |index| format!("column-{}", index + 1);
        (0..begin.len()).map(|index| Column { name: name(index), ..Column::default() }).collect()
    };
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| unreadable(error.to_string()))? {
        for (column, text) in columns.iter_mut().zip(record.iter().filter(counts)) {
            let value = number(text, delimiter);
            if value.is_none() && column.oddity.is_none() {
                column.oddity = Some((column.values.len() + 1, text.to_owned()));
            }
            column.values.push(value.unwrap_or(f64::NAN));
        }
    }
    Ok(columns)
}

/// The first line that is neither empty nor a remark.
fn first_line(path: &Path) -> Result<String, std::io::Error> {
    for line in BufReader::new(File::open(path)?).lines() {
        let line = line?;
        let text = line.trim();
        if !text.is_empty() && !text.starts_with('#') {
            return Ok(text.to_owned());
        }
    }
    Ok(String::new())
}

/// What separates fields: a semicolon or tab where there is one, else a comma, else a blank.
fn delimiter(line: &str) -> u8 {
    [b';', b'\t', b','].into_iter().find(|&byte| line.as_bytes().contains(&byte)).unwrap_or(b' ')
}

/// A number; with a decimal comma where the comma separates nothing.
fn number(text: &str, delimiter: u8) -> Option<f64> {
    let text = text.trim();
    if delimiter == b',' { text.parse().ok() } else { text.replace(',', ".").parse().ok() }
}
