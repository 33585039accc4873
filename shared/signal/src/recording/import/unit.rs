//! Units of columns: given by the user or by the file, and their value in SI.

use super::super::error::Fault;
use super::column::Column;
use serde::Deserialize;

/// A unit of some quantity.
pub(super) trait Unit: Copy + PartialEq + Default + 'static {
    /// All of them with their spellings, in lower case and without blanks; the first one is shown.
    const ALL: &'static [(Self, &'static [&'static str])];
    /// The option that gives the unit.
    const REMEDY: &'static str;

    /// One of it in SI units.
    fn in_si(self) -> f64;

    /// As it is written.
    fn name(self) -> &'static str {
        let of = Self::ALL.iter().find(|(unit, _)| *unit == self);
        of.and_then(|(_, spellings)| spellings.first()).copied().unwrap_or("an unknown unit")
    }
}

/// Unit of an acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum AccelerationUnit {
    /// Metres per second squared.
    #[default]
    #[serde(rename = "m/s2")]
    MetrePerSecondSquared,
    /// Standard gravity.
    #[serde(rename = "g")]
    G,
    /// Unknown unit. Levels are comparable only within the recording.
    #[serde(rename = "unknown")]
    Unknown,
}

/// Unit of a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum TimeUnit {
    /// Seconds.
    #[default]
    #[serde(rename = "s")]
    Second,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Millisecond,
    /// Microseconds.
    #[serde(rename = "us")]
    Microsecond,
    /// Nanoseconds.
    #[serde(rename = "ns")]
    Nanosecond,
}

/// Unit of a position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum PositionUnit {
    /// Metres.
    #[default]
    #[serde(rename = "m")]
    Metre,
    /// Kilometres.
    #[serde(rename = "km")]
    Kilometre,
    /// Millimetres.
    #[serde(rename = "mm")]
    Millimetre,
}

/// Unit of a speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum SpeedUnit {
    /// Kilometres per hour.
    #[default]
    #[serde(rename = "km/h")]
    KilometrePerHour,
    /// Metres per second.
    #[serde(rename = "m/s")]
    MetrePerSecond,
}

impl Unit for AccelerationUnit {
    const ALL: &'static [(Self, &'static [&'static str])] = &[
        (Self::MetrePerSecondSquared, &["m/s2", "ms-2", "m/s/s", "mps2", "ms2"]),
        (Self::G, &["g", "gn", "g0"]),
        (Self::Unknown, &["unknown"]),
    ];
    const REMEDY: &'static str = "use --unit m/s2, g or unknown";

    fn in_si(self) -> f64 {
        match self {
            Self::MetrePerSecondSquared | Self::Unknown => 1.0,
            Self::G => 9.806_65,
        }
    }
}

impl Unit for TimeUnit {
    const ALL: &'static [(Self, &'static [&'static str])] = &[
        (Self::Second, &["s", "sec", "seconds"]),
        (Self::Millisecond, &["ms", "msec"]),
        (Self::Microsecond, &["us", "\u{b5}s", "\u{3bc}s"]),
        (Self::Nanosecond, &["ns"]),
    ];
    const REMEDY: &'static str = "use --time-unit s, ms, us or ns";

    fn in_si(self) -> f64 {
        match self {
            Self::Second => 1.0,
            Self::Millisecond => 1e-3,
            Self::Microsecond => 1e-6,
            Self::Nanosecond => 1e-9,
        }
    }
}

impl Unit for PositionUnit {
    const ALL: &'static [(Self, &'static [&'static str])] =
        &[(Self::Metre, &["m"]), (Self::Kilometre, &["km"]), (Self::Millimetre, &["mm"])];
    const REMEDY: &'static str = "use --position-unit m, km or mm";

    fn in_si(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Kilometre => 1e3,
            Self::Millimetre => 1e-3,
        }
    }
}

impl Unit for SpeedUnit {
    const ALL: &'static [(Self, &'static [&'static str])] = &[
        (Self::KilometrePerHour, &["km/h", "kmh", "kmph", "kph"]),
        (Self::MetrePerSecond, &["m/s", "mps", "ms-1", "m/sec", "ms"]),
    ];
    const REMEDY: &'static str = "use --speed-unit km/h or m/s";

    fn in_si(self) -> f64 {
        match self {
            Self::KilometrePerHour => 1.0 / 3.6,
            Self::MetrePerSecond => 1.0,
        }
    }
}

/// The unit of a column: as given, else from the file or the column name, else the default.
///
/// What is worth saying of it goes into `notes`.
///
/// # Errors
/// [`Fault::UnknownUnit`] if the file states an unknown one and none is given.
pub(super) fn of_column<U: Unit>(
    column: &Column,
    told: Option<U>,
    notes: &mut Vec<String>,
) -> Result<U, Fault> {
    let name = &column.name;
    let stated = column.unit.as_deref().or_else(|| in_brackets(name).map(|(_, unit)| unit));
    let known = stated.map_or_else(|| at_end::<U>(name), named::<U>);
    match (told, known, stated) {
        (Some(told), Some(known), _) if told != known => {
            notes.push(format!(
                "doubt: {name} is read in {}, as requested, but its name or file states {}",
                told.name(),
                known.name()
            ));
            Ok(told)
        }
        (Some(told), ..) => Ok(told),
        (None, Some(known), _) => {
            notes.push(format!("{name} is read in {}, as its name or file states", known.name()));
            Ok(known)
        }
        (None, None, Some(unit)) => {
            let names: Vec<&str> = U::ALL.iter().map(|(unit, _)| unit.name()).collect();
            let known = names.join(", ");
            Err(Fault::UnknownUnit { unit: unit.to_owned(), known, remedy: U::REMEDY })
        }
        (None, None, None) => {
            let unit = U::default();
            notes.push(format!(
                "{name} is read in {}; if that is wrong, {}",
                unit.name(),
                U::REMEDY
            ));
            Ok(unit)
        }
    }
}

