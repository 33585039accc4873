//! The table `campaign`.

use crate::engine::{Connection, Row, Write, sql};
use crate::library::Dated;
use crate::{Library, LibraryError, bins};

/// Stores a campaign; an existing one is kept unchanged.
const INSERT: &str = "
    insert into campaign (id, name, definition, definition_hash, experiment, experiment_hash, speeds_km_h, seed,
        created_at)
    values ($1, $2, $3, $4, $5, $6, $7, $8, $9) on conflict (id) do nothing";

/// A campaign as stored in the library.
#[derive(Clone, Debug, PartialEq)]
pub struct CampaignRecord {
    /// Id: the name and a part of the definition's hash.
    pub id: String,
    /// Name of the campaign.
    pub name: String,
    /// Definition as canonical JSON. It determines the cases and the results.
    pub definition_json: String,
    /// Hash of `definition_json`.
    pub definition_hash: String,
    /// Experiment (simulation and features of each case) as canonical JSON.
    pub experiment_json: String,
    /// Hash of `experiment_json`.
    pub experiment_hash: String,
    /// Speeds of every case in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Seed of the cases, below 2^63.
    pub seed: u64,
}

impl Library {
    /// Stores a campaign. A repeated call changes nothing.
    ///
    /// # Errors
    /// Returns [`LibraryError::OtherDefinition`] if the id already exists with another definition.
    pub async fn insert_campaign(&self, campaign: &CampaignRecord) -> Result<(), LibraryError> {
        self.write_dated(campaign.clone()).await
    }

    /// All campaigns, oldest first.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn campaigns(&self) -> Result<Vec<CampaignRecord>, LibraryError> {
        let rows =
            self.readers().rows(sql("select * from campaign order by created_at, id")).await?;
        rows.iter().map(record).collect()
    }

    /// The campaign with this id.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownCampaign`] if there is no such campaign.
    pub async fn campaign(&self, id: &str) -> Result<CampaignRecord, LibraryError> {
        let row = self.readers().row(sql("select * from campaign where id = $1").bind(id)).await?;
        row.as_ref()
            .map_or_else(|| Err(LibraryError::UnknownCampaign { id: id.to_owned() }), record)
    }
}

/// Converts a seed to a signed integer of SQL.
pub(crate) fn sql_seed(seed: u64) -> Result<i64, LibraryError> {
    i64::try_from(seed).map_err(|_| LibraryError::SeedTooLarge { seed })
}

pub(crate) fn seed_from_sql(seed: i64) -> Result<u64, LibraryError> {
    u64::try_from(seed).map_err(|_| LibraryError::Damaged { what: format!("a seed of {seed}") })
}

fn record(row: &Row) -> Result<CampaignRecord, LibraryError> {
    let id: String = row.get("id")?;
    let speeds: String = row.get("speeds_km_h")?;
    let speeds_km_h = serde_json::from_str(&speeds).map_err(|error| LibraryError::Damaged {
        what: format!("campaign {id}: speeds_km_h: {error}"),
    })?;
    Ok(CampaignRecord {
        id,
        name: row.get("name")?,
        definition_json: row.get("definition")?,
        definition_hash: row.get("definition_hash")?,
        experiment_json: row.get("experiment")?,
        experiment_hash: row.get("experiment_hash")?,
        speeds_km_h,
        seed: seed_from_sql(row.get("seed")?)?,
    })
}

impl Write for Dated<CampaignRecord> {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let campaign = &self.it;
        let speeds = serde_json::to_string(&campaign.speeds_km_h).expect("numbers become JSON");
        let insert = sql(INSERT)
            .bind(&campaign.id)
            .bind(&campaign.name)
            .bind(&campaign.definition_json)
            .bind(&campaign.definition_hash)
            .bind(&campaign.experiment_json)
            .bind(&campaign.experiment_hash)
            .bind(speeds)
            .bind(sql_seed(campaign.seed)?)
            .bind(&self.at);
        connection.execute(insert).await?;
        let ask = sql("select definition_hash from campaign where id = $1").bind(&campaign.id);
        let stored = connection.row(ask).await?.map(|row| row.get::<String>("definition_hash"));
        if stored.transpose()?.as_ref() == Some(&campaign.definition_hash) {
            bins::insert(connection, campaign).await
        } else {
            Err(LibraryError::OtherDefinition { id: campaign.id.clone() })
        }
    }
}
