//! A stored case, assembled from its passes, with its checksum.

use super::columns::levels_of;
use super::entry::LibraryEntry;
use crate::case::case_of;
use crate::engine::{Row, Statement, sql};
use crate::{Library, LibraryError};
use tokio_stream::StreamExt;
use tracktwin_experiment::PassFeatures;
use tracktwin_parameters::Case;
use tracktwin_protocol::checksum_of_passes;
use tracktwin_signal::Features;

/// A case with results, as stored.
pub(crate) struct StoredCase {
    pub(crate) case: Case,
    /// The passes, one per speed.
    pub(crate) passes: Vec<PassFeatures>,
    /// Checksum of the worker; `None` if a version without checksums stored the result.
    checksum: Option<String>,
    /// Version of the physics that computed the results.
    pub(crate) model_hash: String,
    /// Reason of the flag, if the results are flagged.
    pub(super) flagged: Option<String>,
}

/// Result of comparing stored data with the checksum of their worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Attested {
    /// The checksums are equal.
    Whole,
    /// The checksums differ: the data were altered after storing.
    Altered,
    /// No checksum was stored.
    Unknown,
}

impl StoredCase {
    fn of(row: &Row) -> Result<Self, LibraryError> {
        let (case, passes) = (case_of(row)?, vec![pass_of(row)?]);
        let (checksum, model_hash) = (row.get("checksum")?, row.get("model_hash")?);
        Ok(Self { case, passes, checksum, model_hash, flagged: row.get("flagged")? })
    }

    fn add(&mut self, row: &Row) -> Result<(), LibraryError> {
        self.passes.push(pass_of(row)?);
        if self.flagged.is_none() {
            self.flagged = row.get("flagged")?;
        }
        // One pass of another checksum speaks against all.
        if row.get::<Option<String>>("checksum")? != self.checksum {
            self.checksum = Some(String::new());
        }
        Ok(())
    }

    /// Computes the checksum of the stored data: parameters, seed and every pass.
    pub(crate) fn checksum(&self) -> String {
        checksum_of_passes(self.case.index, &self.case.parameter_hash(), &self.passes)
    }

    pub(crate) fn attested(&self) -> Attested {
        match &self.checksum {
            None => Attested::Unknown,
            Some(told) if *told == self.checksum() => Attested::Whole,
            Some(_) => Attested::Altered,
        }
    }

    /// Returns the case and its features, or [`LibraryError::Altered`].
    pub(super) fn entry(self) -> Result<LibraryEntry, LibraryError> {
        if self.attested() == Attested::Altered {
            return Err(LibraryError::Altered { index: self.case.index });
        }
        let features = self.passes.into_iter().map(|pass| pass.features).collect();
        Ok(LibraryEntry { case: self.case, features })
    }
}

fn pass_of(row: &Row) -> Result<PassFeatures, LibraryError> {
    // A series that a server has lost is one of no numbers, so that its case does not have its checksum.
    let log_power = row.doubles_if_there("log_power")?.unwrap_or_default();
    Ok(PassFeatures {
        speed_km_h: row.get("speed_km_h")?,
        features: Features { log_power, band_levels_db: levels_of(row)? },
        contact_loss_share: row.get("contact_loss_share")?,
    })
}

/// Statement that selects the passes of a campaign's cases, in the order that [`Gathering`] requires.
pub(crate) fn passes_of(campaign: &str) -> Statement {
    let ask = "select * from result_with_parameters where campaign_id = $1
        order by sobol_index, speed_km_h";
    sql(ask).bind(campaign)
}

/// Assembles cases from rows of `result_with_parameters` of one campaign, ordered by index and speed.
#[derive(Default)]
pub(crate) struct Gathering(Option<StoredCase>);

impl Gathering {
    /// Adds a row. If the row belongs to a new case, returns the completed previous case.
    pub(crate) fn take(&mut self, row: &Row) -> Result<Option<StoredCase>, LibraryError> {
        match &mut self.0 {
            Some(case) if case.case.index == row.get_u32("sobol_index")? => {
                case.add(row)?;
                Ok(None)
            }
            before => Ok(before.replace(StoredCase::of(row)?)),
        }
    }

    /// Returns the last case.
    pub(crate) fn end(self) -> Option<StoredCase> {
        self.0
    }
}

impl Library {
    /// Passes each case with results of a campaign to `take`, by ascending index.
    pub(crate) async fn stored_cases(
        &self,
        campaign: &str,
        mut take: impl FnMut(StoredCase) -> Result<(), LibraryError>,
    ) -> Result<(), LibraryError> {
        let mut rows = self.readers().stream(passes_of(campaign));
        let mut gathering = Gathering::default();
        while let Some(row) = rows.next().await {
            if let Some(case) = gathering.take(&row?)? {
                take(case)?;
            }
        }
        gathering.end().map_or(Ok(()), take)
    }
}
