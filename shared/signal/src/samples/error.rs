//! Why a stream of samples cannot be read.

/// Errors of a stream of samples; lines count from 1.
#[derive(Debug, thiserror::Error)]
pub enum SamplesError {
    /// The source fails.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// A column that is needed is missing in the line of names.
    #[error(
        "line {line}: the column {name} is missing; the first line must name position_m, \
         acceleration_m_s2 and, if known, time_s, separated by commas, not \"{found}\""
    )]
    NoColumn {
        /// Number of the line.
        line: u64,
        /// The column.
        name: &'static str,
        /// The line, or its beginning.
        found: String,
    },
    /// A column is named twice.
    #[error("line {line}: the column {name} is there twice")]
    ColumnTwice {
        /// Number of the line.
        line: u64,
        /// The column.
        name: &'static str,
    },
    /// A line has more or fewer values than the line of names.
    #[error("line {line}: {found} values, not {expected}")]
    Values {
        /// Number of the line.
        line: u64,
        /// Number of values of the line.
        found: usize,
        /// Number of names in the first line.
        expected: usize,
    },
    /// A value is not a number.
    #[error(
        "line {line}: {name}: \"{found}\" is not a number; write NaN where a sample is missing"
    )]
    Number {
        /// Number of the line.
        line: u64,
        /// The column.
        name: &'static str,
        /// The value, or its beginning.
        found: String,
    },
    /// A line is longer than any line of numbers.
    #[error("line {line}: longer than {most} bytes; binary samples need --format binary")]
    LongLine {
        /// Number of the line.
        line: u64,
        /// Largest allowed number of bytes of a line.
        most: usize,
    },
}

impl SamplesError {
    /// Whether the input is wrong. False for a failure of the machine or the network.
    pub const fn is_wrong_input(&self) -> bool {
        !matches!(self, Self::Read(_))
    }
}
