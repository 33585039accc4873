//! Control of campaigns: pause, resume, cancel, priority and retry.

use crate::attempt;
use crate::engine::{Connection, Text, Write, sql};
use crate::result::{Attested, StoredCase};
use crate::{CampaignState, Library, LibraryError, result};
use std::collections::BTreeMap;

/// Sets all given-up cases of a campaign to waiting, with zero attempts.
const RETRY_FAILED: &str = "
    update campaign_case set state = 'waiting', attempts = 0, error = null
    where campaign_id = $1 and state = 'failed'";

/// As [`RETRY_FAILED`], for the cases in $2 only.
const RETRY_CASES: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'waiting', attempts = 0, error = null
        where campaign_id = $1 and state = 'failed' and sobol_index in (select value from json_each($2))",
    postgres: "
        update campaign_case set state = 'waiting', attempts = 0, error = null
        where campaign_id = $1 and state = 'failed' and sobol_index = any($2)",
};

/// Finished cases with flagged results. Results that are flagged later are left to the next retry.
const FLAGGED: Text = Text::Each {
    sqlite: "
        select sobol_index from campaign_case
        where campaign_id = $1 and state = 'finished' and sobol_index in (
            select sobol_index from result where campaign_id = $1 and flagged is not null)
        order by sobol_index",
    postgres: "
        select sobol_index from campaign_case
        where campaign_id = $1 and state = 'finished' and sobol_index in (
            select sobol_index from case_result where campaign_id = $1 and flagged is not null)
        order by sobol_index for update",
};

/// Deletes the audits of cases.
const DISCARD_AUDITS: Text = Text::Each {
    sqlite: "delete from audit where campaign_id = $1 and sobol_index in (select value from json_each($2))",
    postgres: "delete from audit where campaign_id = $1 and sobol_index = any($2)",
};

/// Sets finished cases to waiting.
const RETRY_FINISHED: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'waiting', attempts = 0, error = null
        where campaign_id = $1 and state = 'finished' and sobol_index in (select value from json_each($2))",
    postgres: "
        update campaign_case set state = 'waiting', attempts = 0, error = null
        where campaign_id = $1 and state = 'finished' and sobol_index = any($2)",
};

/// Cases that have results but are not finished.
const INCOMPLETE: &str = "
    select distinct campaign_id, sobol_index from result join campaign_case using (campaign_id, sobol_index)
    where state <> 'finished' order by campaign_id, sobol_index";

/// Selection of the cases that are simulated again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Retry {
    /// All given-up cases.
    Failed,
    /// The given-up cases among these indices.
    Cases(Vec<u32>),
    /// All cases with flagged results. The results are deleted.
    Flagged,
    /// All cases whose results do not match their checksum. The results are deleted.
    Altered,
    /// All cases whose results have another model hash than this one. The results are deleted.
    OtherModel(String),
}

impl Library {
    /// Pauses a campaign: workers finish leased cases, and no further cases are leased.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownCampaign`], or an error if the library cannot be written.
    pub async fn pause(&self, campaign: &str) -> Result<(), LibraryError> {
        self.set_state(campaign, CampaignState::Paused).await
    }

    /// Resumes a paused or cancelled campaign: its waiting cases are leased again.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownCampaign`], or an error if the library cannot be written.
    pub async fn resume(&self, campaign: &str) -> Result<(), LibraryError> {
        self.set_state(campaign, CampaignState::Running).await
    }

    /// Cancels a campaign: its leases end, and no further cases are leased. A worker is informed when it
    /// renews its leases. Stored results are kept, and late results are still accepted.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownCampaign`], or an error if the library cannot be written.
    pub async fn cancel(&self, campaign: &str) -> Result<(), LibraryError> {
        self.set_state(campaign, CampaignState::Cancelled).await
    }

    /// The state of a campaign.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownCampaign`], or an error if the library cannot be read.
    pub async fn campaign_state(&self, campaign: &str) -> Result<CampaignState, LibraryError> {
        let read = sql("select state from campaign where id = $1").bind(campaign);
        let rows = self.readers().rows(read).await?;
        let unknown = || LibraryError::UnknownCampaign { id: campaign.to_owned() };
        CampaignState::from_name(&rows.first().ok_or_else(unknown)?.get::<String>("state")?)
    }

    async fn set_state(&self, campaign: &str, state: CampaignState) -> Result<(), LibraryError> {
        let now_unix_ms = self.now_unix_ms();
        self.write(SetState { campaign: campaign.to_owned(), state, now_unix_ms }).await
    }

    /// Sets the priority of a campaign: cases of the highest priority are leased first; 0 is the
    /// default.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownCampaign`], or an error if the library cannot be written.
    pub async fn set_priority(&self, campaign: &str, priority: i32) -> Result<(), LibraryError> {
        self.write(SetPriority { campaign: campaign.to_owned(), priority }).await
    }

