//! Reading samples one by one.

use super::SamplesError;
use std::io::{BufRead, ErrorKind, Read as _};

/// Bytes of a line; three numbers take less than a hundred.
const LINE_BYTES_MAX: usize = 4096;
/// Bytes of a binary record: three little-endian 64-bit numbers.
const RECORD_BYTES: usize = 24;
/// Characters of the input that an error repeats.
const SHOWN: usize = 40;

/// Byte-order mark that some programs write before the first line of a text in UTF-8.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// The columns, in the order of a binary record.
const NAMES: [&str; 3] = ["time_s", "position_m", "acceleration_m_s2"];

/// One sample of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time of the sample in s. NaN if unknown.
    pub time_s: f64,
    /// Position of the wheel along the track in m. Not finite if the sample is missing.
    pub position_m: f64,
    /// Vertical axle-box acceleration in m/s2, positive downwards. Not finite if the sample is missing.
    pub acceleration_m_s2: f64,
}

/// Format of the samples in a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// Lines of CSV. The first line names the columns: `position_m`, `acceleration_m_s2` and, if known,
    /// `time_s`. The reader ignores other columns and lines that begin with `#`. An empty value or `NaN`
    /// marks a missing sample.
    Csv,
    /// Records of three little-endian 64-bit floating-point numbers: time in s (NaN where it is not
    /// known), position in m, acceleration in m/s2.
    Binary,
}

/// Reads samples one after another. Memory is bounded, because the reader holds only one line.
#[derive(Debug)]
pub struct SampleReader<R> {
    input: R,
    framing: Framing,
    line: Vec<u8>,
    /// Number of the last line, from 1.
    number: u64,
    /// Places of the columns of [`NAMES`] in a line, and how many columns there are; none before
    /// the line of names.
    columns: Option<([Option<usize>; 3], usize)>,
    is_cut: bool,
}

impl<R: BufRead> SampleReader<R> {
    /// Reads from `input`.
    pub const fn new(input: R, framing: Framing) -> Self {
        Self { input, framing, line: Vec::new(), number: 0, columns: None, is_cut: false }
    }

    /// Whether the stream ended inside a line or a record. The reader ignores such an incomplete part.
    pub const fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// The next sample. `None` at the end of the stream.
    ///
    /// # Errors
    /// [`SamplesError`] with the number of the line.
    pub fn next_sample(&mut self) -> Result<Option<Sample>, SamplesError> {
        match self.framing {
            Framing::Csv => self.next_of_csv(),
            Framing::Binary => self.next_record(),
        }
    }

    fn next_of_csv(&mut self) -> Result<Option<Sample>, SamplesError> {
        while self.next_line()? {
            let text = String::from_utf8_lossy(&self.line);
            let mut text = text.trim();
            if self.number == 1 {
                text = text.trim_start_matches(BYTE_ORDER_MARK).trim_start();
            }
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            match &self.columns {
                Some((places, count)) => {
                    return sample(text, places, *count, self.number).map(Some);
                }
                None => self.columns = Some(columns(text, self.number)?),
            }
        }
        Ok(None)
    }

    /// Reads a whole line; false at the end, also inside a line: its last number may be cut.
    fn next_line(&mut self) -> Result<bool, SamplesError> {
        self.line.clear();
        self.number += 1;
        let mut limited = (&mut self.input).take(LINE_BYTES_MAX as u64);
        limited.read_until(b'\n', &mut self.line)?;
        if self.line.last() == Some(&b'\n') {
            return Ok(true);
        }
        if self.line.len() == LINE_BYTES_MAX {
            return Err(SamplesError::LongLine { line: self.number, most: LINE_BYTES_MAX });
        }
        self.is_cut = !self.line.is_empty();
        Ok(false)
    }

