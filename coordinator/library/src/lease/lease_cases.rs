//! Selection of the campaign and of the cases of a lease.

use super::hold::renew;
use super::{Lease, LeaseRequest, Leased, QueueCursor};
use crate::attempt::{self, Ended};
use crate::case::case_of;
use crate::engine::{Connection, Row, Text, Write, sql};
use crate::state::Ending;
use crate::{AttemptsMax, LibraryError};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Maximum number of campaigns considered for one lease.
///
/// Usually the first one has waiting cases, unless other coordinators lease its last cases at the same
/// time.
const CAMPAIGNS_TRIED: u32 = 4;

/// Maximum number of expired leases that one lease request ends.
const EXPIRED_MAX: u32 = 500;

/// Expired leases, ordered by expiry. Leases locked by another transaction are skipped.
const EXPIRED: Text = Text::Each {
    sqlite: "
        select campaign_id, sobol_index, attempts from campaign_case
        where state = 'leased' and lease_expires_unix_ms <= $1
        order by lease_expires_unix_ms limit $2",
    postgres: "
        select campaign_id, sobol_index, attempts from campaign_case
        where state = 'leased' and lease_expires_unix_ms <= $1
        order by lease_expires_unix_ms limit $2 for update skip locked",
};

/// The $2 running campaigns of highest priority that have waiting cases; none if the worker ($1) is in
/// quarantine.
const CAMPAIGNS: &str = "
    select id from campaign
    where state = 'running'
        and not exists (select 1 from worker where id = $1 and state = 'quarantined')
        and 0 < (select coalesce(sum(cases), 0) from case_count
            where campaign_id = campaign.id and case_count.state = 'waiting')
    order by priority desc, created_at, id limit $2";

/// As [`CAMPAIGNS`], for the campaign $3 only.
const CAMPAIGN: &str = "
    select id from campaign
    where id = $3 and state = 'running'
        and not exists (select 1 from worker where id = $1 and state = 'quarantined')
        and 0 < (select coalesce(sum(cases), 0) from case_count
            where campaign_id = campaign.id and case_count.state = 'waiting')
    order by priority desc, created_at, id limit $2";

/// The first $4 waiting cases of a campaign with an index from $2 to below $3, locked until this
/// transaction ends. The statement names the index for `SQLite`, which would otherwise scan all finished
/// cases if it has no statistics.
const WAITING: Text = Text::Each {
    sqlite: "
        select * from campaign_case indexed by campaign_case_by_state
        where campaign_id = $1 and state = 'waiting' and sobol_index >= $2 and sobol_index < $3
        order by sobol_index limit $4",
    postgres: "
        select * from campaign_case
        where campaign_id = $1 and state = 'waiting' and sobol_index >= $2 and sobol_index < $3
        order by sobol_index limit $4 for update skip locked",
};

/// Leases cases ($2) of a campaign to worker $3 from $4 until $5.
const TAKE: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'leased', epoch = epoch + 1, worker = $3, leased_unix_ms = $4,
            lease_expires_unix_ms = $5
        where campaign_id = $1 and sobol_index in (select value from json_each($2))",
    postgres: "
        update campaign_case set state = 'leased', epoch = epoch + 1, worker = $3, leased_unix_ms = $4,
            lease_expires_unix_ms = $5
        where campaign_id = $1 and sobol_index = any($2)",
};

pub(super) struct LeaseCases {
    pub(super) request: LeaseRequest,
    pub(super) cursor: Arc<QueueCursor>,
}

impl Write for LeaseCases {
    type Answer = Option<Lease>;

