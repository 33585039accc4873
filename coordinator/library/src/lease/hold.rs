//! What a worker holds: kept, or taken back.

use super::Held;
use crate::engine::{Connection, Dialect, Row, Statement, Write, sql};
use crate::{LibraryError, attempt};
use std::collections::HashSet;

/// That a case is worker `$2`'s under one of its leases: their indices are `$3`, and these with their
/// epochs as one number each `$4`.
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

/// A statement about leases of a worker, bound as [`is_held`] wants them.
fn about(text: String, campaign: &str, worker: &str, held: &[Held]) -> Statement {
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
    /// Which of these leases the worker has ended itself: it reported the case, or gave it back.
    ///
    /// A heartbeat may name them still, for it was sent before the answer to that report came.
    async fn ended_by_the_worker(
        &self,
        connection: &mut Connection,
        held: &[Held],
    ) -> Result<HashSet<Held>, LibraryError> {
        let dialect = connection.dialect();
        let (cases, numbers) = (dialect.listed("$3"), dialect.listed("$4"));
        let ask = format!(
            "select sobol_index, epoch from campaign_case
            where campaign_id = $1 and worker = $2 and state = 'finished' and sobol_index {cases}
                and ((sobol_index << 32) | epoch) {numbers}
            union
            select sobol_index, epoch from attempt
            where campaign_id = $1 and worker = $2 and ending in ('failed', 'returned')
                and sobol_index {cases} and ((sobol_index << 32) | epoch) {numbers}"
        );
        leases(&connection.rows(about(ask, &self.campaign, &self.worker, held)).await?)
    }
}

/// The leases that rows tell.
fn leases(rows: &[Row]) -> Result<HashSet<Held>, LibraryError> {
    let held =
        |row: &Row| Ok(Held { index: row.get_u32("sobol_index")?, epoch: row.get_u32("epoch")? });
    rows.iter().map(held).collect()
}

/// Lets those of a worker's leases that it still has last until then; answers which.
pub(super) async fn renew(
    connection: &mut Connection,
    campaign: &str,
    worker: &str,
    held: &[Held],
    until_unix_ms: i64,
) -> Result<HashSet<Held>, LibraryError> {
    let renew = format!(
        "update campaign_case set lease_expires_unix_ms = $5 where {}
        returning sobol_index, epoch",
        is_held(connection.dialect())
    );
    let renew = about(renew, campaign, worker, held).bind(until_unix_ms);
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
        let theirs = is_held(connection.dialect());
        let note = attempt::ended(&theirs, "$5", "'returned'", "null");
        let end = format!(
            "update campaign_case set state = 'waiting', lease_expires_unix_ms = null
            where {theirs}"
        );
        let bound = |text| about(text, &self.campaign, &self.worker, &self.held);
        connection.execute(bound(note).bind(self.now_unix_ms)).await?;
        connection.execute(bound(end)).await.map(drop)
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
