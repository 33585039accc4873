//! What is checked in every message.

use crate::CASES_MAX;

/// Why a message is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BadMessage {
    /// A field that must be there is not.
    #[error("{field} is missing")]
    Missing {
        /// The field.
        field: &'static str,
    },
    /// A text is longer than it may be.
    #[error("{field} has {length} bytes; at most {max} are allowed")]
    TooLong {
        /// The field.
        field: &'static str,
        /// Its length in bytes.
        length: usize,
        /// The longest allowed.
        max: usize,
    },
    /// A name with invisible characters.
    #[error("{field} contains control characters")]
    ControlCharacters {
        /// The field.
        field: &'static str,
    },
    /// A number is NaN, infinite, negative or beyond all measure where it can't be.
    #[error("{field} is {value}")]
    NotANumber {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A share that is not a number from 0 to 1.
    #[error("{field} is {value}; a share must lie in 0 to 1")]
    NotAShare {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// An impossible count.
    #[error("{field} is {value}; it must be below {limit}")]
    TooLarge {
        /// The field.
        field: &'static str,
        /// Its value.
        value: u32,
        /// The least that is not allowed.
        limit: u32,
    },
    /// An enum value this program doesn't know.
    #[error("{field} is {value}, which is unknown to this program")]
    UnknownValue {
        /// The field.
        field: &'static str,
        /// Its value.
        value: i32,
    },
    /// A parameter this program doesn't know, and would ignore.
    #[error(
        "case {index}: unknown parameter `{name}`; coordinator and worker have different \
         versions"
    )]
    UnknownParameter {
        /// The case.
        index: u32,
        /// The parameter's name.
        name: String,
    },
    /// A parameter does not occur exactly once.
    #[error("case {index}: parameter {name} occurs {count} times instead of once")]
    ParameterCount {
        /// The case.
        index: u32,
        /// The parameter's name.
        name: &'static str,
        /// Number of occurrences.
        count: usize,
    },
    /// A hash does not belong to what it came with.
    #[error("{what} does not match its hash")]
    WrongHash {
        /// What was hashed.
        what: String,
    },
    /// The report of a case is not what its worker sent.
    #[error("case {index}: the report was damaged in transmission: its checksum does not match")]
    Damaged {
        /// The case.
        index: u32,
    },
    /// More cases than a message may hold.
    #[error("{field} has {count} cases; at most {max} are allowed")]
    TooMany {
        /// The field.
        field: &'static str,
        /// How many it has.
        count: usize,
        /// The most allowed.
        max: usize,
    },
    /// Not the speeds of the experiment.
    #[error("case {index}: reported at {found:?} km/h, not at {expected:?}")]
    WrongSpeeds {
        /// The case.
        index: u32,
        /// The speeds reported.
        found: Vec<f64>,
        /// The experiment's.
        expected: Vec<f64>,
    },
    /// Not as many features as the experiment has.
    #[error("case {index}: {field} has {found} values, not {expected}")]
    WrongLength {
        /// The case.
        index: u32,
        /// The field.
        field: &'static str,
        /// Its length.
        found: usize,
        /// The experiment's.
        expected: usize,
    },
}

/// Longest name of a worker, version or hash, in bytes.
const NAME_BYTES_MAX: usize = 256;

/// A name: not empty, at most 256 bytes, fit to be printed and stored.
///
/// # Errors
/// [`BadMessage`] names the field and what is wrong with it.
pub fn name(field: &'static str, text: String) -> Result<String, BadMessage> {
    match text.len() {
        0 => Err(BadMessage::Missing { field }),
        length if length > NAME_BYTES_MAX => {
            Err(BadMessage::TooLong { field, length, max: NAME_BYTES_MAX })
        }
        _ if text.contains(char::is_control) => Err(BadMessage::ControlCharacters { field }),
        _ => Ok(text),
    }
}

/// As many cases as a message may hold.
pub(crate) fn bounded<T>(field: &'static str, cases: Vec<T>) -> Result<Vec<T>, BadMessage> {
    match cases.len() {
        count if count > CASES_MAX => Err(BadMessage::TooMany { field, count, max: CASES_MAX }),
        _ => Ok(cases),
    }
}

/// Longest time that a case may have taken, in s: ten years.
const DURATION_MAX_S: f64 = 3e8;

/// A possible measured time in s.
pub(crate) fn duration(field: &'static str, value: f64) -> Result<f64, BadMessage> {
    if (0.0..=DURATION_MAX_S).contains(&value) {
        Ok(value)
    } else {
        Err(BadMessage::NotANumber { field, value })
    }
}

/// A share, 0 to 1.
pub(crate) fn share(field: &'static str, value: f64) -> Result<f64, BadMessage> {
    if (0.0..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err(BadMessage::NotAShare { field, value })
    }
}

/// That all numbers are finite.
pub(crate) fn finite(field: &'static str, values: &[f64]) -> Result<(), BadMessage> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(BadMessage::NotANumber { field, value }),
        None => Ok(()),
    }
}
