//! What tables there are, and their columns; the same in both databases.

use ColumnKind::{Doubles, Integer, Real, Text};

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text.
    Text,
    /// Integers of 64 bits.
    Integer,
    /// Numbers.
    Real,
    /// Series of numbers.
    Doubles,
}

/// A column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name, with its unit.
    pub name: &'static str,
    /// What it holds.
    pub kind: ColumnKind,
}

/// A table that is read out and written in.
#[derive(Debug, PartialEq, Eq)]
pub struct Table {
    /// Its name.
    pub name: &'static str,
    /// Its columns.
    pub columns: &'static [Column],
    /// The columns that tell its rows apart.
    pub key: &'static [&'static str],
}

/// Writes a table down: its name, its key, and its columns with their kinds.
macro_rules! tables {
    ($($(#[$doc:meta])* $constant:ident = $name:literal by [$($key:literal),+] {
        $($column:literal $kind:ident),+ $(,)?
    })+) => {$(
        $(#[$doc])*
        static $constant: Table = Table {
            name: $name,
            columns: &[$(Column { name: $column, kind: $kind }),+],
            key: &[$($key),+],
        };
    )+};
}

impl Table {
    /// All tables, those first that others refer to. What follows from others is not among them:
    /// counts of cases; nor are the
    /// leases of trials, which don't travel.
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

    /// The view of one row a case and speed, parameters beside features: what a table of a training
    /// set looks like.
    pub const ENTRIES: &'static Self = &RESULT_WITH_PARAMETERS;

    /// The table of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|table| table.name == name)
    }

    /// The names of the columns, after each other.
    pub(crate) fn column_list(&self) -> String {
        self.columns.iter().map(|column| column.name).collect::<Vec<_>>().join(", ")
    }

    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }
}

/// As the schema spells a column that PostgreSQL answers in lower case.
pub(crate) fn spelled(folded: &str) -> &str {
    let columns = Table::ALL.into_iter().flat_map(|table| table.columns);
    let mut names = columns.map(|column| column.name);
    names.find(|name| name.eq_ignore_ascii_case(folded)).unwrap_or(folded)
}

