//! Tables and columns of the schema. They are equal in both databases.

use crate::result::LEVEL_COLUMNS;
use ColumnKind::{Doubles, Integer, Real, Text};
use tracktwin_parameters::Parameter;

/// Type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text.
    Text,
    /// Integer of 64 bits.
    Integer,
    /// Floating-point number of 64 bits.
    Real,
    /// Series of floating-point numbers.
    Doubles,
}

/// A column of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name of the column, with its unit.
    pub name: &'static str,
    /// Type of the column.
    pub kind: ColumnKind,
}

/// A table that can be exported and imported.
#[derive(Debug, PartialEq, Eq)]
pub struct Table {
    /// Name of the table.
    pub name: &'static str,
    /// The columns, in the order of the cells of a row.
    pub columns: &'static [Column],
    /// Names of the columns of the primary key.
    pub key: &'static [&'static str],
}

/// Defines columns: those of one table in brackets, or the name of a list shared by several tables.
macro_rules! columns {
    ([$($column:literal $kind:ident),* $(,)?]) => {
        [$(Column { name: $column, kind: $kind }),*].as_slice()
    };
    ($shared:ident) => {
        $shared.as_slice()
    };
}

/// Defines tables: name, key, and columns with their types.
macro_rules! tables {
    ($($(#[$doc:meta])* $constant:ident = $name:literal by [$($key:literal),+] { $($part:tt),+ })+) => {$(
        $(#[$doc])*
        static $constant: Table = Table {
            name: $name,
            columns: {
                const PARTS: &[&[Column]] = &[$(columns!($part)),+];
                const COLUMNS: [Column; count(PARTS)] = joined(PARTS);
                &COLUMNS
            },
            key: &[$($key),+],
        };
    )+};
}

const fn count(parts: &[&[Column]]) -> usize {
    let (mut count, mut part) = (0, 0);
    while part < parts.len() {
        count += parts[part].len();
        part += 1;
    }
    count
}

const fn joined<const N: usize>(parts: &[&[Column]]) -> [Column; N] {
    let mut columns = [Column { name: "", kind: Text }; N];
    let (mut filled, mut part) = (0, 0);
    while part < parts.len() {
        let mut place = 0;
        while place < parts[part].len() {
            columns[filled] = parts[part][place];
            filled += 1;
            place += 1;
        }
        part += 1;
    }
    columns
}

/// Columns of the catalogue's parameters.
const PARAMETERS: [Column; Parameter::COUNT] = {
    let mut columns = [Column { name: "", kind: Real }; Parameter::COUNT];
    let mut place = 0;
    while place < columns.len() {
        columns[place].name = Parameter::ALL[place].name();
        place += 1;
    }
    columns
};

/// Columns of the means and standard deviations of the parameters.
const ESTIMATES: [Column; 2 * Parameter::COUNT] = {
    let mut columns = [Column { name: "", kind: Real }; 2 * Parameter::COUNT];
    let mut place = 0;
    while place < Parameter::COUNT {
        columns[2 * place].name = Parameter::ALL[place].name();
        columns[2 * place + 1].name = deviation(place);
        place += 1;
    }
    columns
};

/// Suffix of the column with a parameter's standard deviation.
const DEVIATION: &[u8] = b"_sd";

/// Name of the column with a parameter's standard deviation.
const fn deviation(place: usize) -> &'static str {
    const BYTES_MAX: usize = 64;
    const NAMES: &[[u8; BYTES_MAX]; Parameter::COUNT] = &{
        let mut names = [[0; BYTES_MAX]; Parameter::COUNT];
        let mut place = 0;
        while place < names.len() {
            let name = Parameter::ALL[place].name().as_bytes();
            let mut byte = 0;
            while byte < name.len() + DEVIATION.len() {
                names[place][byte] =
                    if byte < name.len() { name[byte] } else { DEVIATION[byte - name.len()] };
                byte += 1;
            }
            place += 1;
        }
        names
    };
    let (name, _) = NAMES[place].split_at(Parameter::ALL[place].name().len() + DEVIATION.len());
    match std::str::from_utf8(name) {
        Ok(name) => name,
        Err(_) => panic!("names are text"),
    }
}

/// Columns of the one-third-octave levels.
const LEVELS: [Column; LEVEL_COLUMNS.len()] = {
    let mut columns = [Column { name: "", kind: Real }; LEVEL_COLUMNS.len()];
    let mut place = 0;
    while place < columns.len() {
        columns[place].name = LEVEL_COLUMNS[place];
        place += 1;
    }
    columns
};

impl Table {
    /// All tables, each after the tables that it refers to. Derived tables, such as the counts of cases,
    /// are left out. The leases of trials are left out as well, because leases are not copied.
    pub const ALL: [&'static Self; 19] = [
        &CAMPAIGN,
        &CAMPAIGN_CASE,
        &FREQUENCY_BIN,
        &RESULT,
        &ATTEMPT,
        &AUDIT,
        &WORKER,
        &PROGRESS,
        &TRAINING,
        &SURROGATE,
        &EVALUATION,
        &SLEEPER_ESTIMATE,
        &DIAGNOSIS,
        &MISMATCH,
        &HYPOTHESIS,
        &TRIAL,
        &TRIAL_CASE,
        &TRIAL_ANSWER,
        &STORED_ARRAY,
    ];

    /// The view with one row per case and speed, which contains parameters and features. A table of a
    /// training set has the same columns.
    pub const ENTRIES: &'static Self = &RESULT_WITH_PARAMETERS;

    /// Returns the table with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|table| table.name == name)
    }

    /// Names of all columns, separated by commas.
    pub(crate) fn column_list(&self) -> String {
        self.columns.iter().map(|column| column.name).collect::<Vec<_>>().join(", ")
    }

    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }
}

