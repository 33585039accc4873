//! Single results: one entry, the newest entries, and the covered part of the parameter space.

use crate::case::case_of;
use crate::engine::sql;
use crate::result::features_of;
use crate::{Library, LibraryEntry, LibraryError};
use tracktwin_parameters::ParameterSet;

impl Library {
    /// Returns a finished case with its features; `None` if the case has no results.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn entry(
        &self,
        campaign: &str,
        index: u32,
    ) -> Result<Option<LibraryEntry>, LibraryError> {
        let ask = "select * from result_with_parameters where campaign_id = $1 and sobol_index = $2
            order by speed_km_h";
        let rows = self.readers().rows(sql(ask).bind(campaign).bind(index)).await?;
        let Some(first) = rows.first() else { return Ok(None) };
        let features = rows.iter().map(features_of).collect::<Result<_, _>>()?;
        Ok(Some(LibraryEntry { case: case_of(first)?, features }))
    }

    /// Returns the finished cases with the largest indices, with their features at the highest speed only.
    /// Cases are leased in order of index, so these are approximately the newest.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn newest(
        &self,
        campaign: &str,
        limit: u32,
    ) -> Result<Vec<LibraryEntry>, LibraryError> {
        let fastest = self.fastest(campaign).await?;
        let ask = "select * from result_with_parameters
            where campaign_id = $1 and speed_km_h = $2 order by sobol_index desc limit $3";
        let ask = sql(ask).bind(campaign).bind(fastest).bind(limit);
        let rows = self.readers().rows(ask).await?;
        let entry =
            |row| Ok(LibraryEntry { case: case_of(row)?, features: vec![features_of(row)?] });
        rows.iter().map(entry).collect()
    }

    /// Returns the parameters of the first `limit` finished cases. Any first part of a Sobol sequence
    /// covers the parameter space evenly.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn covered(
        &self,
        campaign: &str,
        limit: u32,
    ) -> Result<Vec<ParameterSet>, LibraryError> {
        let fastest = self.fastest(campaign).await?;
        let ask = "select campaign_case.* from result
            join campaign_case using (campaign_id, sobol_index)
            where campaign_id = $1 and speed_km_h = $2 order by sobol_index limit $3";
        let ask = sql(ask).bind(campaign).bind(fastest).bind(limit);
        let rows = self.readers().rows(ask).await?;
        rows.iter().map(|row| case_of(row).map(|case| case.parameters)).collect()
    }

    async fn fastest(&self, campaign: &str) -> Result<f64, LibraryError> {
        let speeds = self.campaign(campaign).await?.speeds_km_h;
        let none = || LibraryError::Damaged { what: format!("campaign {campaign} has no speed") };
        speeds.last().copied().ok_or_else(none)
    }
}