    /// Sets the selected cases to waiting, with zero attempts. Returns the number of these cases.
    ///
    /// # Errors
    /// Returns [`LibraryError::UnknownCampaign`], or an error if the library cannot be read or written.
    pub async fn retry(&self, campaign: &str, which: Retry) -> Result<u64, LibraryError> {
        self.campaign(campaign).await?;
        match which {
            Retry::Altered => {
                self.discard_cases(campaign, |it| it.attested() == Attested::Altered).await
            }
            Retry::OtherModel(own) => self.discard_cases(campaign, |it| it.model_hash != own).await,
            Retry::Flagged => self.write(DiscardFlagged { campaign: campaign.to_owned() }).await,
            Retry::Failed => self.retry_failed(campaign, None).await,
            Retry::Cases(indices) => self.retry_failed(campaign, Some(indices)).await,
        }
    }

    /// Sets given-up cases to waiting: those of these indices, or all.
    async fn retry_failed(
        &self,
        campaign: &str,
        indices: Option<Vec<u32>>,
    ) -> Result<u64, LibraryError> {
        let indices = indices.map(|it| it.into_iter().map(i64::from).collect());
        self.write(RetryFailed { campaign: campaign.to_owned(), indices }).await
    }

    /// Deletes the results of cases that `is_meant` selects, so that they are simulated again.
    async fn discard_cases(
        &self,
        campaign: &str,
        is_meant: impl Fn(&StoredCase) -> bool,
    ) -> Result<u64, LibraryError> {
        let mut indices = Vec::new();
        let look = |case: StoredCase| {
            if is_meant(&case) {
                indices.push(i64::from(case.case.index));
            }
            Ok(())
        };
        self.stored_cases(campaign, look).await?;
        self.write(Discard { campaign: campaign.to_owned(), indices }).await
    }

    /// Removes the results of cases whose passes are incomplete. Returns the number of these cases. A
    /// completed copy of a library contains such cases if some of their rows could not be read.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read or written.
    pub async fn discard_incomplete(&self) -> Result<u64, LibraryError> {
        let mut of_campaign: BTreeMap<String, Vec<i64>> = BTreeMap::new();
        for row in self.readers().rows(sql(INCOMPLETE)).await? {
            of_campaign.entry(row.get("campaign_id")?).or_default().push(row.get("sobol_index")?);
        }
        let mut count = 0;
        for (campaign, indices) in of_campaign {
            count += self.write(Discard { campaign, indices }).await?;
        }
        Ok(count)
    }
}

fn found(changed: u64, campaign: &str) -> Result<(), LibraryError> {
    if changed == 0 {
        return Err(LibraryError::UnknownCampaign { id: campaign.to_owned() });
    }
    Ok(())
}

struct SetState {
    campaign: String,
    state: CampaignState,
    now_unix_ms: i64,
}

impl Write for SetState {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let set = sql("update campaign set state = $1 where id = $2")
            .bind(self.state.name())
            .bind(&self.campaign);
        found(connection.execute(set).await?, &self.campaign)?;
        if self.state == CampaignState::Cancelled {
            attempt::end_all(connection, &self.campaign, "cancelled", self.now_unix_ms).await?;
        }
        Ok(())
    }
}

struct SetPriority {
    campaign: String,
    priority: i32,
}

impl Write for SetPriority {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let set = sql("update campaign set priority = $1 where id = $2")
            .bind(i64::from(self.priority))
            .bind(&self.campaign);
        found(connection.execute(set).await?, &self.campaign)
    }
}

struct RetryFailed {
    campaign: String,
    /// The cases; `None` for all.
    indices: Option<Vec<i64>>,
}

impl Write for RetryFailed {
    type Answer = u64;

    async fn apply(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        let retry = match &self.indices {
            None => sql(RETRY_FAILED).bind(&self.campaign),
            Some(indices) => sql(RETRY_CASES).bind(&self.campaign).bind(indices.clone()),
        };
        connection.execute(retry).await
    }
}

/// Deletes flagged results, so that their cases are simulated again.
struct DiscardFlagged {
    campaign: String,
}

impl Write for DiscardFlagged {
    type Answer = u64;

    async fn apply(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        let flagged = connection.indices(sql(FLAGGED).bind(&self.campaign)).await?;
        discard(connection, &self.campaign, &flagged).await
    }
}

/// Deletes results, so that the cases are simulated again.
struct Discard {
    campaign: String,
    indices: Vec<i64>,
}

impl Write for Discard {
    type Answer = u64;

    async fn apply(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        discard(connection, &self.campaign, &self.indices).await
    }
}

async fn discard(
    connection: &mut Connection,
    campaign: &str,
    indices: &[i64],
) -> Result<u64, LibraryError> {
    // Audits of deleted results.
    for change in [DISCARD_AUDITS, RETRY_FINISHED] {
        connection.execute(sql(change).bind(campaign).bind(indices.to_vec())).await?;
    }
    result::discard(connection, campaign, indices).await?;
    Ok(indices.len() as u64)
}