/// Spelling of a column in the schema, from the lower-case spelling that PostgreSQL returns.
pub(crate) fn spelled(folded: &str) -> &str {
    let columns = Table::ALL.into_iter().flat_map(|table| table.columns);
    let mut names = columns.map(|column| column.name);
    names.find(|name| name.eq_ignore_ascii_case(folded)).unwrap_or(folded)
}

tables! {
    CAMPAIGN = "campaign" by ["id"] {
        [
            "id" Text, "name" Text, "definition" Text, "definition_hash" Text, "experiment" Text,
            "experiment_hash" Text, "speeds_km_h" Text, "seed" Integer, "created_at" Text,
            "state" Text, "priority" Integer,
        ]
    }
    CAMPAIGN_CASE = "campaign_case" by ["campaign_id", "sobol_index"] {
        ["campaign_id" Text, "sobol_index" Integer], PARAMETERS, [
            "surface_seed" Integer, "parameter_hash" Text, "state" Text, "epoch" Integer,
            "attempts" Integer, "worker" Text, "lease_expires_unix_ms" Integer, "error" Text,
            "leased_unix_ms" Integer, "drawn" Text,
        ]
    }
    FREQUENCY_BIN = "frequency_bin" by ["experiment_hash", "bin"] {
        [
            "experiment_hash" Text, "bin" Integer, "frequency_Hz" Real,
        ]
    }
    RESULT = "result" by ["campaign_id", "sobol_index", "speed_km_h"] {
        ["campaign_id" Text, "sobol_index" Integer, "speed_km_h" Real, "log_power" Doubles],
        LEVELS, [
            "duration_s" Real, "worker" Text, "code_version" Text, "model_hash" Text,
            "experiment_hash" Text, "parameter_hash" Text, "finished_at" Text, "flagged" Text,
            "contact_loss_share" Real, "checksum" Text,
        ]
    }
    RESULT_WITH_PARAMETERS = "result_with_parameters" by
        ["campaign_id", "sobol_index", "speed_km_h"]
    {
        ["campaign_id" Text, "sobol_index" Integer, "speed_km_h" Real], PARAMETERS,
        ["surface_seed" Integer], LEVELS, [
            "log_power" Doubles, "duration_s" Real, "worker" Text, "code_version" Text,
            "model_hash" Text, "experiment_hash" Text, "parameter_hash" Text, "finished_at" Text,
            "flagged" Text, "contact_loss_share" Real, "checksum" Text, "drawn" Text,
        ]
    }
    ATTEMPT = "attempt" by ["campaign_id", "sobol_index", "epoch"] {
        [
            "campaign_id" Text, "sobol_index" Integer, "epoch" Integer, "worker" Text,
            "leased_unix_ms" Integer, "ended_unix_ms" Integer, "ending" Text, "error" Text,
        ]
    }
    AUDIT = "audit" by ["campaign_id", "sobol_index"] {
        [
            "campaign_id" Text, "sobol_index" Integer, "worker" Text, "state" Text, "auditor" Text,
            "lease_expires_unix_ms" Integer, "difference_dB" Real, "ended_unix_ms" Integer,
        ]
    }
    WORKER = "worker" by ["id"] {
        [
            "id" Text, "code_version" Text, "model_hash" Text, "cores" Integer, "state" Text,
            "reason" Text, "registered_unix_ms" Integer, "last_seen_unix_ms" Integer,
            "cases_finished" Integer, "cases_failed" Integer, "failures_in_a_row" Integer,
            "busy_s" Real,
        ]
    }
    PROGRESS = "progress" by ["campaign_id", "from_unix_s", "writer"] {
        [
            "campaign_id" Text, "from_unix_s" Integer, "writer" Integer, "finished" Integer,
            "failed" Integer, "busy_s" Real,
        ]
    }
    TRAINING = "training" by ["id"] {
        [
            "id" Text, "campaign_id" Text, "library_digest" Text, "cases" Integer, "seed" Integer,
            "code_version" Text, "created_at" Text,
        ]
    }
    SURROGATE = "surrogate" by ["training_id", "feature", "speeds_km_h", "parameter"] {
        [
            "training_id" Text, "feature" Text, "speeds_km_h" Text, "parameter" Text,
            "mase_test" Real, "mase_folds" Real, "coverage_90_test" Real,
        ]
    }
    EVALUATION = "evaluation" by ["id"] {
        [
            "id" Text, "recording" Text, "method" Text, "campaign_id" Text, "library_digest" Text,
            "code_version" Text, "document" Text, "created_at" Text,
        ]
    }
    SLEEPER_ESTIMATE = "sleeper_estimate" by ["evaluation_id", "sleeper"] {
        ["evaluation_id" Text, "sleeper" Text, "x_m" Real], ESTIMATES, ["flags" Text]
    }
    DIAGNOSIS = "diagnosis" by ["id"] {
        [
            "id" Text, "recording" Text, "verdict" Text, "code_version" Text, "document" Text,
            "created_at" Text,
        ]
    }
    MISMATCH = "mismatch" by ["diagnosis_id", "place"] {
        [
            "diagnosis_id" Text, "place" Integer, "from_x_m" Real, "to_x_m" Real,
            "from_frequency_Hz" Real, "to_frequency_Hz" Real, "level_dB" Real, "p_value" Real,
        ]
    }
    HYPOTHESIS = "hypothesis" by ["diagnosis_id", "place"] {
        [
            "diagnosis_id" Text, "place" Integer, "physics" Text, "probability" Real,
            "from_x_m" Real, "to_x_m" Real, "parameters" Text,
        ]
    }
    TRIAL = "trial" by ["id"] {
        [
            "id" Text, "seed" Integer, "code_version" Text, "model_hash" Text, "created_at" Text,
        ]
    }
    TRIAL_CASE = "trial_case" by ["trial_id", "case_number"] {
        [
            "trial_id" Text, "case_number" Integer, "truth_sha256" Text,
        ]
    }
    TRIAL_ANSWER = "trial_answer" by ["trial_id", "case_number", "question"] {
        [
            "trial_id" Text, "case_number" Integer, "question" Text, "diagnosis_id" Text,
            "score" Text, "worker" Text, "answered_at" Text,
        ]
    }
    STORED_ARRAY = "stored_array" by ["key"] {
        [
            "key" Text, "kind" Text, "meta" Text, "numbers" Doubles, "created_at" Text,
        ]
    }
}
