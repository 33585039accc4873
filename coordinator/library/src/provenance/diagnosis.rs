//! The tables `diagnosis`, `mismatch` and `hypothesis`.

use crate::engine::{Connection, Value, Write, sql};
use crate::library::Dated;
use crate::{Library, LibraryError};

/// Stores a diagnosis; an existing one is kept unchanged.
const INSERT: &str = "
    insert into diagnosis (id, recording, verdict, code_version, document, created_at)
    values ($1, $2, $3, $4, $5, $6) on conflict (id) do nothing";

/// Stores a mismatch of a diagnosis.
const INSERT_MISMATCH: &str = "
    insert into mismatch (diagnosis_id, place, from_x_m, to_x_m, from_frequency_Hz, to_frequency_Hz, level_dB,
        p_value)
    values ($1, $2, $3, $4, $5, $6, $7, $8) on conflict (diagnosis_id, place) do nothing";

/// Stores a hypothesis of a diagnosis.
const INSERT_HYPOTHESIS: &str = "
    insert into hypothesis (diagnosis_id, place, physics, probability, from_x_m, to_x_m, parameters)
    values ($1, $2, $3, $4, $5, $6, $7) on conflict (diagnosis_id, place) do nothing";

/// The diagnosis of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosisRecord {
    /// Name of the recording.
    pub recording: String,
    /// Verdict: `consistent`, `left_out_physics`, `unknown_physics` or `measurement_chain`.
    pub verdict: String,
    /// Version of the program that made the diagnosis.
    pub code_version: String,
    /// Content of `diagnosis.json`.
    pub document_json: String,
    /// Mismatches between recording and twin, in the order of the document.
    pub mismatches: Vec<MismatchRecord>,
    /// Hypotheses, the most probable first.
    pub hypotheses: Vec<HypothesisRecord>,
}

/// A mismatch between a recording and the twin.
#[derive(Clone, Debug, PartialEq)]
pub struct MismatchRecord {
    /// First and last position along the track, in m.
    pub x_m: [f64; 2],
    /// Lowest and highest frequency, in Hz.
    pub frequency_hz: [f64; 2],
    /// Level difference, in dB.
    pub level_db: f64,
    /// Probability of at least this difference by chance.
    pub p_value: f64,
}

/// A hypothesis that explains a mismatch.
#[derive(Clone, Debug, PartialEq)]
pub struct HypothesisRecord {
    /// Name of the extension (kind).
    pub physics: String,
    /// Probability that this extension is present, 0 to 1.
    pub probability: f64,
    /// First and last position along the track, in m; `None` if the extension has no position.
    pub x_m: Option<[f64; 2]>,
    /// JSON object: parameter name with unit, to mean and standard deviation.
    pub parameters_json: String,
}

impl Library {
    /// Stores a diagnosis and returns its id. An existing one is kept unchanged.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn record_diagnosis(&self, record: DiagnosisRecord) -> Result<String, LibraryError> {
        self.write_dated(record).await
    }
}

impl DiagnosisRecord {
    /// Stores the diagnosis with this time and returns its id.
    pub(crate) async fn store(
        &self,
        connection: &mut Connection,
        at: &str,
    ) -> Result<String, LibraryError> {
        let id = super::id("tracktwin diagnosis 1", &[&self.recording, &self.document_json]);
        let insert = sql(INSERT)
            .bind(&id)
            .bind(&self.recording)
            .bind(&self.verdict)
            .bind(&self.code_version)
            .bind(&self.document_json)
            .bind(at);
        connection.execute(insert).await?;
        for (place, mismatch) in (1..).zip(&self.mismatches) {
            mismatch.insert(connection, &id, place).await?;
        }
        for (place, hypothesis) in (1..).zip(&self.hypotheses) {
            hypothesis.insert(connection, &id, place).await?;
        }
        Ok(id)
    }
}

impl Write for Dated<DiagnosisRecord> {
    type Answer = String;

    async fn apply(&self, connection: &mut Connection) -> Result<String, LibraryError> {
        self.it.store(connection, &self.at).await
    }
}

impl MismatchRecord {
    async fn insert(
        &self,
        connection: &mut Connection,
        id: &str,
        place: u32,
    ) -> Result<(), LibraryError> {
        let insert = sql(INSERT_MISMATCH)
            .bind(id)
            .bind(place)
            .bind(self.x_m[0])
            .bind(self.x_m[1])
            .bind(self.frequency_hz[0])
            .bind(self.frequency_hz[1])
            .bind(self.level_db)
            .bind(self.p_value);
        connection.execute(insert).await.map(drop)
    }
}

impl HypothesisRecord {
    async fn insert(
        &self,
        connection: &mut Connection,
        id: &str,
        place: u32,
    ) -> Result<(), LibraryError> {
        let insert = sql(INSERT_HYPOTHESIS)
            .bind(id)
            .bind(place)
            .bind(&self.physics)
            .bind(self.probability)
            .bind(Value::Real(self.x_m.map(|x_m| x_m[0])))
            .bind(Value::Real(self.x_m.map(|x_m| x_m[1])))
            .bind(&self.parameters_json);
        connection.execute(insert).await.map(drop)
    }
}
