//! Leases: handing cases out, keeping them, taking them back.

use crate::attempt::{self, Ended};
use crate::case::case_of;
use crate::engine::{Connection, Dialect, Row, Write, sql};
use crate::{Ending, Library, LibraryError, Policy};
use tracktwin_parameters::Case;

/// Campaigns that are looked at for one lease.
///
/// The first has cases to give, except where other coordinators take its last ones just now.
const CAMPAIGNS_TRIED: u32 = 4;

/// Expired leases ended with one lease; more wait for the next.
const EXPIRED_MAX: u32 = 500;

/// A worker's wish for cases.
#[derive(Clone, Debug)]
pub struct LeaseRequest {
    /// Only cases of this campaign; else of the running one with the largest priority, the oldest
    /// among equals.
    pub campaign: Option<String>,
    /// Only cases with a smaller index.
    pub indices_below: u32,
    /// Who asks.
    pub worker: String,
    /// Most cases wanted.
    pub cases_max: u32,
    /// The library's clock.
    pub now_unix_ms: i64,
    /// How long the lease lasts without renewal.
    pub lease_ms: i64,
    /// What becomes of cases whose lease has expired.
    pub after_loss: Policy,
    /// Attempts without result after which a case is handed out alone: if it is what ends its
    /// workers, it takes no other case with it.
    pub alone_after: u32,
}

/// Cases handed to a worker, all of one campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Lease {
    /// The campaign.
    pub campaign: String,
    /// The cases, by ascending index; at least one.
    pub cases: Vec<Leased>,
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
    /// Hands out the first waiting cases of a campaign that is running, after expired leases have
    /// ended. There are none for a worker in quarantine.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn lease(&self, request: LeaseRequest) -> Result<Option<Lease>, LibraryError> {
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
        let now_unix_ms = self.now_unix_ms();
        self.write(Release { campaign, worker, held, now_unix_ms }).await
    }

    /// Takes back every lease of a campaign; no attempt is counted.
    ///
    /// For a coordinator whose workers die with it, so that none can be alive when it starts, and
    /// that is alone: see [`crate::Claim::is_exclusive`].
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn release_all(&self, campaign: &str) -> Result<(), LibraryError> {
        let now_unix_ms = self.now_unix_ms();
        self.write(ReleaseAll { campaign: campaign.to_owned(), now_unix_ms }).await
    }
}

impl Write for LeaseRequest {
    type Answer = Option<Lease>;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Option<Lease>, LibraryError> {
        end_expired(connection, self.now_unix_ms, self.after_loss).await?;
        for campaign in self.candidates(connection).await? {
            let cases = self.take(connection, &campaign).await?;
            if !cases.is_empty() {
                return Ok(Some(Lease { campaign, cases }));
            }
        }
        Ok(None)
    }
}

impl LeaseRequest {
    /// Campaigns that have waiting cases, the most urgent first.
    async fn candidates(&self, connection: &mut Connection) -> Result<Vec<String>, LibraryError> {
        let only = if self.campaign.is_some() { "id = $4 and" } else { "" };
        let ask = format!(
            "select id from campaign where {only} state = 'running'
                and not exists (select 1 from worker where id = $1 and state = 'quarantined')
                and exists (select 1 from campaign_case {}
                    where campaign_id = campaign.id and state = 'waiting' and sobol_index < $2)
            order by priority desc, created_at, id limit $3",
            connection.dialect().by_state()
        );
        let ask = sql(ask).bind(&self.worker).bind(self.indices_below).bind(CAMPAIGNS_TRIED);
        let ask = match &self.campaign {
            Some(campaign) => ask.bind(campaign),
            None => ask,
        };
        connection.rows(ask).await?.iter().map(|row| row.get("id")).collect()
    }

    /// How many cases to take, of those with at most so many attempts without result.
    async fn share(
        &self,
        connection: &mut Connection,
        campaign: &str,
    ) -> Result<(u32, u32), LibraryError> {
        let ask = format!(
            "select attempts from campaign_case {}
            where campaign_id = $1 and state = 'waiting' and sobol_index < $2
            order by sobol_index limit 1",
            connection.dialect().by_state()
        );
        let ask = sql(ask).bind(campaign).bind(self.indices_below);
        let first = connection.rows(ask).await?;
        let attempts = first.first().map_or(Ok(0), |row| row.get_u32("attempts"))?;
        Ok(if attempts > self.alone_after {
            (1, u32::MAX)
        } else {
            (self.cases_max, self.alone_after)
        })
    }

