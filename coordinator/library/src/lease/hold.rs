//! Leases of a worker: renewal and release.

use super::Held;
use crate::engine::{Connection, Row, Statement, Text, Write, sql};
use crate::{LibraryError, attempt};
use std::collections::HashSet;

// In these statements the leases of worker $2 are given twice: $3 holds the indices of their cases,
// and $4 these with their epochs, as one number each. The indices come first, because both
// databases find the cases by them.

/// Extends leases until $5.
const RENEW: Text = Text::Each {
    sqlite: "
        update campaign_case set lease_expires_unix_ms = $5
        where campaign_id = $1 and worker = $2 and state = 'leased'
            and sobol_index in (select value from json_each($3))
            and ((sobol_index << 32) | epoch) in (select value from json_each($4))
        returning sobol_index, epoch",
    postgres: "
        update campaign_case set lease_expires_unix_ms = $5
        where campaign_id = $1 and worker = $2 and state = 'leased'
            and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)
        returning sobol_index, epoch",
};

/// Leases that their worker ended itself: it reported a result or a failure, or released the case.
const ENDED_BY_THE_WORKER: Text = Text::Each {
    sqlite: "
        select sobol_index, epoch from campaign_case
        where campaign_id = $1 and worker = $2 and state = 'finished'
            and sobol_index in (select value from json_each($3))
            and ((sobol_index << 32) | epoch) in (select value from json_each($4))
        union
        select sobol_index, epoch from attempt
        where campaign_id = $1 and worker = $2 and ending in ('failed', 'returned')
            and sobol_index in (select value from json_each($3))
            and ((sobol_index << 32) | epoch) in (select value from json_each($4))",
    postgres: "
        select sobol_index, epoch from campaign_case
        where campaign_id = $1 and worker = $2 and state = 'finished'
            and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)
        union
        select sobol_index, epoch from attempt
        where campaign_id = $1 and worker = $2 and ending in ('failed', 'returned')
            and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)",
};

/// Records that the worker released these leases at $5.
const NOTE_RETURN: Text = Text::Each {
    sqlite: "
        insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $5, 'returned', null
        from campaign_case
        where campaign_id = $1 and worker = $2 and state = 'leased'
            and sobol_index in (select value from json_each($3))
            and ((sobol_index << 32) | epoch) in (select value from json_each($4))
        on conflict (campaign_id, sobol_index, epoch) do nothing",
    postgres: "
        insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $5, 'returned', null
        from campaign_case
        where campaign_id = $1 and worker = $2 and state = 'leased'
            and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)
        on conflict (campaign_id, sobol_index, epoch) do nothing",
};

/// Sets the cases of these leases to waiting. No attempt is counted.
const RETURN: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'waiting', lease_expires_unix_ms = null
        where campaign_id = $1 and worker = $2 and state = 'leased'
            and sobol_index in (select value from json_each($3))
            and ((sobol_index << 32) | epoch) in (select value from json_each($4))",
    postgres: "
        update campaign_case set state = 'waiting', lease_expires_unix_ms = null
        where campaign_id = $1 and worker = $2 and state = 'leased'
            and sobol_index = any($3) and ((sobol_index << 32) | epoch) = any($4)",
};

/// Binds the values of a statement about a worker's leases.
fn about(text: Text, campaign: &str, worker: &str, held: &[Held]) -> Statement {
    let index = |held: &Held| i64::from(held.index);
    let indices: Vec<_> = held.iter().map(index).collect();
    let leases: Vec<_> =
        held.iter().map(|held| index(held) << 32 | i64::from(held.epoch)).collect();
    sql(text).bind(campaign).bind(worker).bind(indices).bind(leases)
}

pub(super) struct Renew {
    pub(super) campaign: String,
    pub(super) worker: String,
    pub(super) held: Vec<Held>,
    pub(super) until_unix_ms: i64,
}

impl Write for Renew {
    type Answer = Vec<Held>;

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<Vec<Held>, LibraryError> {
        let Self { campaign, worker, held, until_unix_ms } = self;
        let renewed = renew(connection, campaign, worker, held, *until_unix_ms).await?;
        let not_renewed: Vec<Held> =
            self.held.iter().copied().filter(|it| !renewed.contains(it)).collect();
        if not_renewed.is_empty() {
            return Ok(not_renewed);
        }
        let ended = self.ended_by_the_worker(connection, &not_renewed).await?;
        Ok(not_renewed.into_iter().filter(|it| !ended.contains(it)).collect())
    }
}

impl Renew {
    /// Returns those of these leases that the worker has ended itself: it reported or released the case.
    ///
    /// A heartbeat may still contain such leases if the worker sent it before it received the response to
    /// its report.
    async fn ended_by_the_worker(
        &self,
        connection: &mut Connection,
        held: &[Held],
    ) -> Result<HashSet<Held>, LibraryError> {
        leases(
            &connection
                .rows(about(ENDED_BY_THE_WORKER, &self.campaign, &self.worker, held))
                .await?,
        )
    }
}

/// The leases in these rows.
fn leases(rows: &[Row]) -> Result<HashSet<Held>, LibraryError> {
    let held =
        |row: &Row| Ok(Held { index: row.get_u32("sobol_index")?, epoch: row.get_u32("epoch")? });
    rows.iter().map(held).collect()
}

/// Extends those of these leases that the worker still has, and returns them.
pub(super) async fn renew(
    connection: &mut Connection,
    campaign: &str,
    worker: &str,
    held: &[Held],
    until_unix_ms: i64,
) -> Result<HashSet<Held>, LibraryError> {
    let renew = about(RENEW, campaign, worker, held).bind(until_unix_ms);
    leases(&connection.rows(renew).await?)
}

pub(super) struct Release {
    pub(super) campaign: String,
    pub(super) worker: String,
    pub(super) held: Vec<Held>,
    pub(super) now_unix_ms: i64,
}

impl Write for Release {
    type Answer = ();

    fn worker(&self) -> Option<&str> {
        Some(&self.worker)
    }

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let bound = |text| about(text, &self.campaign, &self.worker, &self.held);
        connection.execute(bound(NOTE_RETURN).bind(self.now_unix_ms)).await?;
        connection.execute(bound(RETURN)).await.map(drop)
    }
}

pub(super) struct ReleaseAll {
    pub(super) campaign: String,
    pub(super) now_unix_ms: i64,
}

impl Write for ReleaseAll {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        attempt::end_all(connection, &self.campaign, "abandoned", self.now_unix_ms).await
    }
}
