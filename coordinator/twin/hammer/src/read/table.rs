//! Tables of receptances: one row per frequency.

use super::{ReadError, ReadFault, Rows};
use crate::PointReceptance;
use num_complex::Complex64;
use tracktwin_parameters::quantity::PLACE;

/// Columns; coherence and number of hits are optional.
const COLUMNS: &[&str] = &[
    "position_m",
    "frequency_Hz",
    "receptance_real_m_N",
    "receptance_imag_m_N",
    "coherence",
    "hits",
];
const REQUIRED: usize = 4;

/// Reads the receptances; a new one begins where the position changes.
pub(super) fn read(text: &str) -> Result<Vec<PointReceptance>, ReadError> {
    let mut points: Vec<PointReceptance> = Vec::new();
    Rows::new(text, COLUMNS, REQUIRED)?.each(|_, row| {
        let &[Some(position_m), Some(frequency_hz), Some(re), Some(im), coherence, hits] = row
        else {
            unreachable!("the columns are there")
        };
        PLACE.check(position_m)?;
        if frequency_hz <= 0.0 {
            return Err(value("frequency_Hz", frequency_hz, "above 0"));
        }
        if re == 0.0 && im == 0.0 {
            return Err(value("receptance_real_m_N", re, "a receptance other than zero"));
        }
        if let Some(coherence) = coherence.filter(|it| !(0.0..=1.0).contains(it)) {
            return Err(value("coherence", coherence, "from 0 to 1"));
        }
        if let Some(hits) = hits.filter(|it| *it < 1.0 || it.fract() != 0.0 || *it > 1e6) {
            return Err(value("hits", hits, "a whole number from 1 up"));
        }
        if points.last().is_none_or(|last| last.position_m != position_m) {
            points.push(PointReceptance {
                position_m,
                frequencies_hz: Vec::new(),
                values: Vec::new(),
                coherence: coherence.map(|_| Vec::new()),
                hits: hits.map(|hits| hits as usize),
            });
        }
        let point = points.last_mut().expect("one was added");
        if point.frequencies_hz.last().is_some_and(|last| *last >= frequency_hz) {
            return Err(ReadFault::NotAscending { column: "frequency_Hz", value: frequency_hz });
        }
        point.frequencies_hz.push(frequency_hz);
        point.values.push(Complex64::new(re, im));
        if let (Some(all), Some(coherence)) = (&mut point.coherence, coherence) {
            all.push(coherence);
        }
        Ok(())
    })?;
    if points.is_empty() {
        let remedy = "write a row a frequency below the names of the columns";
        return Err(ReadError { line: 1, fault: ReadFault::Nothing { remedy } });
    }
    Ok(points)
}

const fn value(column: &'static str, value: f64, form: &'static str) -> ReadFault {
    ReadFault::Value { column, value, form }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str =
        "position_m,frequency_Hz,receptance_real_m_N,receptance_imag_m_N,coherence\n";

    #[test]
    fn a_table_of_two_points_is_read() {
        let text = format!(
            "{HEAD}1.0,100,2e-8,-1e-9,0.99\n1.0,200,1e-8,-1e-9,1\n2.0,100,2e-8,-3e-9,0.95\n"
        );
        let points = read(&text).unwrap();
        assert_eq!(points.len(), 2);
        assert_eq!(points[0].frequencies_hz, [100.0, 200.0]);
        assert_eq!(points[1].coherence.as_deref(), Some(&[0.95][..]));
        assert_eq!(points[1].hits, None);
    }

    #[test]
    fn a_bad_line_is_refused_by_its_number() {
        let refused = |rows: &str| read(&format!("{HEAD}{rows}")).unwrap_err().to_string();
        for (rows, words) in [
            ("1,100,2e-8,-1e-9,0.9\n1,x,1e-8,-1e-9,1\n", "line 3: frequency_Hz: `x`"),
            ("1,100,2e-8,-1e-9,1.2\n", "line 2: coherence is 1.2"),
            ("1,100,2e-8,-1e-9,1\n1,100,2e-8,-1e-9,1\n", "line 3: frequency_Hz 100"),
            ("1,-5,2e-8,-1e-9,1\n", "line 2: frequency_Hz is -5"),
            ("1,100,0,0,1\n", "other than zero"),
            ("1,100,2e-8\n", "line 2: not a table"),
            ("1,100,nan,-1e-9,1\n", "`nan` is not a finite number"),
            ("", "no receptance"),
        ] {
            let message = refused(rows);
            assert!(message.contains(words), "{message}");
        }
        let unknown = read("position_m,coherance\n").unwrap_err().to_string();
        assert!(unknown.contains("`coherance` is not known"), "{unknown}");
        let missing = read("position_m,frequency_Hz\n").unwrap_err().to_string();
        assert!(missing.contains("`receptance_real_m_N` is missing"), "{missing}");
    }
}