    /// Leases the first waiting cases of a campaign.
    async fn take(
        &self,
        connection: &mut Connection,
        campaign: &str,
    ) -> Result<Vec<Leased>, LibraryError> {
        let (cases_max, attempts_max) = self.share(connection, campaign).await?;
        // The limit stands in a CTE of its own: it is evaluated once, whatever the planner does.
        let take = format!(
            "with next as (
                select campaign_id as next_campaign, sobol_index as next_index from campaign_case {}
                where campaign_id = $1 and state = 'waiting' and sobol_index < $2
                    and attempts <= $7
                order by sobol_index limit $3 {})
            update campaign_case set state = 'leased', epoch = epoch + 1, worker = $4,
                leased_unix_ms = $5, lease_expires_unix_ms = $6
            from next where campaign_id = next_campaign and sobol_index = next_index
            returning sobol_index, railpad_stiffness_N_m, railpad_damping_N_s_m,
                ballast_stiffness_N_m, ballast_damping_N_s_m, sleeper_EI_N_m2, irregularity_level,
                surface_seed, epoch",
            connection.dialect().by_state(),
            connection.dialect().skipping_locked()
        );
        let take = sql(take)
            .bind(campaign)
            .bind(self.indices_below)
            .bind(cases_max)
            .bind(&self.worker)
            .bind(self.now_unix_ms)
            .bind(self.now_unix_ms.saturating_add(self.lease_ms))
            .bind(attempts_max);
        let leased = |row: &Row| Ok(Leased { case: case_of(row)?, epoch: row.get_u32("epoch")? });
        let rows = connection.rows(take).await?;
        let mut cases = rows.iter().map(leased).collect::<Result<Vec<_>, LibraryError>>()?;
        cases.sort_by_key(|leased| leased.case.index);
        Ok(cases)
    }
}

/// Ends leases that have expired, of any campaign.
async fn end_expired(
    connection: &mut Connection,
    now_unix_ms: i64,
    policy: Policy,
) -> Result<(), LibraryError> {
    let ask = format!(
        "select campaign_id, sobol_index, attempts from campaign_case
        where state = 'leased' and lease_expires_unix_ms <= $1
        order by lease_expires_unix_ms limit $2 {}",
        connection.dialect().skipping_locked()
    );
    for row in connection.rows(sql(ask).bind(now_unix_ms).bind(EXPIRED_MAX)).await? {
        let attempts = row.get_u32("attempts")? + 1;
        let ended = Ended {
            campaign: &row.get::<String>("campaign_id")?,
            index: row.get_u32("sobol_index")?,
            attempts,
            state: policy(Ending::Lost, attempts),
            ending: "lost",
            error: "the lease expired: its worker fell silent",
            now_unix_ms,
        };
        attempt::end(connection, ended).await?;
    }
    Ok(())
}

/// That a case is worker `$2`'s under one of the leases bound as `$3` and `$4`; see [`leases`].
///
/// The indices alone stand first: by them cases are found, in both databases.
fn is_held(dialect: Dialect) -> String {
    format!(
        "campaign_id = $1 and worker = $2 and state = 'leased' and sobol_index {}
            and ((sobol_index << 32) | epoch) {}",
        dialect.listed("$3"),
        dialect.listed("$4")
    )
}

/// Indices of leases, and these with their epochs as one number each.
fn leases(held: &[Held]) -> (Vec<i64>, Vec<i64>) {
    let index = |held: &Held| i64::from(held.index);
    held.iter().map(|held| (index(held), index(held) << 32 | i64::from(held.epoch))).unzip()
}

struct Renew {
    campaign: String,
    worker: String,
    held: Vec<Held>,
    until_unix_ms: i64,
}

impl Write for Renew {
    type Answer = Vec<Held>;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Vec<Held>, LibraryError> {
        let renew = format!(
            "update campaign_case set lease_expires_unix_ms = $5 where {}
            returning sobol_index, epoch",
            is_held(connection.dialect())
        );
        let (indices, leases) = leases(&self.held);
        let renew = sql(renew)
            .bind(&self.campaign)
            .bind(&self.worker)
            .bind(indices)
            .bind(leases)
            .bind(self.until_unix_ms);
        let rows = connection.rows(renew).await?;
        let held = |row: &Row| {
            Ok(Held { index: row.get_u32("sobol_index")?, epoch: row.get_u32("epoch")? })
        };
        let renewed = rows.iter().map(held).collect::<Result<Vec<_>, LibraryError>>()?;
        Ok(self.held.iter().copied().filter(|held| !renewed.contains(held)).collect())
    }
}

struct Release {
    campaign: String,
    worker: String,
    held: Vec<Held>,
    now_unix_ms: i64,
}

impl Write for Release {
    type Answer = ();

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let theirs = is_held(connection.dialect());
        let note = format!(
            "insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms,
                ended_unix_ms, ending)
            select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $5, 'returned'
            from campaign_case where {theirs}
            on conflict (campaign_id, sobol_index, epoch) do nothing"
        );
        let end = format!(
            "update campaign_case set state = 'waiting', lease_expires_unix_ms = null
            where {theirs}"
        );
        let (indices, leases) = leases(&self.held);
        let bound = |text| {
            let (indices, leases) = (indices.clone(), leases.clone());
            sql(text).bind(&self.campaign).bind(&self.worker).bind(indices).bind(leases)
        };
        connection.execute(bound(note).bind(self.now_unix_ms)).await?;
        connection.execute(bound(end)).await.map(drop)
    }
}

struct ReleaseAll {
    campaign: String,
    now_unix_ms: i64,
}

impl Write for ReleaseAll {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        attempt::end_all(connection, &self.campaign, "abandoned", self.now_unix_ms).await
    }
}
