//! The table `frequency_bin`: frequencies of the bins of results.

use crate::engine::{Connection, Row, Statement, Write, sql};
use crate::{CampaignRecord, Library, LibraryError};
use tracktwin_signal::FeatureDefinition;

/// Maximum number of bins in one statement; each has three values.
const BINS_A_STATEMENT: usize = 1000;

/// Frequencies of the bins of an experiment in Hz; empty if this version cannot read the experiment.
fn frequencies_hz(experiment_json: &str) -> Vec<f64> {
    let experiment = serde_json::from_str::<serde_json::Value>(experiment_json).ok();
    let features =
        experiment.and_then(|mut it| it.get_mut("features").map(serde_json::Value::take));
    let features = features.and_then(|it| serde_json::from_value::<FeatureDefinition>(it).ok());
    features.map(|features| features.frequencies_hz()).unwrap_or_default()
}

/// Stores the frequency bins of a campaign's experiment.
pub(crate) async fn insert(
    connection: &mut Connection,
    campaign: &CampaignRecord,
) -> Result<(), LibraryError> {
    let bins: Vec<_> = (0_u32..).zip(frequencies_hz(&campaign.experiment_json)).collect();
    for some in bins.chunks(BINS_A_STATEMENT) {
        let insert = format!(
            "insert into frequency_bin (experiment_hash, bin, frequency_Hz) values {}
            on conflict (experiment_hash, bin) do nothing",
            connection.dialect().rows_of_values(some.len(), 3)
        );
        let bound = |insert: Statement, &(bin, frequency_hz): &(u32, f64)| {
            insert.bind(&campaign.experiment_hash).bind(bin).bind(frequency_hz)
        };
        connection.execute(some.iter().fold(sql(insert), bound)).await?;
    }
    Ok(())
}

impl Library {
    /// Adds the bins of campaigns that were stored before this table existed.
    pub(crate) async fn add_missing_bins(&self) -> Result<(), LibraryError> {
        let ask = "select id, experiment from campaign
            where experiment_hash not in (select experiment_hash from frequency_bin)";
        for row in self.readers().rows(sql(ask)).await? {
            if has_bins(&row)? {
                let campaign = self.campaign(&row.get::<String>("id")?).await?;
                self.write(Bins(campaign)).await?;
            }
        }
        Ok(())
    }
}

fn has_bins(campaign: &Row) -> Result<bool, LibraryError> {
    Ok(!frequencies_hz(&campaign.get::<String>("experiment")?).is_empty())
}

struct Bins(CampaignRecord);

impl Write for Bins {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        insert(connection, &self.0).await
    }
}
