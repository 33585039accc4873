//! The table `attempt`: leases that ended without a result.

use crate::engine::{Connection, Dialect, sql};
use crate::{LibraryError, Report, State};

/// One case.
const CASE: &str = "campaign_id = $1 and sobol_index = $2";

/// Cases, as many as are listed.
fn cases(dialect: Dialect) -> String {
    format!("campaign_id = $1 and sobol_index {}", dialect.listed("$2"))
}

/// Leases that end without result, and where that leaves their cases.
pub(crate) struct Ended<'a> {
    pub(crate) campaign: &'a str,
    pub(crate) indices: Vec<i64>,
    /// Attempts of each case that count, with this one.
    pub(crate) attempts: u32,
    pub(crate) state: State,
    pub(crate) ending: &'static str,
    pub(crate) error: &'a str,
    pub(crate) now_unix_ms: i64,
}

/// Statement that puts leases of the cases `which` on record as ended so and then; a lease is on
/// record once.
pub(crate) fn ended(which: &str, ended_unix_ms: &str, ending: &str, error: &str) -> String {
    format!(
        "insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms,
            ended_unix_ms, ending, error)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms,
            {ended_unix_ms}, {ending}, {error}
        from campaign_case where {which}
        on conflict (campaign_id, sobol_index, epoch) do nothing"
    )
}

/// Ends attempts that count.
pub(crate) async fn end(connection: &mut Connection, it: Ended<'_>) -> Result<(), LibraryError> {
    let cases = cases(connection.dialect());
    let note = sql(ended(&cases, "$3", "$4", "$5"))
        .bind(it.campaign)
        .bind(it.indices.clone())
        .bind(it.now_unix_ms)
        .bind(it.ending)
        .bind(it.error);
    connection.execute(note).await?;
    let end = format!(
        "update campaign_case set state = $3, attempts = $4, error = $5,
            lease_expires_unix_ms = null
        where {cases}"
    );
    let end = sql(end)
        .bind(it.campaign)
        .bind(it.indices)
        .bind(it.state.name())
        .bind(it.attempts)
        .bind(it.error);
    connection.execute(end).await.map(drop)
}

/// How many of a case's last so many attempts that count have failed.
pub(crate) async fn failures(
    connection: &mut Connection,
    report: &Report,
    index: u32,
    attempts: u32,
) -> Result<u32, LibraryError> {
    let ask = "select count(*) as failures from (
            select ending from attempt
            where campaign_id = $1 and sobol_index = $2 and ending in ('failed', 'lost')
            order by epoch desc limit $3) as counted
        where ending = 'failed'";
    let ask = sql(ask).bind(&report.campaign).bind(index).bind(attempts);
    connection.row(ask).await?.map_or(Ok(0), |row| row.get_u32("failures"))
}

/// Ends every lease of a campaign; no attempt is counted.
pub(crate) async fn end_all(
    connection: &mut Connection,
    campaign: &str,
    ending: &'static str,
    now_unix_ms: i64,
) -> Result<(), LibraryError> {
    let dialect = connection.dialect();
    // What is leased after this stays leased.
    let leased = format!(
        "select sobol_index from campaign_case where campaign_id = $1 and state = 'leased'
        order by sobol_index {}",
        dialect.locking()
    );
    let leased = connection.indices(sql(leased).bind(campaign)).await?;
    let cases = cases(dialect);
    let note = sql(ended(&cases, "$3", "$4", "null"))
        .bind(campaign)
        .bind(leased.clone())
        .bind(now_unix_ms)
        .bind(ending);
    connection.execute(note).await?;
    let end = format!(
        "update campaign_case set state = 'waiting', lease_expires_unix_ms = null
        where {cases}"
    );
    connection.execute(sql(end).bind(campaign).bind(leased)).await.map(drop)
}

/// Notes that a case's present lease is overtaken by the result of an earlier one.
pub(crate) async fn overtake(
    connection: &mut Connection,
    report: &Report,
    index: u32,
) -> Result<(), LibraryError> {
    let note = sql(ended(CASE, "$3", "'overtaken'", "null"))
        .bind(&report.campaign)
        .bind(index)
        .bind(report.now_unix_ms);
    connection.execute(note).await.map(drop)
}
