//! Files of a hammer test, as text: tables of receptances, tables of signals, universal files.

mod error;
mod signals;
mod table;
mod universal;

pub use error::{ReadError, ReadFault};

use crate::PointReceptance;
use std::collections::BTreeMap;

/// Position in m of each node, for a universal file that contains no node positions.
pub type Nodes = BTreeMap<u64, f64>;

/// Reads the point receptances of a file. The content determines the format: a universal file begins with
/// `-1`; a table begins with the names of its columns, after comments.
///
/// # Errors
/// [`ReadError`] with the line and its fault.
pub fn read(text: &str, nodes: &Nodes) -> Result<Vec<PointReceptance>, ReadError> {
    // A mark of the byte order is no part of the text.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let says = |line: &&str| !line.is_empty() && !line.starts_with('#');
    let first = text.lines().map(str::trim).find(says).unwrap_or_default();
    if first == "-1" {
        // Fields stand in columns of one byte a letter.
        universal::read(&text.replace(|letter: char| !letter.is_ascii(), "?"), nodes)
    } else if first.split(',').any(|name| name.trim() == signals::TIME) {
        signals::read(text)
    } else {
        table::read(text)
    }
}

/// A table as columns with known names, and its rows.
struct Rows<'a> {
    reader: csv::Reader<&'a [u8]>,
    /// Index of each known column in a row.
    places: Vec<Option<usize>>,
    names: &'static [&'static str],
}

impl<'a> Rows<'a> {
    /// Reads the column names. The first `required` of `names` must be present, other names are not
    /// permitted, and no name may occur twice.
    fn new(
        text: &'a str,
        names: &'static [&'static str],
        required: usize,
    ) -> Result<Self, ReadError> {
        let at = |line, fault| ReadError { line, fault };
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let heads = reader.headers().map_err(|error| ReadError::of_table(&error))?.clone();
        let known = || names.join(", ");
        if let Some(name) = heads.iter().find(|name| !names.contains(name)) {
            let (name, known) = (name.to_owned(), known());
            return Err(at(1, ReadFault::UnknownColumn { name, known }));
        }
        let is_repeated = |name: &&str| heads.iter().filter(|head| head == name).count() > 1;
        if let Some(name) = heads.iter().find(is_repeated) {
            return Err(at(1, ReadFault::RepeatedColumn { name: name.to_owned() }));
        }
        let places: Vec<Option<usize>> =
            names.iter().map(|name| heads.iter().position(|head| head == *name)).collect();
        if let Some(missing) = places[..required].iter().position(Option::is_none) {
            return Err(at(1, ReadFault::MissingColumn { name: names[missing], known: known() }));
        }
        Ok(Self { reader, places, names })
    }

    /// Calls `take` for every row with its line number and its values, in the order of the names.
    fn each(
        mut self,
        mut take: impl FnMut(u64, &[Option<f64>]) -> Result<(), ReadFault>,
    ) -> Result<(), ReadError> {
        let mut record = csv::StringRecord::new();
        let mut values = vec![None; self.names.len()];
        while self.reader.read_record(&mut record).map_err(|error| ReadError::of_table(&error))? {
            let line = record.position().map_or(0, csv::Position::line);
            for ((value, place), name) in values.iter_mut().zip(&self.places).zip(self.names) {
                let text = place.and_then(|place| record.get(place));
                *value = text.map(|text| number(text, name)).transpose().map_err(at(line))?;
            }
            take(line, &values).map_err(at(line))?;
        }
        Ok(())
    }
}

fn at(line: u64) -> impl Fn(ReadFault) -> ReadError {
    move |fault| ReadError { line, fault }
}

/// Parses a finite number.
fn number(text: &str, column: &'static str) -> Result<f64, ReadFault> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| ReadFault::Number { column, text: text.chars().take(40).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_of_a_file_is_told_behind_comments_and_a_mark_of_the_byte_order() {
        let refused = |text: &str| read(text, &Nodes::new()).unwrap_err().fault;
        let head = "time_s,position_m,force_N,acceleration_m_s2\n";
        for before in ["", "\u{feff}", "# a comment\n", "\u{feff}# a comment\n\n"] {
            // One sample: known as a table of signals.
            let fault = refused(&format!("{before}{head}0,1,1,1\n"));
            assert!(matches!(fault, ReadFault::ShortHit { .. }), "{before:?}: {fault:?}");
        }
        assert_eq!(refused("\u{feff}    -1\n    58b     1\n"), ReadFault::Binary);
    }

    #[test]
    fn positions_that_cannot_be_and_repeated_columns_are_refused() {
        let refused = |text: &str| read(text, &Nodes::new()).unwrap_err().to_string();
        let table = "position_m,frequency_Hz,receptance_real_m_N,receptance_imag_m_N";
        let message = refused(&format!("{table}\n2e7,100,2e-8,-1e-9\n"));
        assert!(message.starts_with("line 2: 2e7 m is not a valid position"), "{message}");
        let signals = "position_m,time_s,force_N,acceleration_m_s2\n-2e7,0,1,1\n";
        assert!(refused(signals).contains("it can be -1e7 to 1e7 m"), "{}", refused(signals));
        let message = refused(&format!("{table},position_m\n1,100,2e-8,-1e-9,1\n"));
        assert!(message.contains("`position_m` is there twice"), "{message}");
    }
}
