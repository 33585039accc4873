//! The table `attempt`: leases that ended without a result.

use crate::engine::{Connection, sql};
use crate::{LibraryError, Report, State};

/// A lease that ends without result, and where that leaves its case.
pub(crate) struct Ended<'a> {
    pub(crate) campaign: &'a str,
    pub(crate) index: u32,
    /// Attempts that count, with this one.
    pub(crate) attempts: u32,
    pub(crate) state: State,
    pub(crate) ending: &'static str,
    pub(crate) error: &'a str,
    pub(crate) now_unix_ms: i64,
}

/// Ends an attempt that counts.
pub(crate) async fn end(connection: &mut Connection, it: Ended<'_>) -> Result<(), LibraryError> {
    let note = "insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms,
            ended_unix_ms, ending, error)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $3, $4, $5
        from campaign_case where campaign_id = $1 and sobol_index = $2
        on conflict (campaign_id, sobol_index, epoch) do nothing";
    let note = sql(note)
        .bind(it.campaign)
        .bind(it.index)
        .bind(it.now_unix_ms)
        .bind(it.ending)
        .bind(it.error);
    connection.execute(note).await?;
    let end = "update campaign_case set state = $3, attempts = $4, error = $5,
            lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index = $2";
    let end = sql(end)
        .bind(it.campaign)
        .bind(it.index)
        .bind(it.state.name())
        .bind(it.attempts)
        .bind(it.error);
    connection.execute(end).await.map(drop)
}

/// Ends every lease of a campaign; no attempt is counted.
pub(crate) async fn end_all(
    connection: &mut Connection,
    campaign: &str,
    ending: &'static str,
    now_unix_ms: i64,
) -> Result<(), LibraryError> {
    let note = "insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms,
            ended_unix_ms, ending)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $2, $3
        from campaign_case where campaign_id = $1 and state = 'leased'
        on conflict (campaign_id, sobol_index, epoch) do nothing";
    connection.execute(sql(note).bind(campaign).bind(now_unix_ms).bind(ending)).await?;
    let end = "update campaign_case set state = 'waiting', lease_expires_unix_ms = null
        where campaign_id = $1 and state = 'leased'";
    connection.execute(sql(end).bind(campaign)).await.map(drop)
}

/// Notes that a case's present lease is overtaken by the result of an earlier one.
pub(crate) async fn overtake(
    connection: &mut Connection,
    report: &Report,
    index: u32,
) -> Result<(), LibraryError> {
    let note = "insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms,
            ended_unix_ms, ending)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $3, 'overtaken'
        from campaign_case where campaign_id = $1 and sobol_index = $2
        on conflict (campaign_id, sobol_index, epoch) do nothing";
    let note = sql(note).bind(&report.campaign).bind(index).bind(report.now_unix_ms);
    connection.execute(note).await.map(drop)
}
