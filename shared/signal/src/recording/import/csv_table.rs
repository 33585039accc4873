//! Text tables, separated by comma, semicolon, tab or blanks, with or without a header line.

use super::super::error::{Fault, RecordingError};
use super::column::{Column, Content, Oddity};
use super::text;
use super::unit::bare_unit;
use std::path::Path;

/// Reads all columns. For each column the first value that is not a number is recorded.
pub(super) fn read(path: &Path) -> Result<Content, RecordingError> {
    let fail = |fault| RecordingError::new(path, "file", fault);
    let unreadable = |error: std::io::Error| fail(Fault::Unreadable { reason: error.to_string() });
    let text = text::decode(&std::fs::read(path).map_err(unreadable)?).map_err(fail)?;
    parse(&text).map_err(fail)
}

fn parse(text: &str) -> Result<Content, Fault> {
    let separator = separator(text);
    let mut reader: Option<Reader> = None;
    each_row(text, separator, |line, fields| match &mut reader {
        None => {
            reader = Some(Reader::begin(separator, line, fields));
            Ok(())
        }
        Some(reader) => reader.take(line, fields),
    })?;
    reader.map_or_else(|| Err(Fault::Empty { rows: 0 }), Reader::finish)
}

/// The field separator: the one that a first line `sep=;` states; else blanks or tabs if they separate numbers in the first line, else a semicolon
/// or tab if it has one, else a comma, else a blank.
fn separator(text: &str) -> u8 {
    if let Some(stated) = text.lines().next().and_then(stated_separator) {
        return stated;
    }
    let first = text.lines().find(|line| !line.trim().is_empty() && !is_remark(line));
    let line = first.unwrap_or_default();
    let fields = between_blanks(line);
    if fields.len() > 1 && fields.iter().all(|field| number(field, b' ').is_some()) {
        return if line.contains('\t') { b'\t' } else { b' ' };
    }
    [b';', b'\t', b','].into_iter().find(|&byte| line.as_bytes().contains(&byte)).unwrap_or(b' ')
}

/// The separator of a line `sep=;`, by which spreadsheets know it.
fn stated_separator(line: &str) -> Option<u8> {
    let line = line.trim_matches(['"', ' ', '\r']);
    let (key, sign) = line.split_at_checked(4)?;
    let is_one = key.eq_ignore_ascii_case("sep=") && sign.len() == 1;
    is_one.then(|| sign.as_bytes()[0])
}

fn is_remark(line: &str) -> bool {
    line.trim_start().starts_with(['#', '%'])
}

/// Whether the first field of a line of several belongs to a line `sep=;`.
fn begins_stated_separator(field: &str) -> bool {
    field.eq_ignore_ascii_case("sep=")
}

/// Calls `take` with the line's number and the fields of every line but empty ones and remarks.
fn each_row(
    text: &str,
    separator: u8,
    mut take: impl FnMut(u64, &[&str]) -> Result<(), Fault>,
) -> Result<(), Fault> {
    if separator == b' ' {
        for (line, text) in (1..).zip(text.lines()) {
            if !is_remark(text) && !text.trim().is_empty() && stated_separator(text).is_none() {
                take(line, &between_blanks(text))?;
            }
        }
        return Ok(());
    }
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .flexible(true)
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut record = csv::StringRecord::new();
    let broken = |error: csv::Error| Fault::Unreadable { reason: error.to_string() };
    while reader.read_record(&mut record).map_err(broken)? {
        let fields: Vec<&str> = record.iter().collect();
        let is_empty = fields.iter().all(|field| field.is_empty());
        if !is_empty && !is_remark(fields[0]) && !begins_stated_separator(fields[0]) {
            take(record.position().map_or(0, csv::Position::line), &fields)?;
        }
    }
    Ok(())
}

/// Fields between any number of blanks; quoted text is one field.
fn between_blanks(line: &str) -> Vec<&str> {
    let mut fields = Vec::new();
    let mut rest = line.trim();
    while !rest.is_empty() {
        let quoted = rest.strip_prefix('"').and_then(|text| text.split_once('"'));
        let (field, after) =
            quoted.or_else(|| rest.split_once(char::is_whitespace)).unwrap_or((rest, ""));
        fields.push(field);
        rest = after.trim_start();
    }
    fields
}

/// A table while its rows come in.
struct Reader {
    separator: u8,
    /// The first line.
    first: u64,
    names: Option<Vec<String>>,
    units: Vec<String>,
    rows: usize,
    columns: Vec<Reading>,
    /// Whether every row ends with a separator, and whether the first field has no name.
    ends_empty: bool,
    row_names: bool,
    notes: Vec<String>,
}

/// A column while its values come in.
#[derive(Default)]
struct Reading {
    column: Column,
    /// How many of its values are numbers, and the sign before their decimals.
    numbers: usize,
    decimal: Option<char>,
}

impl Reader {
    /// Begins with the first line: names, or the first row of numbers.
    fn begin(separator: u8, first: u64, fields: &[&str]) -> Self {
        let is_name = |field: &&str| number(field, separator).is_none();
        // pandas writes the numbers of columns without names behind an empty one.
        let counts = |fields: &[&str]| {
            fields.iter().enumerate().all(|(index, field)| *field == index.to_string())
        };
        let is_counted = fields.len() > 1 && fields[0].is_empty() && counts(&fields[1..]);
        let named = is_counted || fields.iter().all(is_name);
        let mut reader = Self {
            separator,
            first,
            names: None,
            units: Vec::new(),
            rows: 0,
            columns: Vec::new(),
            ends_empty: false,
            row_names: false,
            notes: Vec::new(),
        };
        if named {
            reader.names = Some(fields.iter().map(|field| (*field).to_owned()).collect());
        } else {
            if fields.len() > 1 && counts(fields) {
                let note =
                    "the first line counts the columns, 0, 1 ...: if these are names, delete it";
                reader.notes.push(note.to_owned());
            }
            reader.set_width(fields);
            reader.append(fields);
        }
        reader
    }

