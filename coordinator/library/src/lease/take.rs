//! A lease: whose turn it is, and which cases.

use super::hold::renew;
use super::{Horizon, Lease, LeaseRequest, Leased};
use crate::attempt::{self, Ended};
use crate::case::case_of;
use crate::engine::{Connection, Row, Write, sql};
use crate::{Ending, LibraryError, Policy};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Campaigns that are looked at for one lease.
///
/// The first has cases to give, except where other coordinators take its last ones just now.
const CAMPAIGNS_TRIED: u32 = 4;

/// Expired leases ended with one lease; more wait for the next.
const EXPIRED_MAX: u32 = 500;

pub(super) struct Take {
    pub(super) request: LeaseRequest,
    pub(super) horizon: Arc<Horizon>,
}

impl Write for Take {
    type Answer = Option<Lease>;

    fn worker(&self) -> Option<&str> {
        Some(&self.request.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Option<Lease>, LibraryError> {
        let LeaseRequest { now_unix_ms, lease_ms, .. } = self.request;
        let looks_at_all = self.horizon.is_due(now_unix_ms, lease_ms);
        if looks_at_all {
            self.end_expired(connection).await?;
        }
        let lease = self.first(connection).await?;
        if lease.is_some() || looks_at_all {
            return Ok(lease);
        }
        self.horizon.forget();
        self.end_expired(connection).await?;
        self.first(connection).await
    }
}

impl Take {
    /// Ends leases that have expired, but for those that are known to be held.
    async fn end_expired(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let LeaseRequest { campaign, worker, held, now_unix_ms, lease_ms, after_loss, .. } =
            &self.request;
        if let (Some(campaign), false) = (campaign, held.is_empty()) {
            let until_unix_ms = now_unix_ms.saturating_add(*lease_ms);
            renew(connection, campaign, worker, held, until_unix_ms).await?;
        }
        end_expired(connection, *now_unix_ms, *after_loss).await
    }

    /// The first cases that wait, of the most urgent campaign that has some.
    async fn first(&self, connection: &mut Connection) -> Result<Option<Lease>, LibraryError> {
        for campaign in self.candidates(connection).await? {
            let cases = self.of(connection, &campaign).await?;
            if !cases.is_empty() {
                return Ok(Some(Lease { campaign, cases }));
            }
        }
        Ok(None)
    }

    /// Campaigns that have waiting cases, the most urgent first.
    async fn candidates(&self, connection: &mut Connection) -> Result<Vec<String>, LibraryError> {
        let only = if self.request.campaign.is_some() { "id = $3 and" } else { "" };
        let ask = format!(
            "select id from campaign where {only} state = 'running'
                and not exists (select 1 from worker where id = $1 and state = 'quarantined')
                and 0 < (select coalesce(sum(cases), 0) from case_count
                    where campaign_id = campaign.id and case_count.state = 'waiting')
            order by priority desc, created_at, id limit $2"
        );
        let ask = sql(ask).bind(&self.request.worker).bind(CAMPAIGNS_TRIED);
        let ask = match &self.request.campaign {
            Some(campaign) => ask.bind(campaign),
            None => ask,
        };
        connection.rows(ask).await?.iter().map(|row| row.get("id")).collect()
    }

    /// Leases the first waiting cases of a campaign.
    async fn of(
        &self,
        connection: &mut Connection,
        campaign: &str,
    ) -> Result<Vec<Leased>, LibraryError> {
        let from = self.horizon.first_waiting(campaign);
        let waiting = self.waiting(connection, campaign, from).await?;
        if waiting.is_empty() {
            return Ok(Vec::new());
        }
        let indices = share(&waiting, self.request.alone_after);
        // What was passed over waits on.
        let passed_over = waiting.iter().map(|it| it.index).find(|it| !indices.contains(it));
        let next = waiting.last().map_or(from, |last| last.index + 1);
        self.horizon.advance(campaign, from, passed_over.unwrap_or(next));

        let take = format!(
            "update campaign_case set state = 'leased', epoch = epoch + 1, worker = $3,
                leased_unix_ms = $4, lease_expires_unix_ms = $5
            where campaign_id = $1 and sobol_index {}
            returning sobol_index, railpad_stiffness_N_m, railpad_damping_N_s_m,
                ballast_stiffness_N_m, ballast_damping_N_s_m, sleeper_EI_N_m2, irregularity_level,
                surface_seed, epoch",
            connection.dialect().listed("$2")
        );
        let LeaseRequest { worker, now_unix_ms, lease_ms, .. } = &self.request;
        let take = sql(take)
            .bind(campaign)
            .bind(indices.into_iter().map(i64::from).collect::<Vec<_>>())
            .bind(worker)
            .bind(*now_unix_ms)
            .bind(now_unix_ms.saturating_add(*lease_ms));
        let leased = |row: &Row| Ok(Leased { case: case_of(row)?, epoch: row.get_u32("epoch")? });
        let rows = connection.rows(take).await?;
        let mut cases = rows.iter().map(leased).collect::<Result<Vec<_>, LibraryError>>()?;
        cases.sort_by_key(|leased| leased.case.index);
        Ok(cases)
    }

    /// A campaign's first waiting cases from a place on, which nobody else may take.
    async fn waiting(
        &self,
        connection: &mut Connection,
        campaign: &str,
        from: u32,
    ) -> Result<Vec<Waiting>, LibraryError> {
        let ask = format!(
            "select sobol_index, attempts from campaign_case {}
            where campaign_id = $1 and state = 'waiting' and sobol_index >= $2 and sobol_index < $3
            order by sobol_index limit $4 {}",
            connection.dialect().by_state(),
            connection.dialect().skipping_locked()
        );
        let ask = sql(ask)
            .bind(campaign)
            .bind(from)
            .bind(self.request.indices_below)
            .bind(self.request.cases_max);
        let waiting = |row: &Row| {
            Ok(Waiting { index: row.get_u32("sobol_index")?, attempts: row.get_u32("attempts")? })
        };
        connection.rows(ask).await?.iter().map(waiting).collect()
    }
}

/// A case to be handed out.
struct Waiting {
    index: u32,
    attempts: u32,
}

/// Which of the first waiting cases go into one lease: each of those with so many attempts without
/// result goes alone.
fn share(waiting: &[Waiting], alone_after: u32) -> Vec<u32> {
    match waiting {
        [first, ..] if first.attempts >= alone_after => vec![first.index],
        _ => waiting.iter().filter(|it| it.attempts < alone_after).map(|it| it.index).collect(),
    }
}

/// A case whose lease has expired.
struct Expired {
    campaign: String,
    index: i64,
    attempts: u32,
}

/// Ends leases that have expired, of any campaign: two statements for all cases of a campaign that
/// have the same number of attempts, so that many lost workers hold up nobody's report.
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
    let expired = |row: &Row| {
        Ok(Expired {
            campaign: row.get("campaign_id")?,
            index: row.get("sobol_index")?,
            attempts: row.get_u32("attempts")? + 1,
        })
    };
    let rows = connection.rows(sql(ask).bind(now_unix_ms).bind(EXPIRED_MAX)).await?;
    let expired = rows.iter().map(expired).collect::<Result<Vec<_>, LibraryError>>()?;
    for ((campaign, attempts), indices) in alike(expired) {
        let ended = Ended {
            campaign: &campaign,
            indices,
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

/// The cases of each campaign that have had so many attempts.
fn alike(expired: Vec<Expired>) -> BTreeMap<(String, u32), Vec<i64>> {
    let mut alike = BTreeMap::<_, Vec<i64>>::new();
    for Expired { campaign, index, attempts } in expired {
        alike.entry((campaign, attempts)).or_default().push(index);
    }
    alike
}
