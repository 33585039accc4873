//! Leases: handing cases out, keeping them, taking them back.

use crate::case::case_of;
use crate::writer::Write;
use crate::{Ending, Library, LibraryError, Policy, State};
use sqlx::{Row, SqliteConnection};
use tracktwin_parameters::Case;

/// A worker's wish for cases.
#[derive(Clone, Debug)]
pub struct LeaseRequest {
    /// The campaign.
    pub campaign: String,
    /// Only cases with a smaller index.
    pub indices_below: u32,
    /// Who asks.
    pub worker: String,
    /// Most cases wanted.
    pub cases_max: u32,
    /// The coordinator's clock.
    pub now_unix_ms: i64,
    /// How long the lease lasts without renewal.
    pub lease_ms: i64,
    /// What becomes of cases whose lease has expired.
    pub after_loss: Policy,
}

/// A case handed to a worker.
#[derive(Clone, Debug, PartialEq)]
pub struct Leased {
    /// The case.
    pub case: Case,
    /// Which lease of this case it is, from 1.
    pub epoch: u32,
}

/// A case under a certain lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Held {
    /// Place in the campaign.
    pub index: u32,
    /// Which lease of the case.
    pub epoch: u32,
}

impl Library {
    /// Hands out the first waiting cases, after expired leases have ended.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn lease(&self, request: LeaseRequest) -> Result<Vec<Leased>, LibraryError> {
        self.write(request).await
    }

    /// Lets leases last until `until_unix_ms`; answers those that are no longer the worker's.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn renew(
        &self,
        campaign: &str,
        worker: &str,
        held: Vec<Held>,
        until_unix_ms: i64,
    ) -> Result<Vec<Held>, LibraryError> {
        let (campaign, worker) = (campaign.to_owned(), worker.to_owned());
        self.write(Renew { campaign, worker, held, until_unix_ms }).await
    }

    /// Takes back cases that their worker did not begin; no attempt is counted.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release(
        &self,
        campaign: &str,
        worker: &str,
        held: Vec<Held>,
    ) -> Result<(), LibraryError> {
        let (campaign, worker) = (campaign.to_owned(), worker.to_owned());
        self.write(Release { campaign, worker, held }).await
    }

    /// Takes back every lease of a campaign; no attempt is counted.
    ///
    /// For a coordinator whose workers die with it, so that none can be alive when it starts.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release_all(&self, campaign: &str) -> Result<(), LibraryError> {
        self.write(ReleaseAll { campaign: campaign.to_owned() }).await
    }
}

impl Write for LeaseRequest {
    type Answer = Vec<Leased>;

    async fn apply(&self, connection: &mut SqliteConnection) -> Result<Vec<Leased>, LibraryError> {
        end_expired(connection, self.now_unix_ms, self.after_loss).await?;
        // The limit stands in a CTE of its own: it is evaluated once, whatever the planner does.
        let rows = sqlx::query(
            "with next as (
                select campaign_id, sobol_index from campaign_case
                where campaign_id = ? and state = 'waiting' and sobol_index < ?
                order by sobol_index limit ?)
            update campaign_case set state = 'leased', epoch = epoch + 1, worker = ?,
                lease_expires_unix_ms = ?
            from next
            where campaign_case.campaign_id = next.campaign_id
                and campaign_case.sobol_index = next.sobol_index
            returning *",
        )
        .bind(&self.campaign)
        .bind(self.indices_below)
        .bind(self.cases_max)
        .bind(&self.worker)
        .bind(self.now_unix_ms.saturating_add(self.lease_ms))
        .fetch_all(connection)
        .await?;
        let leased = |row| Ok(Leased { case: case_of(row)?, epoch: row.try_get("epoch")? });
        let mut leased = rows.iter().map(leased).collect::<Result<Vec<_>, LibraryError>>()?;
        leased.sort_by_key(|leased| leased.case.index);
        Ok(leased)
    }
}

/// Ends leases that have expired, of any campaign.
async fn end_expired(
    connection: &mut SqliteConnection,
    now_unix_ms: i64,
    policy: Policy,
) -> Result<(), LibraryError> {
    let expired: Vec<(String, u32, u32, String)> = sqlx::query_as(
        "select campaign_id, sobol_index, attempts, worker from campaign_case
        where state = 'leased' and lease_expires_unix_ms <= ?",
    )
    .bind(now_unix_ms)
    .fetch_all(&mut *connection)
    .await?;
    for (campaign, index, attempts, worker) in expired {
        let attempts = attempts + 1;
        let after = Attempted {
            attempts,
            state: policy(Ending::Lost, attempts),
            error: &format!("lease {attempts} expired: worker {worker} fell silent"),
        };
        end_attempt(connection, &campaign, index, after).await?;
    }
    Ok(())
}

/// Where an attempt without result leaves its case.
pub(crate) struct Attempted<'a> {
    pub(crate) attempts: u32,
    pub(crate) state: State,
    pub(crate) error: &'a str,
}

pub(crate) async fn end_attempt(
    connection: &mut SqliteConnection,
    campaign: &str,
    index: u32,
    after: Attempted<'_>,
) -> Result<(), LibraryError> {
    sqlx::query(
        "update campaign_case set state = ?, attempts = ?, error = ?, lease_expires_unix_ms = null
        where campaign_id = ? and sobol_index = ?",
    )
    .bind(after.state.name())
    .bind(after.attempts)
    .bind(after.error)
    .bind(campaign)
    .bind(index)
    .execute(connection)
    .await?;
    Ok(())
}

struct Renew {
    campaign: String,
    worker: String,
    held: Vec<Held>,
    until_unix_ms: i64,
}

impl Write for Renew {
    type Answer = Vec<Held>;

    async fn apply(&self, connection: &mut SqliteConnection) -> Result<Vec<Held>, LibraryError> {
        let mut lost = Vec::new();
        for &held in &self.held {
            let renewed = sqlx::query(
                "update campaign_case set lease_expires_unix_ms = ?
                where campaign_id = ? and sobol_index = ?
                    and state = 'leased' and worker = ? and epoch = ?",
            )
            .bind(self.until_unix_ms)
            .bind(&self.campaign)
            .bind(held.index)
            .bind(&self.worker)
            .bind(held.epoch)
            .execute(&mut *connection)
            .await?;
            if renewed.rows_affected() == 0 {
                lost.push(held);
            }
        }
        Ok(lost)
    }
}

struct Release {
    campaign: String,
    worker: String,
    held: Vec<Held>,
}

impl Write for Release {
    type Answer = ();

    async fn apply(&self, connection: &mut SqliteConnection) -> Result<(), LibraryError> {
        for held in &self.held {
            sqlx::query(
                "update campaign_case set state = 'waiting', lease_expires_unix_ms = null
                where campaign_id = ? and sobol_index = ?
                    and state = 'leased' and worker = ? and epoch = ?",
            )
            .bind(&self.campaign)
            .bind(held.index)
            .bind(&self.worker)
            .bind(held.epoch)
            .execute(&mut *connection)
            .await?;
        }
        Ok(())
    }
}

struct ReleaseAll {
    campaign: String,
}

impl Write for ReleaseAll {
    type Answer = ();

    async fn apply(&self, connection: &mut SqliteConnection) -> Result<(), LibraryError> {
        sqlx::query(
            "update campaign_case set state = 'waiting', lease_expires_unix_ms = null
            where campaign_id = ? and state = 'leased'",
        )
        .bind(&self.campaign)
        .execute(connection)
        .await?;
        Ok(())
    }
}