tables! {
    CAMPAIGN = "campaign" by ["id"] {
        "id" Text, "name" Text, "definition" Text, "definition_hash" Text, "experiment" Text,
        "experiment_hash" Text, "speeds_km_h" Text, "seed" Integer, "created_at" Text,
        "state" Text, "priority" Integer,
    }
    CAMPAIGN_CASE = "campaign_case" by ["campaign_id", "sobol_index"] {
        "campaign_id" Text, "sobol_index" Integer, "railpad_stiffness_N_m" Real,
        "railpad_damping_N_s_m" Real, "ballast_stiffness_N_m" Real, "ballast_damping_N_s_m" Real,
        "sleeper_EI_N_m2" Real, "irregularity_level" Real, "surface_seed" Integer,
        "parameter_hash" Text, "state" Text, "epoch" Integer, "attempts" Integer, "worker" Text,
        "lease_expires_unix_ms" Integer, "error" Text, "leased_unix_ms" Integer,
    }
    FREQUENCY_BIN = "frequency_bin" by ["experiment_hash", "bin"] {
        "experiment_hash" Text, "bin" Integer, "frequency_Hz" Real,
    }
    RESULT = "result" by ["campaign_id", "sobol_index", "speed_km_h"] {
        "campaign_id" Text, "sobol_index" Integer, "speed_km_h" Real, "log_power" Doubles,
        "level_50_Hz_dB" Real, "level_63_Hz_dB" Real, "level_80_Hz_dB" Real,
        "level_100_Hz_dB" Real, "level_125_Hz_dB" Real, "level_160_Hz_dB" Real,
        "level_200_Hz_dB" Real, "level_250_Hz_dB" Real, "level_315_Hz_dB" Real,
        "level_400_Hz_dB" Real, "level_500_Hz_dB" Real, "level_630_Hz_dB" Real,
        "level_800_Hz_dB" Real, "level_1000_Hz_dB" Real, "level_1250_Hz_dB" Real,
        "level_1600_Hz_dB" Real, "level_2000_Hz_dB" Real, "level_2500_Hz_dB" Real,
        "level_3150_Hz_dB" Real, "level_4000_Hz_dB" Real, "duration_s" Real, "worker" Text,
        "code_version" Text, "model_hash" Text, "experiment_hash" Text, "parameter_hash" Text,
        "finished_at" Text, "flagged" Text,
        "contact_loss_share" Real, "checksum" Text,
    }
    RESULT_WITH_PARAMETERS = "result_with_parameters" by
        ["campaign_id", "sobol_index", "speed_km_h"]
    {
        "campaign_id" Text, "sobol_index" Integer, "speed_km_h" Real,
        "railpad_stiffness_N_m" Real, "railpad_damping_N_s_m" Real, "ballast_stiffness_N_m" Real,
        "ballast_damping_N_s_m" Real, "sleeper_EI_N_m2" Real, "irregularity_level" Real,
        "surface_seed" Integer,
        "level_50_Hz_dB" Real, "level_63_Hz_dB" Real, "level_80_Hz_dB" Real,
        "level_100_Hz_dB" Real, "level_125_Hz_dB" Real, "level_160_Hz_dB" Real,
        "level_200_Hz_dB" Real, "level_250_Hz_dB" Real, "level_315_Hz_dB" Real,
        "level_400_Hz_dB" Real, "level_500_Hz_dB" Real, "level_630_Hz_dB" Real,
        "level_800_Hz_dB" Real, "level_1000_Hz_dB" Real, "level_1250_Hz_dB" Real,
        "level_1600_Hz_dB" Real, "level_2000_Hz_dB" Real, "level_2500_Hz_dB" Real,
        "level_3150_Hz_dB" Real, "level_4000_Hz_dB" Real, "log_power" Doubles,
        "duration_s" Real, "worker" Text, "code_version" Text, "model_hash" Text,
        "experiment_hash" Text, "parameter_hash" Text, "finished_at" Text, "flagged" Text,
        "contact_loss_share" Real, "checksum" Text,
    }
    ATTEMPT = "attempt" by ["campaign_id", "sobol_index", "epoch"] {
        "campaign_id" Text, "sobol_index" Integer, "epoch" Integer, "worker" Text,
        "leased_unix_ms" Integer, "ended_unix_ms" Integer, "ending" Text, "error" Text,
    }
    AUDIT = "audit" by ["campaign_id", "sobol_index"] {
        "campaign_id" Text, "sobol_index" Integer, "worker" Text, "state" Text, "auditor" Text,
        "lease_expires_unix_ms" Integer, "difference_dB" Real, "ended_unix_ms" Integer,
    }
    WORKER = "worker" by ["id"] {
        "id" Text, "code_version" Text, "model_hash" Text, "cores" Integer, "state" Text,
        "reason" Text, "registered_unix_ms" Integer, "last_seen_unix_ms" Integer,
        "cases_finished" Integer, "cases_failed" Integer, "failures_in_a_row" Integer,
        "busy_s" Real,
    }
    PROGRESS = "progress" by ["campaign_id", "from_unix_s", "writer"] {
        "campaign_id" Text, "from_unix_s" Integer, "writer" Integer, "finished" Integer,
        "failed" Integer, "busy_s" Real,
    }
    TRAINING = "training" by ["id"] {
        "id" Text, "campaign_id" Text, "library_digest" Text, "cases" Integer, "seed" Integer,
        "code_version" Text, "created_at" Text,
    }
    SURROGATE = "surrogate" by ["training_id", "feature", "speeds_km_h", "parameter"] {
        "training_id" Text, "feature" Text, "speeds_km_h" Text, "parameter" Text,
        "mase_test" Real, "mase_folds" Real, "coverage_90_test" Real,
    }
    EVALUATION = "evaluation" by ["id"] {
        "id" Text, "recording" Text, "method" Text, "campaign_id" Text, "library_digest" Text,
        "code_version" Text, "document" Text, "created_at" Text,
    }
    SLEEPER_ESTIMATE = "sleeper_estimate" by ["evaluation_id", "sleeper"] {
        "evaluation_id" Text, "sleeper" Text, "x_m" Real,
        "railpad_stiffness_N_m" Real, "railpad_stiffness_N_m_sd" Real,
        "railpad_damping_N_s_m" Real, "railpad_damping_N_s_m_sd" Real,
        "ballast_stiffness_N_m" Real, "ballast_stiffness_N_m_sd" Real,
        "ballast_damping_N_s_m" Real, "ballast_damping_N_s_m_sd" Real,
        "sleeper_EI_N_m2" Real, "sleeper_EI_N_m2_sd" Real,
        "irregularity_level" Real, "irregularity_level_sd" Real, "flags" Text,
    }
    DIAGNOSIS = "diagnosis" by ["id"] {
        "id" Text, "recording" Text, "verdict" Text, "code_version" Text, "document" Text,
        "created_at" Text,
    }
    MISMATCH = "mismatch" by ["diagnosis_id", "place"] {
        "diagnosis_id" Text, "place" Integer, "from_x_m" Real, "to_x_m" Real,
        "from_frequency_Hz" Real, "to_frequency_Hz" Real, "level_dB" Real, "p_value" Real,
    }
    HYPOTHESIS = "hypothesis" by ["diagnosis_id", "place"] {
        "diagnosis_id" Text, "place" Integer, "physics" Text, "probability" Real,
        "from_x_m" Real, "to_x_m" Real, "parameters" Text,
    }
    TRIAL = "trial" by ["id"] {
        "id" Text, "seed" Integer, "code_version" Text, "model_hash" Text, "created_at" Text,
    }
    TRIAL_CASE = "trial_case" by ["trial_id", "case_number"] {
        "trial_id" Text, "case_number" Integer, "truth_sha256" Text,
    }
    TRIAL_ANSWER = "trial_answer" by ["trial_id", "case_number", "question"] {
        "trial_id" Text, "case_number" Integer, "question" Text, "diagnosis_id" Text,
        "score" Text, "worker" Text, "answered_at" Text,
    }
    STORED_ARRAY = "stored_array" by ["key"] {
        "key" Text, "kind" Text, "meta" Text, "numbers" Doubles, "created_at" Text,
    }
}
