//! The tables `training` and `surrogate`.

use crate::engine::{Connection, Write, sql};
use crate::library::Dated;
use crate::{Library, LibraryError};
use tracktwin_parameters::Parameter;

/// Stores a training; an existing one is kept unchanged.
const INSERT: &str = "
    insert into training (id, campaign_id, library_digest, cases, seed, code_version, created_at)
    values ($1, $2, $3, $4, $5, $6, $7) on conflict (id) do nothing";

/// Stores the accuracy of a surrogate of a training.
const INSERT_SURROGATE: &str = "
    insert into surrogate (training_id, feature, speeds_km_h, parameter, mase_test, mase_folds, coverage_90_test)
    values ($1, $2, $3, $4, $5, $6, $7)
    on conflict (training_id, feature, speeds_km_h, parameter) do nothing";

/// A training: surrogates that were trained together.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingRecord {
    /// Id of the campaign on which they were trained.
    pub campaign: String,
    /// Digest of the campaign at the time of training.
    pub library_digest: String,
    /// Number of cases, including those of the test set.
    pub cases: u32,
    /// Seed of the split into training set and test set; below 2^63.
    pub seed: u64,
    /// Version of the program that trained the surrogates.
    pub code_version: String,
    /// Accuracy of each surrogate.
    pub surrogates: Vec<SurrogateRecord>,
}

/// Accuracy of a surrogate on cases that it was not trained on.
#[derive(Clone, Debug, PartialEq)]
pub struct SurrogateRecord {
    /// Name of the feature set that the surrogate uses.
    pub feature: String,
    /// Speeds that the surrogate combines, in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Parameter that the surrogate estimates.
    pub parameter: Parameter,
    /// Mean absolute error on the test set, divided by the parameter's range (paper, eq. 11).
    pub mase_test: f64,
    /// As `mase_test`, over the cross-validation folds of the training set.
    pub mase_folds: f64,
    /// Share of the test cases with the true value inside the 90 % interval, 0 to 1.
    pub coverage_90_test: f64,
}

impl Library {
    /// Stores the accuracy of a training and returns the id of the training. An existing one is kept
    /// unchanged.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn record_training(&self, record: TrainingRecord) -> Result<String, LibraryError> {
        self.write_dated(record).await
    }
}

impl TrainingRecord {
    fn id(&self) -> String {
        let Self { campaign, library_digest, seed, code_version, surrogates, .. } = self;
        let scores: Vec<_> = surrogates
            .iter()
            .map(|it| {
                format!("{} {:?} {} {}", it.feature, it.speeds_km_h, it.parameter, it.mase_test)
            })
            .collect();
        let texts = [campaign, library_digest, &seed.to_string(), code_version, &scores.join("\n")];
        super::id("tracktwin training 1", &texts.map(String::as_str))
    }
}

impl Write for Dated<TrainingRecord> {
    type Answer = String;

    async fn apply(&self, connection: &mut Connection) -> Result<String, LibraryError> {
        let record = &self.it;
        let id = record.id();
        let insert = sql(INSERT)
            .bind(&id)
            .bind(&record.campaign)
            .bind(&record.library_digest)
            .bind(record.cases)
            .bind(crate::campaign::sql_seed(record.seed)?)
            .bind(&record.code_version)
            .bind(&self.at);
        connection.execute(insert).await?;
        for it in &record.surrogates {
            let speeds = serde_json::to_string(&it.speeds_km_h).expect("numbers become JSON");
            let insert = sql(INSERT_SURROGATE)
                .bind(&id)
                .bind(&it.feature)
                .bind(speeds)
                .bind(it.parameter.name())
                .bind(it.mase_test)
                .bind(it.mase_folds)
                .bind(it.coverage_90_test);
            connection.execute(insert).await?;
        }
        Ok(id)
    }
}
