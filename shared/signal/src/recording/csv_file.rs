//! Reads columns of numbers from CSV files with a header line, independent of their meaning.

use super::error::{Fault, RecordingError};
use std::path::Path;

/// Reads the named columns and ignores other columns.
pub(super) fn read<const N: usize>(
    path: &Path,
    names: &[&str; N],
) -> Result<[Vec<f64>; N], RecordingError> {
    let unreadable = |error: csv::Error| {
        RecordingError::new(path, "file", Fault::Unreadable { reason: error.to_string() })
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(unreadable)?;
    let present: Vec<String> =
        reader.headers().map_err(unreadable)?.iter().map(str::to_owned).collect();
    if let [only] = present.as_slice()
        && only.contains([';', '\t'])
    {
        return Err(RecordingError::new(path, "file", Fault::Separator));
    }
    let mut places = [0; N];
    for (place, name) in places.iter_mut().zip(names) {
        let fault = |fault| RecordingError::new(path, *name, fault);
        let found: Vec<usize> =
            (0..present.len()).filter(|&index| present[index] == *name).collect();
        *place = match found[..] {
            [index] => index,
            [] => return Err(fault(Fault::NoColumn { present, header: None })),
            _ => {
                let places = found.iter().map(|index| index + 1).collect();
                return Err(fault(Fault::ColumnTwice { places }));
            }
        };
    }
    let mut columns = [const { Vec::new() }; N];
    let mut record = csv::StringRecord::new();
    let mut row = 0;
    while reader.read_record(&mut record).map_err(unreadable)? {
        row += 1;
        for ((column, place), name) in columns.iter_mut().zip(places).zip(names) {
            let text = &record[place];
            let value = text.parse().map_err(|_| {
                let fault = Fault::NotFinite { row, value: format!("\"{text}\"") };
                RecordingError::new(path, *name, fault)
            })?;
            column.push(value);
        }
    }
    Ok(columns)
}
