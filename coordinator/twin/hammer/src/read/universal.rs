//! Universal files (ASCII): dataset 58 with frequency responses and coherences, dataset 15 with the
//! positions of nodes, dataset 164 with the units.
//!
//! Source: *Universal File Formats*, Structural Dynamics Research Laboratory, University of Cincinnati:
//! datasets 15, 58 and 164. Fields have fixed columns, because numbers may have no space between them.

use super::{Nodes, ReadError, ReadFault};
use crate::PointReceptance;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use tracktwin_parameters::quantity::PLACE;

/// Function types of dataset 58.
const FREQUENCY_RESPONSE: i64 = 4;
const COHERENCE: i64 = 6;
/// Data types of an axis.
const FREQUENCY: i64 = 18;
const FORCE: [i64; 2] = [9, 13];
/// Data type of the response, and the power of `i w` that converts the response to a displacement.
const RESPONSES: [(i64, i32); 3] = [(8, 0), (11, -1), (12, -2)];
/// Number of header lines of a function.
const HEADER: usize = 11;
/// Two frequencies in Hz are equal if they differ by less than this share.
const SAME: f64 = 1e-4;

/// A function of dataset 58.
struct Function {
    line: u64,
    kind: i64,
    nodes: [u64; 2],
    frequencies_hz: Vec<f64>,
    /// Response per unit force; for a coherence function, the coherence as real part.
    values: Vec<Complex64>,
    averages: Option<usize>,
}

/// The lines of a dataset, and the line number of the first.
struct Dataset<'a> {
    kind: u32,
    first: u64,
    lines: Vec<&'a str>,
}

/// Reads the point receptances, each with its coherence if the file contains it.
pub(super) fn read(text: &str, places: &Nodes) -> Result<Vec<PointReceptance>, ReadError> {
    let mut nodes = BTreeMap::new();
    let mut functions = Vec::new();
    for dataset in datasets(text)? {
        match dataset.kind {
            15 => dataset.nodes(&mut nodes)?,
            58 => functions.push(dataset.function()?),
            164 => dataset.check_units()?,
            _ => {}
        }
    }
    nodes.extend(places);
    let receptances = functions.iter().filter(|it| it.kind == FREQUENCY_RESPONSE);
    let points = receptances.map(|function| {
        let node = function.nodes[0];
        let fault = || ReadError { line: function.line, fault: ReadFault::Node { node } };
        let position_m = *nodes.get(&node).ok_or_else(fault)?;
        Ok(function.receptance(position_m, &functions))
    });
    let points = points.collect::<Result<Vec<_>, _>>()?;
    if points.is_empty() {
        let remedy = "export dataset 58 with functions of type 4 (frequency response)";
        return Err(ReadError { line: 1, fault: ReadFault::Nothing { remedy } });
    }
    Ok(points)
}

/// Splits a file at its lines of `-1`.
fn datasets(text: &str) -> Result<Vec<Dataset<'_>>, ReadError> {
    let mut datasets = Vec::new();
    let mut open: Option<Dataset<'_>> = None;
    let mut is_begun = false;
    for (number, line) in (1..).zip(text.lines()) {
        match (line.trim(), &mut open) {
            ("-1", None) => is_begun = !is_begun,
            ("-1", Some(_)) => datasets.extend(open.take()),
            (kind, None) if is_begun => {
                open = Some(Dataset {
                    kind: kind_of(kind, number)?,
                    first: number + 1,
                    lines: vec![],
                });
                is_begun = false;
            }
            (_, Some(dataset)) => dataset.lines.push(line),
            _ => {}
        }
    }
    match open {
        Some(Dataset { kind, first, lines }) => {
            let line = first + lines.len() as u64;
            Err(ReadError { line, fault: ReadFault::Truncated { dataset: kind } })
        }
        None => Ok(datasets),
    }
}

fn kind_of(text: &str, line: u64) -> Result<u32, ReadError> {
    let first = text.split_whitespace().next().unwrap_or_default();
    if first == "58b" {
        return Err(ReadError { line, fault: ReadFault::Binary });
    }
    first.parse().map_err(|_| bad("type of the dataset", first, line))
}

fn bad(column: &'static str, text: &str, line: u64) -> ReadError {
    let text = text.trim().chars().take(40).collect();
    ReadError { line, fault: ReadFault::Number { column, text } }
}

/// Parses an integer in columns `from..to` of a line.
fn whole(
    text: &str,
    [from, to]: [usize; 2],
    what: &'static str,
    line: u64,
) -> Result<i64, ReadError> {
    let field = text.get(from..to.min(text.len())).unwrap_or_default().trim();
    field.parse().map_err(|_| bad(what, field, line))
}

/// Parses a real number in columns `from..to` of a line.
fn real(
    text: &str,
    [from, to]: [usize; 2],
    what: &'static str,
    line: u64,
) -> Result<f64, ReadError> {
    let field = text.get(from..to.min(text.len())).unwrap_or_default().trim();
    // Fortran may write the exponent with a D.
    let value = field.replace(['D', 'd'], "E").parse::<f64>().ok().filter(|it| it.is_finite());
    value.ok_or_else(|| bad(what, field, line))
}