/// The name without a unit in brackets behind it.
pub(super) fn bare_name(name: &str) -> &str {
    in_brackets(name).map_or(name, |(bare, _)| bare)
}

/// A unit without brackets around it: "\[g\]" and "(g)" as "g".
pub(super) fn bare_unit(unit: &str) -> &str {
    let unit = unit.trim();
    let within = |(opens, closes)| unit.strip_prefix(opens)?.strip_suffix(closes);
    [('[', ']'), ('(', ')')].into_iter().find_map(within).map_or(unit, str::trim)
}

/// "acc \[g\]" and "acc (g)" as "acc" and "g".
fn in_brackets(name: &str) -> Option<(&str, &str)> {
    let (name, unit) = [('[', ']'), ('(', ')')]
        .into_iter()
        .find_map(|(opens, closes)| name.trim_end().strip_suffix(closes)?.rsplit_once(opens))?;
    Some((name.trim(), unit.trim())).filter(|(name, unit)| !name.is_empty() && !unit.is_empty())
}

/// The unit that a name ends in: `speed_kmh`, `acc_m_s2`, `km`.
fn at_end<U: Unit>(name: &str) -> Option<U> {
    let parts: Vec<&str> = name.split(['_', ' ', ',']).filter(|part| !part.is_empty()).collect();
    // Longest first: m_s2 ends in s2, and m_s in s.
    let longest = parts.len().min(3);
    (1..=longest).rev().find_map(|count| named(&parts[parts.len() - count..].join("/")))
}

fn named<U: Unit>(text: &str) -> Option<U> {
    let sign = |c: char| match c {
        '\u{b2}' => Some('2'),
        '\u{2212}' => Some('-'),
        '^' | '*' | '\u{b7}' | '.' => None,
        c if c.is_whitespace() => None,
        c => Some(c.to_ascii_lowercase()),
    };
    let text: String = text.chars().filter_map(sign).collect();
    let is_it = |(_, spellings): &&(U, &[&str])| spellings.contains(&text.as_str());
    U::ALL.iter().find(is_it).map(|(unit, _)| *unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit<U: Unit>(name: &str, told: Option<U>) -> (Result<U, Fault>, Vec<String>) {
        let mut notes = Vec::new();
        let column = Column { name: name.to_owned(), ..Column::default() };
        (of_column(&column, told, &mut notes), notes)
    }

    #[test]
    fn names_that_say_their_unit_are_believed_and_told() {
        for (name, expected) in [
            ("acc [g]", AccelerationUnit::G),
            ("a (m/s\u{b2})", AccelerationUnit::MetrePerSecondSquared),
            ("a [m s^-2]", AccelerationUnit::MetrePerSecondSquared),
            ("acc_g", AccelerationUnit::G),
            ("acceleration_m_s2", AccelerationUnit::MetrePerSecondSquared),
        ] {
            let (found, notes) = unit::<AccelerationUnit>(name, None);
            assert_eq!((found.unwrap(), notes.len()), (expected, 1), "{name}");
        }
        assert_eq!(unit::<PositionUnit>("km", None).0.unwrap(), PositionUnit::Kilometre);
        for name in ["v_m_s", "v_ms", "v [m/s]"] {
            assert_eq!(unit::<SpeedUnit>(name, None).0.unwrap(), SpeedUnit::MetrePerSecond);
        }
        assert_eq!(unit::<TimeUnit>("t [\u{b5}s]", None).0.unwrap(), TimeUnit::Microsecond);
        let (found, notes) = unit::<AccelerationUnit>("acc_left", None);
        assert_eq!(found.unwrap(), AccelerationUnit::MetrePerSecondSquared);
        assert!(notes[0].contains("read in m/s2; if that is wrong, use --unit"), "{notes:?}");
    }

    #[test]
    fn a_unit_told_against_the_name_is_doubted_and_an_unknown_one_refused() {
        let told = AccelerationUnit::MetrePerSecondSquared;
        let (found, notes) = unit("acc [g]", Some(told));
        assert_eq!(found.unwrap(), told);
        assert!(notes[0].starts_with("doubt: acc [g] is read in m/s2, as requested"), "{notes:?}");
        let (found, _) = unit::<AccelerationUnit>("acc [mV]", None);
        let text = found.unwrap_err().to_string();
        assert!(text.contains("\"mV\", but must be one of m/s2, g, unknown; use --unit"), "{text}");
        assert!(unit("acc [mV]", Some(AccelerationUnit::Unknown)).0.is_ok());
    }
}
