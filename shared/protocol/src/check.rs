//! Checks of all messages.

use crate::CASES_MAX;

/// Why a message is rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BadMessage {
    /// A required field is missing.
    #[error("{field} is missing")]
    Missing {
        /// The field.
        field: &'static str,
    },
    /// A text is too long.
    #[error("{field} has {length} bytes; at most {max} are allowed")]
    TooLong {
        /// The field.
        field: &'static str,
        /// Length of the text in bytes.
        length: usize,
        /// Largest allowed length in bytes.
        max: usize,
    },
    /// A name contains control characters.
    #[error("{field} contains control characters")]
    ControlCharacters {
        /// The field.
        field: &'static str,
    },
    /// A number is NaN, infinite, negative or too large.
    #[error("{field} is {value}")]
    NotANumber {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A share is not a number from 0 to 1.
    #[error("{field} is {value}; a share must lie in 0 to 1")]
    NotAShare {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A count is too large.
    #[error("{field} is {value}; it must be below {limit}")]
    TooLarge {
        /// The field.
        field: &'static str,
        /// Its value.
        value: u32,
        /// Smallest value that is not allowed.
        limit: u32,
    },
    /// The value of an enum is unknown to this program version.
    #[error("{field} is {value}, which is unknown to this program")]
    UnknownValue {
        /// The field.
        field: &'static str,
        /// Its value.
        value: i32,
    },
    /// A parameter is unknown to this program version and would be ignored.
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
    /// A hash does not match its content.
    #[error("{what} does not match its hash")]
    WrongHash {
        /// What was hashed.
        what: String,
    },
    /// The report of a case was damaged in transmission.
    #[error("case {index}: the report was damaged in transmission: its checksum does not match")]
    Damaged {
        /// The case.
        index: u32,
    },
    /// A message has too many cases.
    #[error("{field} has {count} cases; at most {max} are allowed")]
    TooMany {
        /// The field.
        field: &'static str,
        /// Number of cases in the field.
        count: usize,
        /// Largest allowed number.
        max: usize,
    },
    /// The speeds differ from those of the experiment.
    #[error("case {index}: reported at {found:?} km/h, not at {expected:?}")]
    WrongSpeeds {
        /// The case.
        index: u32,
        /// The reported speeds in km/h.
        found: Vec<f64>,
        /// The value of the experiment.
        expected: Vec<f64>,
    },
    /// The number of features differs from that of the experiment.
    #[error("case {index}: {field} has {found} values, not {expected}")]
    WrongLength {
        /// The case.
        index: u32,
        /// The field.
        field: &'static str,
        /// Number of values in the field.
        found: usize,
        /// The value of the experiment.
        expected: usize,
    },
}

/// Longest name of a worker, version or hash, in bytes.
const NAME_BYTES_MAX: usize = 256;

/// Checks a name: not empty, at most 256 bytes, without control characters.
///
/// # Errors
/// [`BadMessage`] states the field and its fault.
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

/// Checks that there are at most [`CASES_MAX`](crate::CASES_MAX) cases.
pub(crate) fn bounded<T>(field: &'static str, cases: Vec<T>) -> Result<Vec<T>, BadMessage> {
    match cases.len() {
        count if count > CASES_MAX => Err(BadMessage::TooMany { field, count, max: CASES_MAX }),
        _ => Ok(cases),
    }
}

/// Longest time that a case may have taken, in s: ten years.
const DURATION_MAX_S: f64 = 3e8;

/// Checks that a measured time in s is possible.
pub(crate) fn duration(field: &'static str, value: f64) -> Result<f64, BadMessage> {
    if (0.0..=DURATION_MAX_S).contains(&value) {
        Ok(value)
    } else {
        Err(BadMessage::NotANumber { field, value })
    }
}

/// Checks that a share is from 0 to 1.
pub(crate) fn share(field: &'static str, value: f64) -> Result<f64, BadMessage> {
    if (0.0..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err(BadMessage::NotAShare { field, value })
    }
}

/// Checks that all numbers are finite.
pub(crate) fn finite(field: &'static str, values: &[f64]) -> Result<(), BadMessage> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(BadMessage::NotANumber { field, value }),
        None => Ok(()),
    }
}
