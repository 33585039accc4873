//! What people decide about campaigns: whether and in which order their cases are handed out, and
//! which are tried again.

use crate::attempt;
use crate::engine::{Connection, Write, sql};
use crate::{CampaignState, Library, LibraryError, result};

/// Which cases are tried again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Retry {
    /// All that were given up.
    Failed,
    /// Those of these indices that were given up.
    Cases(Vec<u32>),
    /// All whose results were flagged; the results are thrown away.
    Flagged,
}

impl Library {
    /// Hands out no more cases of a campaign; those in work are finished.
    ///
    /// # Errors
    /// [`LibraryError::UnknownCampaign`], or when the library cannot be written.
    pub async fn pause(&self, campaign: &str) -> Result<(), LibraryError> {
        self.set_state(campaign, CampaignState::Paused).await
    }

    /// Hands out the cases of a paused or cancelled campaign again.
    ///
    /// # Errors
    /// [`LibraryError::UnknownCampaign`], or when the library cannot be written.
    pub async fn resume(&self, campaign: &str) -> Result<(), LibraryError> {
        self.set_state(campaign, CampaignState::Running).await
    }

    /// Hands out no more cases of a campaign and takes back those in work; workers are told when
    /// they renew. What is stored stays, and a result that still comes is taken.
    ///
    /// # Errors
    /// [`LibraryError::UnknownCampaign`], or when the library cannot be written.
    pub async fn cancel(&self, campaign: &str) -> Result<(), LibraryError> {
        self.set_state(campaign, CampaignState::Cancelled).await
    }

    async fn set_state(&self, campaign: &str, state: CampaignState) -> Result<(), LibraryError> {
        let now_unix_ms = self.now_unix_ms();
        self.write(SetState { campaign: campaign.to_owned(), state, now_unix_ms }).await
    }

    /// Sets a campaign's priority: cases of the largest are handed out first; 0 is the usual.
    ///
    /// # Errors
    /// [`LibraryError::UnknownCampaign`], or when the library cannot be written.
    pub async fn set_priority(&self, campaign: &str, priority: i32) -> Result<(), LibraryError> {
        self.write(SetPriority { campaign: campaign.to_owned(), priority }).await
    }

    /// Lets cases be tried again as if for the first time; answers how many.
    ///
    /// # Errors
    /// [`LibraryError::UnknownCampaign`], or when the library cannot be written.
    pub async fn retry(&self, campaign: &str, which: Retry) -> Result<u64, LibraryError> {
        self.campaign(campaign).await?;
        self.write(RetryCases { campaign: campaign.to_owned(), which }).await
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

struct RetryCases {
    campaign: String,
    which: Retry,
}

impl Write for RetryCases {
    type Answer = u64;

    async fn apply(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        match &self.which {
            Retry::Failed => {
                let again = "update campaign_case set state = 'waiting', attempts = 0, error = null
                    where campaign_id = $1 and state = 'failed'";
                connection.execute(sql(again).bind(&self.campaign)).await
            }
            Retry::Cases(indices) => {
                let again = format!(
                    "update campaign_case set state = 'waiting', attempts = 0, error = null
                    where campaign_id = $1 and state = 'failed' and sobol_index {}",
                    connection.dialect().listed("$2")
                );
                let indices: Vec<i64> = indices.iter().copied().map(i64::from).collect();
                connection.execute(sql(again).bind(&self.campaign).bind(indices)).await
            }
            Retry::Flagged => self.discard_flagged(connection).await,
        }
    }
}

impl RetryCases {
    async fn discard_flagged(&self, connection: &mut Connection) -> Result<u64, LibraryError> {
        let dialect = connection.dialect();
        let results = result::table(dialect);
        // What is flagged after this waits for the next retry.
        let flagged = format!(
            "select sobol_index from campaign_case
            where campaign_id = $1 and state = 'finished' and sobol_index in (
                select sobol_index from {results} where campaign_id = $1 and flagged is not null)
            order by sobol_index {}",
            dialect.locking()
        );
        let flagged = connection.indices(sql(flagged).bind(&self.campaign)).await?;
        let again = "update campaign_case set state = 'waiting', attempts = 0, error = null";
        // Their audits looked at results that are no more.
        let discard = ["audit", results].map(|table| format!("delete from {table}"));
        for change in [again].into_iter().chain(discard.iter().map(String::as_str)) {
            let change =
                format!("{change} where campaign_id = $1 and sobol_index {}", dialect.listed("$2"));
            connection.execute(sql(change).bind(&self.campaign).bind(flagged.clone())).await?;
        }
        Ok(flagged.len() as u64)
    }
}
