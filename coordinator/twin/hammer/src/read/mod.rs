//! Files of a hammer test, as text: tables of receptances, tables of signals, universal files.

mod error;
mod signals;
mod table;
mod universal;

pub use error::{ReadError, ReadFault};

use crate::PointReceptance;
use std::collections::BTreeMap;

/// Place in m of each node of a universal file whose nodes have no places in the file.
pub type Nodes = BTreeMap<u64, f64>;

/// The point receptances that a file holds, by its content: a universal file begins with `-1`, a
/// table with the names of its columns.
///
/// # Errors
/// [`ReadError`] names the line and what is wrong with it.
pub fn read(text: &str, nodes: &Nodes) -> Result<Vec<PointReceptance>, ReadError> {
    let first = text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or_default();
    let points = if first == "-1" {
        universal::read(text, nodes)?
    } else if first.split(',').any(|name| name.trim() == signals::TIME) {
        signals::read(text)?
    } else {
        table::read(text)?
    };
    if let Some(turned) = points.iter().find(|point| point.is_turned()) {
        let position_m = turned.position_m;
        return Err(ReadError { line: 1, fault: ReadFault::Turned { position_m } });
    }
    Ok(points)
}

/// Columns of a table by their names, and its rows.
struct Rows<'a> {
    reader: csv::Reader<&'a [u8]>,
    /// Place of each known column in a row.
    places: Vec<Option<usize>>,
    names: &'static [&'static str],
}

impl<'a> Rows<'a> {
    /// Reads the names: the first `required` of `names` must be there, and no others.
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
        let places: Vec<Option<usize>> =
            names.iter().map(|name| heads.iter().position(|head| head == *name)).collect();
        if let Some(missing) = places[..required].iter().position(Option::is_none) {
            return Err(at(1, ReadFault::MissingColumn { name: names[missing], known: known() }));
        }
        Ok(Self { reader, places, names })
    }

    /// Calls `take` with the number of each line and its values, in the order of the names.
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

/// A finite number.
fn number(text: &str, column: &'static str) -> Result<f64, ReadFault> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| ReadFault::Number { column, text: text.chars().take(40).collect() })
}
