//! The table `attempt`: leases that ended without a result.

use crate::engine::{Connection, Text, sql};
use crate::{LibraryError, Report, State};

/// Records that leases of cases ($2) of a campaign ($1) ended at $3, with ending $4 and error $5. A lease
/// is recorded once.
const NOTE: Text = Text::Each {
    sqlite: "
        insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $3, $4, $5
        from campaign_case where campaign_id = $1 and sobol_index in (select value from json_each($2))
        on conflict (campaign_id, sobol_index, epoch) do nothing",
    postgres: "
        insert into attempt (campaign_id, sobol_index, epoch, worker, leased_unix_ms, ended_unix_ms, ending, error)
        select campaign_id, sobol_index, epoch, worker, leased_unix_ms, $3, $4, $5
        from campaign_case where campaign_id = $1 and sobol_index = any($2)
        on conflict (campaign_id, sobol_index, epoch) do nothing",
};

/// Sets the state of cases after attempts that count.
const END: Text = Text::Each {
    sqlite: "
        update campaign_case set state = $3, attempts = $4, error = $5, lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index in (select value from json_each($2))",
    postgres: "
        update campaign_case set state = $3, attempts = $4, error = $5, lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index = any($2)",
};

/// Number of failures among the last $3 counted attempts of a case.
const FAILURES: &str = "
    select count(*) as failures from (
        select ending from attempt
        where campaign_id = $1 and sobol_index = $2 and ending in ('failed', 'lost')
        order by epoch desc limit $3) as counted
    where ending = 'failed'";

/// All leased cases of a campaign. Cases that are leased after this statement stay leased.
const LEASED: Text = Text::Each {
    sqlite: "
        select sobol_index from campaign_case where campaign_id = $1 and state = 'leased'
        order by sobol_index",
    postgres: "
        select sobol_index from campaign_case where campaign_id = $1 and state = 'leased'
        order by sobol_index for update",
};

/// Sets cases to waiting. No attempt is counted.
const WAIT: Text = Text::Each {
    sqlite: "
        update campaign_case set state = 'waiting', lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index in (select value from json_each($2))",
    postgres: "
        update campaign_case set state = 'waiting', lease_expires_unix_ms = null
        where campaign_id = $1 and sobol_index = any($2)",
};

/// Leases that ended without result, and the new state of their cases.
pub(crate) struct Ended<'a> {
    pub(crate) campaign: &'a str,
    pub(crate) indices: Vec<i64>,
    /// Number of counted attempts of each case, including this one.
    pub(crate) attempts: u32,
    pub(crate) state: State,
    pub(crate) ending: &'static str,
    pub(crate) error: &'a str,
    pub(crate) now_unix_ms: i64,
}

/// Records attempts that count, and sets the state of their cases.
pub(crate) async fn end(connection: &mut Connection, it: Ended<'_>) -> Result<(), LibraryError> {
    let error = Some(it.error.to_owned());
    note(connection, it.campaign, it.indices.clone(), it.now_unix_ms, it.ending, error).await?;
    let end = sql(END)
        .bind(it.campaign)
        .bind(it.indices)
        .bind(it.state.name())
        .bind(it.attempts)
        .bind(it.error);
    connection.execute(end).await.map(drop)
}

async fn note(
    connection: &mut Connection,
    campaign: &str,
    indices: Vec<i64>,
    now_unix_ms: i64,
    ending: &'static str,
    error: Option<String>,
) -> Result<(), LibraryError> {
    let note = sql(NOTE).bind(campaign).bind(indices).bind(now_unix_ms).bind(ending).bind(error);
    connection.execute(note).await.map(drop)
}

/// Number of failures among the last attempts of a case.
pub(crate) async fn failures(
    connection: &mut Connection,
    report: &Report,
    index: u32,
    attempts: u32,
) -> Result<u32, LibraryError> {
    let ask = sql(FAILURES).bind(&report.campaign).bind(index).bind(attempts);
    connection.row(ask).await?.map_or(Ok(0), |row| row.get_u32("failures"))
}

/// Ends all leases of a campaign. No attempt is counted.
pub(crate) async fn end_all(
    connection: &mut Connection,
    campaign: &str,
    ending: &'static str,
    now_unix_ms: i64,
) -> Result<(), LibraryError> {
    let leased = connection.indices(sql(LEASED).bind(campaign)).await?;
    note(connection, campaign, leased.clone(), now_unix_ms, ending, None).await?;
    connection.execute(sql(WAIT).bind(campaign).bind(leased)).await.map(drop)
}

/// Records that a case's present lease ended because an earlier lease brought the result.
pub(crate) async fn overtake(
    connection: &mut Connection,
    report: &Report,
    index: u32,
) -> Result<(), LibraryError> {
    let case = vec![index.into()];
    note(connection, &report.campaign, case, report.now_unix_ms, "overtaken", None).await
}