    /// Takes the line after the first: units, or a row.
    fn take(&mut self, line: u64, fields: &[&str]) -> Result<(), Fault> {
        if self.columns.is_empty() {
            let is_text = fields.iter().all(|field| number(field, self.separator).is_none());
            let names = self.names.as_ref().map_or(0, Vec::len);
            if self.units.is_empty() && is_text && fields.len() == names {
                self.units = fields.iter().map(|field| (*field).to_owned()).collect();
                return Ok(());
            }
            self.set_width(fields);
        }
        let fields = match fields.split_last() {
            Some((&"", rest)) if self.ends_empty && rest.len() == self.columns.len() => rest,
            _ => fields,
        };
        if fields.len() != self.columns.len() {
            let (fields, expected) = (fields.len(), self.columns.len());
            // Later lines are at fault themselves.
            let is_first = self.rows <= usize::from(self.names.is_none());
            let header = is_first.then_some(self.first);
            return Err(Fault::Fields { line, fields, expected, header });
        }
        self.append(fields);
        Ok(())
    }

    /// The number of columns, from names and the first row.
    fn set_width(&mut self, fields: &[&str]) {
        let ends_empty = fields.len() > 1 && fields[fields.len() - 1].is_empty();
        let names = self.names.as_mut();
        let width = match names {
            Some(names) => {
                if names.len() == fields.len() + 1 && names.last().is_some_and(String::is_empty) {
                    names.pop();
                }
                self.ends_empty = ends_empty && fields.len() == names.len() + 1;
                self.row_names = fields.len() == names.len() + 1 && !self.ends_empty;
                names.len() + usize::from(self.row_names)
            }
            None => fields.len(),
        };
        self.columns.resize_with(width, Reading::default);
    }

    fn append(&mut self, fields: &[&str]) {
        for (reading, text) in self.columns.iter_mut().zip(fields) {
            reading.take(text, self.separator);
        }
        self.rows += 1;
    }

    /// The columns with their names and units.
    fn finish(mut self) -> Result<Content, Fault> {
        if self.columns.is_empty() {
            let width = self.names.as_ref().map_or(0, Vec::len);
            self.columns.resize_with(width, Reading::default);
        }
        let mut columns: Vec<Column> =
            std::mem::take(&mut self.columns).into_iter().map(Reading::finish).collect();
        if self.row_names {
            let names = columns.len() - 1;
            if !is_row_name(&columns.remove(0)) {
                return Err(Fault::ShortHead { names, line: self.first });
            }
            self.notes.push(
                "the header has one name less than the rows have fields: the first field of a row \
                 is taken as its name"
                    .to_owned(),
            );
        }
        let header = self.names.is_some().then_some(self.first);
        let name = |index: usize| format!("column-{}", index + 1);
        let names = self.names.unwrap_or_else(|| (0..columns.len()).map(name).collect());
        let units = self.units.into_iter().map(Some).chain(std::iter::repeat(None));
        for ((column, name), unit) in columns.iter_mut().zip(names).zip(units) {
            column.name = name;
            let unit = unit.map(|unit| bare_unit(&unit).to_owned());
            column.unit = unit.filter(|unit| !unit.is_empty());
        }
        Ok(Content { columns, notes: self.notes, header })
    }
}

impl Reading {
    fn take(&mut self, text: &str, separator: u8) {
        let value = number(text, separator);
        let decimal = text.chars().find(|sign| matches!(sign, ',' | '.'));
        // 1,5 and 1.5 in one column: one of them is no decimal sign.
        let mixed = decimal.is_some() && self.decimal.is_some() && decimal != self.decimal;
        self.decimal = self.decimal.or(decimal);
        if (value.is_none() || mixed) && self.column.oddity.is_none() {
            let row = self.column.values.len() + 1;
            self.column.oddity = Some(Oddity::Value { row, text: text.to_owned() });
        }
        self.numbers += usize::from(value.is_some());
        self.column.values.push(value.unwrap_or(f64::NAN));
    }

    fn finish(mut self) -> Column {
        if let (0, Some(Oddity::Value { text, .. })) = (self.numbers, &self.column.oddity)
            && !text.is_empty()
        {
            self.column.oddity = Some(Oddity::Kind(format!("texts such as \"{text}\"")));
        }
        self.column
    }
}

/// Whether a column names rows: texts, or numbers that count them.
fn is_row_name(column: &Column) -> bool {
    matches!(column.oddity, Some(Oddity::Kind(_)))
        || column.oddity.is_none() && column.values.windows(2).all(|pair| pair[1] == pair[0] + 1.0)
}

/// A number; with a decimal comma where the comma separates nothing.
fn number(text: &str, separator: u8) -> Option<f64> {
    let text = text.trim();
    if separator != b',' && text.contains(',') {
        return if text.contains('.') { None } else { text.replacen(',', ".", 1).parse().ok() };
    }
    text.parse().ok()
}