    fn next_record(&mut self) -> Result<Option<Sample>, SamplesError> {
        let mut record = [0; RECORD_BYTES];
        let mut filled = 0;
        while filled < RECORD_BYTES {
            match self.input.read(&mut record[filled..]) {
                Ok(0) => {
                    self.is_cut = filled > 0;
                    return Ok(None);
                }
                Ok(count) => filled += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        let (numbers, _) = record.as_chunks::<8>();
        let [time_s, position_m, acceleration_m_s2] =
            [0, 1, 2].map(|place: usize| f64::from_le_bytes(numbers[place]));
        Ok(Some(Sample { time_s, position_m, acceleration_m_s2 }))
    }
}

/// The places of the columns, and how many there are.
fn columns(text: &str, line: u64) -> Result<([Option<usize>; 3], usize), SamplesError> {
    let present: Vec<&str> = text.split(',').map(str::trim).collect();
    let mut places = [None; 3];
    for (place, name) in places.iter_mut().zip(NAMES) {
        let mut found = (0..present.len()).filter(|&column| present[column] == name);
        *place = found.next();
        if found.next().is_some() {
            return Err(SamplesError::ColumnTwice { line, name });
        }
        if place.is_none() && name != NAMES[0] {
            return Err(SamplesError::NoColumn { line, name, found: beginning(text) });
        }
    }
    Ok((places, present.len()))
}

fn sample(
    text: &str,
    places: &[Option<usize>; 3],
    expected: usize,
    line: u64,
) -> Result<Sample, SamplesError> {
    let mut values = [f64::NAN; 3];
    let mut found = 0;
    for (column, value) in text.split(',').enumerate() {
        found += 1;
        if let Some(place) = places.iter().position(|place| *place == Some(column)) {
            values[place] = number(value.trim()).ok_or_else(|| SamplesError::Number {
                line,
                name: NAMES[place],
                found: beginning(value.trim()),
            })?;
        }
    }
    if found != expected {
        return Err(SamplesError::Values { line, found, expected });
    }
    let [time_s, position_m, acceleration_m_s2] = values;
    Ok(Sample { time_s, position_m, acceleration_m_s2 })
}

/// A number; NaN for an empty value.
fn number(value: &str) -> Option<f64> {
    if value.is_empty() { Some(f64::NAN) } else { value.parse().ok() }
}

fn beginning(text: &str) -> String {
    text.chars().take(SHOWN).collect::<String>().escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &[u8], framing: Framing) -> (Vec<Sample>, Option<String>, bool) {
        let mut reader = SampleReader::new(text, framing);
        let mut samples = Vec::new();
        loop {
            match reader.next_sample() {
                Ok(Some(sample)) => samples.push(sample),
                Ok(None) => return (samples, None, reader.is_cut()),
                Err(error) => return (samples, Some(error.to_string()), reader.is_cut()),
            }
        }
    }

    fn refusal(text: &str) -> String {
        read(text.as_bytes(), Framing::Csv).1.unwrap()
    }

    #[test]
    fn columns_may_stand_in_any_order_among_others_and_time_may_be_missing() {
        let text = "# line 4\nacceleration_m_s2, speed ,position_m\r\n1.5,13,0.25\n\n-2e1,13,0.5\n";
        let (samples, error, is_cut) = read(text.as_bytes(), Framing::Csv);
        assert_eq!((error, is_cut), (None, false));
        let pairs: Vec<_> =
            samples.iter().map(|it| (it.position_m, it.acceleration_m_s2)).collect();
        assert_eq!(pairs, [(0.25, 1.5), (0.5, -20.0)]);
        assert!(samples.iter().all(|it| it.time_s.is_nan()));
    }

    #[test]
    fn a_byte_order_mark_before_the_first_line_is_passed_over() {
        for before in ["", "# of a recorder\n"] {
            let text = format!("\u{feff}{before}position_m,acceleration_m_s2\n1,2\n");
            let (samples, error, _) = read(text.as_bytes(), Framing::Csv);
            assert_eq!((samples.len(), error), (1, None), "{before}");
        }
    }

    #[test]
    fn what_is_missing_is_no_error_and_what_is_no_number_is_named_with_its_line() {
        let head = "time_s,position_m,acceleration_m_s2\n";
        let (samples, error, _) = read(format!("{head}0,1,\n1,NaN,2\n").as_bytes(), Framing::Csv);
        assert_eq!(error, None);
        assert!(samples[0].acceleration_m_s2.is_nan() && samples[1].position_m.is_nan());
        let text = refusal(&format!("{head}0,1,2\n0,1,#ERR\n"));
        assert!(text.starts_with("line 3: acceleration_m_s2: \"#ERR\" is not a number"), "{text}");
        assert_eq!(refusal(&format!("{head}0,1\n")), "line 2: 2 values, not 3");
        assert_eq!(refusal(&format!("{head}0,1,2,3\n")), "line 2: 4 values, not 3");
        let text = refusal("0.1,0.2\n0.3,0.4\n");
        assert!(text.starts_with("line 1: the column position_m is missing"), "{text}");
        assert!(refusal("position_m,position_m,acceleration_m_s2\n").contains("twice"));
        let text = refusal(&"x".repeat(2 * LINE_BYTES_MAX));
        assert!(text.starts_with("line 1: longer than"), "{text}");
    }

    #[test]
    fn a_line_or_record_that_the_end_cuts_is_left_out() {
        let text = "position_m,acceleration_m_s2\n1,2\n3,4.5";
        let (samples, error, is_cut) = read(text.as_bytes(), Framing::Csv);
        assert_eq!((samples.len(), error, is_cut), (1, None, true));
        let mut bytes: Vec<u8> =
            [0.5, 1.5, -2.5, 0.6].iter().flat_map(|value: &f64| value.to_le_bytes()).collect();
        let (samples, error, is_cut) = read(&bytes, Framing::Binary);
        let first = Sample { time_s: 0.5, position_m: 1.5, acceleration_m_s2: -2.5 };
        assert_eq!((&samples[..], error, is_cut), (&[first][..], None, true));
        bytes.truncate(RECORD_BYTES);
        assert!(!read(&bytes, Framing::Binary).2);
    }
}
