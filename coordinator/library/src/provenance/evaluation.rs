//! The tables `evaluation` and `sleeper_estimate`.

use crate::engine::{Connection, Value, Write, sql};
use crate::library::Dated;
use crate::{Library, LibraryError};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use tracktwin_parameters::Parameter;

/// Stores an evaluation; an existing one is kept unchanged.
const INSERT: &str = "
    insert into evaluation (id, recording, method, campaign_id, library_digest, code_version, document, created_at)
    values ($1, $2, $3, $4, $5, $6, $7, $8) on conflict (id) do nothing";

/// The evaluation of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluationRecord {
    /// Name of the recording.
    pub recording: String,
    /// Method that produced the estimates.
    pub method: String,
    /// Id of the campaign on which the surrogates were trained.
    pub campaign: String,
    /// Digest of this campaign at the time of training.
    pub library_digest: String,
    /// Version of the program that made the evaluation.
    pub code_version: String,
    /// Content of `evaluation.json`.
    pub document_json: String,
    /// Estimates of each sleeper.
    pub sleepers: Vec<SleeperRecord>,
}

/// Estimates at one sleeper.
#[derive(Clone, Debug, PartialEq)]
pub struct SleeperRecord {
    /// Id of the sleeper.
    pub id: String,
    /// Position of the sleeper along the track, in m.
    pub x_m: f64,
    /// Mean and standard deviation of each parameter, in the parameter's unit.
    pub estimates: BTreeMap<Parameter, [f64; 2]>,
    /// Flags as text; empty if there are none.
    pub flags: String,
}

impl Library {
    /// Stores an evaluation and returns its id. An existing one is kept unchanged.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn record_evaluation(
        &self,
        record: EvaluationRecord,
    ) -> Result<String, LibraryError> {
        self.write_dated(record).await
    }
}

impl Write for Dated<EvaluationRecord> {
    type Answer = String;

    async fn apply(&self, connection: &mut Connection) -> Result<String, LibraryError> {
        let record = &self.it;
        let texts = [&record.recording, &record.campaign, &record.document_json];
        let id = super::id("tracktwin evaluation 1", &texts.map(String::as_str));
        let insert = sql(INSERT)
            .bind(&id)
            .bind(&record.recording)
            .bind(&record.method)
            .bind(&record.campaign)
            .bind(&record.library_digest)
            .bind(&record.code_version)
            .bind(&record.document_json)
            .bind(&self.at);
        connection.execute(insert).await?;
        for sleeper in &record.sleepers {
            sleeper.insert(connection, &id).await?;
        }
        Ok(id)
    }
}

impl SleeperRecord {
    async fn insert(&self, connection: &mut Connection, id: &str) -> Result<(), LibraryError> {
        let mut insert =
            "insert into sleeper_estimate (evaluation_id, sleeper, x_m, flags".to_owned();
        let mut values = "$1, $2, $3, $4".to_owned();
        for (place, parameter) in Parameter::ALL.iter().enumerate() {
            let name = parameter.name();
            let _ = write!(insert, ", {name}, {name}_sd");
            let _ = write!(values, ", ${}, ${}", 2 * place + 5, 2 * place + 6);
        }
        let insert =
            format!("{insert}) values ({values}) on conflict (evaluation_id, sleeper) do nothing");
        let mut insert = sql(insert).bind(id).bind(&self.id).bind(self.x_m).bind(&self.flags);
        for parameter in Parameter::ALL {
            let estimate = self.estimates.get(parameter);
            insert = insert.bind(Value::Real(estimate.map(|of| of[0])));
            insert = insert.bind(Value::Real(estimate.map(|of| of[1])));
        }
        connection.execute(insert).await.map(drop)
    }
}