impl Dataset<'_> {
    /// Line `index` (from 0) of the dataset, and its line number in the file.
    fn line(&self, index: usize) -> Result<(&str, u64), ReadError> {
        let number = self.first + index as u64;
        let truncated = ReadFault::Truncated { dataset: self.kind };
        let line = self.lines.get(index).ok_or(ReadError { line: number, fault: truncated })?;
        Ok((line, number))
    }

    /// Adds the position of every node along the track, its x coordinate.
    fn nodes(&self, nodes: &mut BTreeMap<u64, f64>) -> Result<(), ReadError> {
        for index in 0..self.lines.len() {
            let (text, line) = self.line(index)?;
            let node = whole(text, [0, 10], "node", line)?;
            let x_m = real(text, [40, 53], "x of the node", line)?;
            PLACE.check(x_m).map_err(|error| ReadError { line, fault: error.into() })?;
            nodes.insert(u64::try_from(node).map_err(|_| bad("node", &text[..10], line))?, x_m);
        }
        Ok(())
    }

    fn check_units(&self) -> Result<(), ReadError> {
        let (text, line) = self.line(0)?;
        let code = whole(text, [0, 10], "code of the units", line)?;
        if code == 1 {
            return Ok(());
        }
        Err(ReadError { line, fault: ReadFault::Units { code: code.unsigned_abs() } })
    }

    /// Reads a function: five lines of text, six of numbers, then the values.
    fn function(&self) -> Result<Function, ReadError> {
        let (text, line) = self.line(5)?;
        let kind = whole(text, [0, 5], "type of the function", line)?;
        if kind != FREQUENCY_RESPONSE && kind != COHERENCE {
            return Err(other(
                format!("function of type {kind}"),
                "export types 4 and 6 alone",
                line,
            ));
        }
        // I5, I10, I5, I10, then twice: a blank, ten letters, I10, I4.
        let node = |at: [usize; 2]| {
            let node = whole(text, at, "node", line)?;
            u64::try_from(node).map_err(|_| bad("node", &node.to_string(), line))
        };
        let nodes = [node([41, 51])?, node([66, 76])?];
        let directions = [
            whole(text, [51, 55], "direction of the response", line)?,
            whole(text, [76, 80], "direction of the force", line)?,
        ];
        if kind == FREQUENCY_RESPONSE {
            check_point(nodes, directions, line)?;
        }
        let sign = if directions[0] == directions[1] { 1.0 } else { -1.0 };
        let averages = self.averages()?;
        let scale = if kind == FREQUENCY_RESPONSE { self.response()? } else { 0 };
        let (frequencies_hz, mut values) = self.values(kind)?;
        if kind == FREQUENCY_RESPONSE {
            for (value, hz) in values.iter_mut().zip(&frequencies_hz) {
                *value *= sign * Complex64::new(0.0, TAU * hz).powi(scale);
                if *value == Complex64::ZERO {
                    let form = "a receptance other than zero";
                    let fault = ReadFault::Value { column: "value", value: 0.0, form };
                    return Err(ReadError { line, fault });
                }
            }
        }
        Ok(Function { line, kind, nodes, frequencies_hz, values, averages })
    }

    /// Number of averages, if a line of text states it: `AVERAGES 5`.
    fn averages(&self) -> Result<Option<usize>, ReadError> {
        for index in 0..5 {
            let (text, _) = self.line(index)?;
            let upper = text.to_uppercase();
            let Some(at) = upper.find("AVERAGES") else { continue };
            let digits: String = upper[at + "AVERAGES".len()..]
                .trim_start_matches([' ', ':', '='])
                .chars()
                .take_while(char::is_ascii_digit)
                .collect();
            return Ok(digits.parse().ok().filter(|count| *count > 0));
        }
        Ok(None)
    }

    /// Checks the axes and returns the power of `i w` that converts the response to a displacement.
    fn response(&self) -> Result<i32, ReadError> {
        let kind = |index: usize, what| -> Result<(i64, u64), ReadError> {
            let (text, line) = self.line(index)?;
            Ok((whole(text, [0, 10], what, line)?, line))
        };
        let (abscissa, line) = kind(7, "data type of the abscissa")?;
        if abscissa != FREQUENCY {
            let what = format!("the abscissa has data type {abscissa}");
            return Err(other(what, "export over frequency, type 18", line));
        }
        let (force, line) = kind(9, "data type of the denominator")?;
        if !FORCE.contains(&force) {
            let what = format!("the denominator has data type {force}");
            return Err(other(what, "export the response per force, type 13", line));
        }
        let (response, line) = kind(8, "data type of the numerator")?;
        let power = RESPONSES.iter().find(|(kind, _)| *kind == response).map(|it| it.1);
        let what = format!("the numerator has data type {response}");
        power.ok_or_else(|| {
            other(what, "export displacement, velocity or acceleration: type 8, 11 or 12", line)
        })
    }

    /// Frequencies in Hz and values.
    fn values(&self, kind: i64) -> Result<(Vec<f64>, Vec<Complex64>), ReadError> {
        let (text, line) = self.line(6)?;
        let ordinate = whole(text, [0, 10], "data type of the ordinate", line)?;
        let count = whole(text, [10, 20], "number of values", line)?;
        let is_even = whole(text, [20, 30], "spacing of the abscissa", line)? == 1;
        let (is_double, is_complex) = match ordinate {
            2 => (false, false),
            4 => (true, false),
            5 => (false, true),
            6 => (true, true),
            _ => {
                let what = format!("the ordinate has data type {ordinate}");
                return Err(other(what, "it must be 2, 4, 5 or 6", line));
            }
        };
        if kind == FREQUENCY_RESPONSE && !is_complex {
            return Err(other("the frequency response is real".into(), "export it complex", line));
        }
        let count = usize::try_from(count).map_err(|_| bad("number of values", text, line))?;
        let (start, step) = if is_even {
            let start = real(text, [30, 43], "first frequency", line)?;
            (start, real(text, [43, 56], "step of the frequency", line)?)
        } else {
            (0.0, 0.0)
        };
        let parts = if is_complex { 2 } else { 1 };
        let layout = Cells { is_even, is_double, parts };
        let cells = self.cells(&layout, count * layout.per_value())?;
        let (mut frequencies_hz, mut values) = (Vec::new(), Vec::new());
        for (index, cell) in cells.chunks(layout.per_value()).enumerate() {
            let (frequency_hz, value) =
                if is_even { (start + index as f64 * step, cell) } else { (cell[0], &cell[1..]) };
            if frequency_hz > 0.0 {
                if frequencies_hz.last().is_some_and(|last| *last >= frequency_hz) {
                    let column = "frequency";
                    let fault = ReadFault::NotAscending { column, value: frequency_hz };
                    return Err(ReadError { line, fault });
                }
                frequencies_hz.push(frequency_hz);
                values.push(Complex64::new(value[0], value.get(1).copied().unwrap_or(0.0)));
            }
        }
        Ok((frequencies_hz, values))
    }

    /// Reads `count` numbers after the header.
    fn cells(&self, layout: &Cells, count: usize) -> Result<Vec<f64>, ReadError> {
        let mut cells = Vec::new();
        let mut index = HEADER;
        while cells.len() < count {
            let (text, line) = self.line(index)?;
            let mut from = 0;
            for width in layout.widths() {
                if cells.len() == count || text.get(from..).is_none_or(|it| it.trim().is_empty()) {
                    break;
                }
                cells.push(real(text, [from, from + width], "value", line)?);
                from += width;
            }
            if from == 0 {
                return Err(bad("value", text, line));
            }
            index += 1;
        }
        Ok(cells)
    }
}

