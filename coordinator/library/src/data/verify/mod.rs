//! Verification of a library's integrity.
//!
//! Unreadable data is reported as a fault, and the verification continues with the remaining data.

mod cases;
mod file;
mod server;
mod values;

use crate::engine::{Dialect, sql};
use crate::{CampaignRecord, Library, LibraryError};
use std::error::Error;
use tokio_stream::StreamExt;

/// A fault of one kind, with the number of its occurrences.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntegrityFault {
    /// Location: id of a campaign, or name of the library.
    pub place: String,
    /// Description of the fault.
    pub what: String,
    /// Number of occurrences.
    pub count: u64,
    /// Lowest index of an affected case, if cases are affected.
    pub first_index: Option<u32>,
}

/// Result of a verification.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verified {
    /// Faults; empty for an intact library.
    pub findings: Vec<IntegrityFault>,
    /// Number of cases whose results match their checksum.
    pub attested: u64,
    /// Number of cases whose results have no checksum, so that alterations cannot be detected.
    pub unattested: u64,
    /// Parts that were not verified, each with the reason.
    pub notes: Vec<String>,
}

impl Library {
    /// Verifies the whole library: the file with `SQLite`, the schema, readability, checksums, hashes,
    /// gaps, duplicates, NaN and infinite values, and counts. Calls `looked_at` after the verification of
    /// each case with results.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if the library does not respond. Faults of the library are findings, not
    /// errors.
    pub async fn verify(&self, looked_at: impl FnMut()) -> Result<Verified, LibraryError> {
        let mut survey = Survey { library: self, found: Verified::default(), looked_at };
        match self.readers().dialect() {
            Dialect::Sqlite => survey.file().await?,
            Dialect::Postgres => survey.server().await?,
        }
        survey.tables().await?;
        match self.campaigns().await {
            Ok(campaigns) => {
                for campaign in &campaigns {
                    survey.campaign(campaign).await?;
                }
            }
            Err(error) => survey.unreadable(&self.name(), "campaigns", error)?,
        }
        Ok(survey.found)
    }
}

/// State of a verification in progress.
struct Survey<'a, F> {
    library: &'a Library,
    found: Verified,
    looked_at: F,
}

impl<F: FnMut()> Survey<'_, F> {
    fn add(&mut self, place: &str, what: impl Into<String>, count: u64, first_index: Option<u32>) {
        let (place, what) = (place.to_owned(), what.into());
        self.found.findings.push(IntegrityFault { place, what, count, first_index });
    }

    /// Adds an error of reading as a fault. Returns the error if the library is only unavailable.
    fn unreadable(
        &mut self,
        place: &str,
        what: &str,
        error: LibraryError,
    ) -> Result<(), LibraryError> {
        if error.is_temporary() || matches!(error, LibraryError::Closed) {
            return Err(error);
        }
        let reason = reason(&error);
        self.add(place, format!("{what}: unreadable: {reason}"), 1, None);
        Ok(())
    }

    async fn campaign(&mut self, campaign: &CampaignRecord) -> Result<(), LibraryError> {
        self.definition(campaign);
        self.faults(campaign).await?;
        self.cases(campaign).await?;
        self.values(campaign).await?;
        self.counts(campaign).await
    }

    fn definition(&mut self, campaign: &CampaignRecord) {
        let hashes = [
            ("definition", &campaign.definition_json, &campaign.definition_hash),
            ("experiment", &campaign.experiment_json, &campaign.experiment_hash),
        ];
        for (what, json, hash) in hashes {
            if blake3::hash(json.as_bytes()).to_hex().as_str() != hash {
                self.add(&campaign.id, format!("the {what} does not match its hash"), 1, None);
            }
        }
    }

    /// Reads every row of the tables that no other check reads completely.
    async fn tables(&mut self) -> Result<(), LibraryError> {
        for table in super::Table::ALL {
            if ["campaign", "campaign_case", "result"].contains(&table.name) {
                continue;
            }
            let library = self.library;
            let ask = format!("select {} from {}", table.column_list(), table.name);
            let mut rows = library.readers().stream(sql(ask));
            while let Some(row) = rows.next().await {
                let cells = row.and_then(|row| super::decode::table_row(table, &row));
                if let Err(error) = cells {
                    self.unreadable(&library.name(), &format!("rows of {}", table.name), error)?;
                    break;
                }
            }
        }
        Ok(())
    }
}

/// Message of the database's error, in one line.
pub(super) fn reason(error: &LibraryError) -> String {
    let mut reason = error.to_string();
    if let LibraryError::Malformed { reason: said } = error {
        reason.clone_from(said);
    }
    let mut source = error.source();
    while let Some(error) = source {
        let said = error.to_string();
        if !reason.contains(&said) {
            reason = format!("{reason}: {said}");
        }
        source = error.source();
    }
    reason.replace('\n', " ")
}

/// Number of occurrences of a fault.
#[derive(Default)]
struct Fault {
    count: u64,
    first_index: Option<u32>,
}

impl Fault {
    fn at(&mut self, index: u32) {
        self.count += 1;
        self.first_index = Some(self.first_index.map_or(index, |first| first.min(index)));
    }
}