    fn worker(&self) -> Option<&str> {
        Some(&self.request.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Option<Lease>, LibraryError> {
        let LeaseRequest { now_unix_ms, lease_ms, .. } = self.request;
        let looks_at_all = self.cursor.is_due(now_unix_ms, lease_ms);
        if looks_at_all {
            self.end_expired(connection).await?;
        }
        let lease = self.first(connection).await?;
        if lease.is_some() || looks_at_all {
            return Ok(lease);
        }
        self.cursor.forget();
        self.end_expired(connection).await?;
        self.first(connection).await
    }
}

impl LeaseCases {
    /// Ends expired leases, except those that the worker of this process is known to hold.
    async fn end_expired(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let LeaseRequest { campaign, worker, held, now_unix_ms, lease_ms, attempts_max, .. } =
            &self.request;
        if let (Some(campaign), false) = (campaign, held.is_empty()) {
            let until_unix_ms = now_unix_ms.saturating_add(*lease_ms);
            renew(connection, campaign, worker, held, until_unix_ms).await?;
        }
        end_expired(connection, *now_unix_ms, *attempts_max).await
    }

    /// Leases the first waiting cases of the campaign with the highest priority.
    async fn first(&self, connection: &mut Connection) -> Result<Option<Lease>, LibraryError> {
        for campaign in self.candidates(connection).await? {
            let cases = self.of(connection, &campaign).await?;
            if !cases.is_empty() {
                return Ok(Some(Lease { campaign, cases }));
            }
        }
        Ok(None)
    }

    /// Campaigns with waiting cases, the highest priority first.
    async fn candidates(&self, connection: &mut Connection) -> Result<Vec<String>, LibraryError> {
        let (worker, most) = (&self.request.worker, CAMPAIGNS_TRIED);
        let ask = match &self.request.campaign {
            Some(campaign) => sql(CAMPAIGN).bind(worker).bind(most).bind(campaign),
            None => sql(CAMPAIGNS).bind(worker).bind(most),
        };
        connection.rows(ask).await?.iter().map(|row| row.get("id")).collect()
    }

    /// Leases the first waiting cases of a campaign.
    async fn of(
        &self,
        connection: &mut Connection,
        campaign: &str,
    ) -> Result<Vec<Leased>, LibraryError> {
        let from = self.cursor.first_waiting(campaign);
        let waiting = self.waiting(connection, campaign, from).await?;
        let Some(last) = waiting.last() else { return Ok(Vec::new()) };
        let next = last.index() + 1;
        let (taken, passed_over) = share(waiting, self.request.alone_after);
        // What was passed over waits on.
        let first = passed_over.first().map_or(next, Waiting::index);
        self.cursor.advance(campaign, from, first);

        let LeaseRequest { worker, now_unix_ms, lease_ms, .. } = &self.request;
        let take = sql(TAKE)
            .bind(campaign)
            .bind(taken.iter().map(|it| i64::from(it.index())).collect::<Vec<_>>())
            .bind(worker)
            .bind(*now_unix_ms)
            .bind(now_unix_ms.saturating_add(*lease_ms));
        connection.execute(take).await?;
        Ok(taken.into_iter().map(|it| it.leased).collect())
    }

    /// The first waiting cases of a campaign from an index on. They are locked.
    async fn waiting(
        &self,
        connection: &mut Connection,
        campaign: &str,
        from: u32,
    ) -> Result<Vec<Waiting>, LibraryError> {
        let LeaseRequest { indices_below, cases_max, cases_max_of, .. } = &self.request;
        let cases_max = cases_max_of.get(campaign).unwrap_or(cases_max);
        let ask = sql(WAITING).bind(campaign).bind(from).bind(*indices_below).bind(*cases_max);
        let waiting = |row: &Row| {
            let leased = Leased { case: case_of(row)?, epoch: row.get_u32("epoch")? + 1 };
            Ok(Waiting { leased, attempts: row.get_u32("attempts")? })
        };
        connection.rows(ask).await?.iter().map(waiting).collect()
    }
}

/// A case to be leased.
struct Waiting {
    /// The case after it is leased.
    leased: Leased,
    attempts: u32,
}

impl Waiting {
    const fn index(&self) -> u32 {
        self.leased.case.index
    }
}

/// Splits the waiting cases into those of this lease and the others. A case with at least `alone_after`
/// attempts without result is leased alone.
fn share(mut waiting: Vec<Waiting>, alone_after: u32) -> (Vec<Waiting>, Vec<Waiting>) {
    if waiting.first().is_some_and(|first| first.attempts >= alone_after) {
        let others = waiting.split_off(1);
        return (waiting, others);
    }
    waiting.into_iter().partition(|it| it.attempts < alone_after)
}

/// A case whose lease has expired.
struct Expired {
    campaign: String,
    index: i64,
    attempts: u32,
}

/// Ends expired leases of all campaigns. It runs two statements for all cases of a campaign with the same
/// number of attempts, so that many lost workers do not delay reports.
async fn end_expired(
    connection: &mut Connection,
    now_unix_ms: i64,
    attempts_max: AttemptsMax,
) -> Result<(), LibraryError> {
    let expired = |row: &Row| {
        Ok(Expired {
            campaign: row.get("campaign_id")?,
            index: row.get("sobol_index")?,
            attempts: row.get_u32("attempts")? + 1,
        })
    };
    let rows = connection.rows(sql(EXPIRED).bind(now_unix_ms).bind(EXPIRED_MAX)).await?;
    let expired = rows.iter().map(expired).collect::<Result<Vec<_>, LibraryError>>()?;
    for ((campaign, attempts), indices) in alike(expired) {
        let ended = Ended {
            campaign: &campaign,
            indices,
            attempts,
            state: attempts_max.after(Ending::Lost, attempts),
            ending: "lost",
            error: "the lease expired: no heartbeat from its worker",
            now_unix_ms,
        };
        attempt::end(connection, ended).await?;
    }
    Ok(())
}

/// Groups expired leases by campaign and number of attempts.
fn alike(expired: Vec<Expired>) -> BTreeMap<(String, u32), Vec<i64>> {
    let mut alike = BTreeMap::<_, Vec<i64>>::new();
    for Expired { campaign, index, attempts } in expired {
        alike.entry((campaign, attempts)).or_default().push(index);
    }
    alike
}
