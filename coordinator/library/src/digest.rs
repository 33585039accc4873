//! One hash over everything a campaign has found.

use crate::case::case_of;
use crate::engine::sql;
use crate::result::LEVEL_COLUMNS;
use crate::{Library, LibraryError};
use tokio_stream::StreamExt;

impl Library {
    /// BLAKE3 (hexadecimal) over all results of a campaign by index and speed: parameters, seed and
    /// features, to the bit. Equal campaigns have equal digests whoever simulated them, in whatever
    /// order, and in whichever database.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read or has no such campaign.
    pub async fn digest(&self, campaign: &str) -> Result<String, LibraryError> {
        self.campaign(campaign).await?;
        let mut hasher = blake3::Hasher::new_derive_key("tracktwin library digest 1");
        let ask = "select * from result_with_parameters where campaign_id = $1
            order by sobol_index, speed_km_h";
        let mut rows = self.readers().stream(sql(ask).bind(campaign));
        while let Some(row) = rows.next().await {
            let row = row?;
            let case = case_of(&row)?;
            hasher.update(&case.index.to_be_bytes()).update(&case.surface_seed.to_be_bytes());
            for value in case.parameters.values() {
                hasher.update(&value.to_be_bytes());
            }
            for column in ["speed_km_h"].iter().chain(&LEVEL_COLUMNS) {
                hasher.update(&row.get::<f64>(column)?.to_be_bytes());
            }
            let log_power = row.doubles("log_power")?;
            // The length in bytes keeps neighbouring fields apart.
            hasher.update(&(8 * log_power.len() as u64).to_be_bytes());
            for value in log_power {
                hasher.update(&value.to_be_bytes());
            }
        }
        Ok(hasher.finalize().to_hex().to_string())
    }
}