/// Arrangement of values in lines.
struct Cells {
    is_even: bool,
    is_double: bool,
    /// Numbers per value: one if real, two if complex.
    parts: usize,
}

impl Cells {
    /// Numbers per value, including the frequency if the file contains it.
    fn per_value(&self) -> usize {
        self.parts + usize::from(!self.is_even)
    }

    /// Widths of the fields of a line: `6E13.5`, `4E20.12`, or `E13.5, 2E20.12` with frequencies.
    fn widths(&self) -> Vec<usize> {
        match (self.is_double, self.is_even, self.parts) {
            (false, _, _) => vec![13; 6],
            (true, true, _) => vec![20; 4],
            (true, false, 1) => vec![13, 20, 13, 20],
            (true, false, _) => vec![13, 20, 20],
        }
    }
}

fn other(what: String, remedy: &'static str, line: u64) -> ReadError {
    ReadError { line, fault: ReadFault::Function { what, remedy } }
}

/// Checks that force and response have the same node and the same direction.
fn check_point(
    [response, force]: [u64; 2],
    directions: [i64; 2],
    line: u64,
) -> Result<(), ReadError> {
    if response != force {
        let what = format!("response at node {response}, force at node {force}");
        return Err(other(what, "export point receptances alone, with both at one node", line));
    }
    let [along, other_way] = directions.map(i64::abs);
    if along != other_way || !(1..=3).contains(&along) {
        let what = format!("directions {} and {}", directions[0], directions[1]);
        return Err(other(what, "force and response must have one direction", line));
    }
    Ok(())
}

impl Function {
    /// The point receptance, with the coherence of the same node if the file contains it.
    fn receptance(&self, position_m: f64, all: &[Self]) -> PointReceptance {
        let is_same = |other: &&Self| {
            let pairs = || self.frequencies_hz.iter().zip(&other.frequencies_hz);
            other.kind == COHERENCE
                && other.nodes == self.nodes
                && other.frequencies_hz.len() == self.frequencies_hz.len()
                && pairs().all(|(a, b)| (a / b - 1.0).abs() < SAME)
        };
        let coherence = all.iter().find(is_same);
        let averages = self.averages.or_else(|| coherence.and_then(|it| it.averages));
        PointReceptance {
            position_m,
            frequencies_hz: self.frequencies_hz.clone(),
            values: self.values.clone(),
            coherence: coherence
                .map(|it| it.values.iter().map(|value| value.re.clamp(0.0, 1.0)).collect()),
            hits: averages,
        }
    }
}

#[cfg(test)]
mod tests;
