//! How all campaigns stand, at a glance.

use crate::engine::{Row, sql};
use crate::tally::interval;
use crate::{CampaignState, Library, LibraryError, Status};

/// What the rate is a mean over, and the begun interval, in s.
const RATE_OVER_S: i64 = 60;

/// A first report in a new interval is no rate of thousands.
const SHORTEST_S: f64 = 1.0;

/// Causes of failure that are told apart for one campaign.
const CAUSES_MAX: u32 = 20;

/// How a campaign stands.
#[derive(Clone, Debug, PartialEq)]
pub struct CampaignOverview {
    /// Its id.
    pub id: String,
    /// What people call it.
    pub name: String,
    /// Whether its cases are handed out.
    pub state: CampaignState,
    /// The larger goes first.
    pub priority: i32,
    /// When it came, as ISO 8601.
    pub created_at: String,
    /// How many cases stand where.
    pub status: Status,
    /// Cases finished a second: in the last minute or a little more, or since the campaign's first results.
    pub per_second: f64,
    /// Mean computing time of these cases, in s.
    pub mean_case_s: Option<f64>,
    /// Why cases were given up, the most frequent first.
    pub causes: Vec<Cause>,
}

/// Why cases were given up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cause {
    /// What the last attempt ended with.
    pub error: String,
    /// How many cases.
    pub cases: u32,
}

impl Library {
    /// How all campaigns stand, oldest first; the cost doesn't depend on how many cases they have.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn overview(&self) -> Result<Vec<CampaignOverview>, LibraryError> {
        let now_unix_ms = self.now_unix_ms();
        let since_unix_s = interval(now_unix_ms) - RATE_OVER_S;
        let ask = "select campaign_status.*,
                (select cast(coalesce(sum(finished), 0) as bigint) from progress
                where progress.campaign_id = campaign_status.campaign_id
                    and from_unix_s >= $1) as finished_lately,
                (select sum(busy_s) from progress
                where progress.campaign_id = campaign_status.campaign_id
                    and from_unix_s >= $1) as busy_s,
                (select min(from_unix_s) from progress
                where progress.campaign_id = campaign_status.campaign_id) as first_unix_s
            from campaign_status order by created_at, campaign_id";
        let mut overviews = Vec::new();
        for row in self.readers().rows(sql(ask).bind(since_unix_s)).await? {
            let first_unix_s: Option<i64> = row.get("first_unix_s")?;
            let counted_from_unix_s = first_unix_s.map_or(since_unix_s, |it| it.max(since_unix_s));
            let over_s = now_unix_ms as f64 / 1000.0 - counted_from_unix_s as f64;
            let mut overview = overview(&row, over_s.max(SHORTEST_S))?;
            if overview.status.failed > 0 {
                overview.causes = self.causes(&overview.id).await?;
            }
            overviews.push(overview);
        }
        Ok(overviews)
    }

    async fn causes(&self, campaign: &str) -> Result<Vec<Cause>, LibraryError> {
        let ask = "select error, count(*) as cases from campaign_case
            where campaign_id = $1 and state = 'failed'
            group by error order by cases desc, error limit $2";
        let rows = self.readers().rows(sql(ask).bind(campaign).bind(CAUSES_MAX)).await?;
        let cause =
            |row: &Row| Ok(Cause { error: row.get("error")?, cases: row.get_u32("cases")? });
        rows.iter().map(cause).collect()
    }
}

/// What a row says; its cases were finished within `over_s`.
fn overview(row: &Row, over_s: f64) -> Result<CampaignOverview, LibraryError> {
    let finished = f64::from(row.get_u32("finished_lately")?);
    let busy_s: Option<f64> = row.get("busy_s")?;
    let priority: i64 = row.get("priority")?;
    Ok(CampaignOverview {
        id: row.get("campaign_id")?,
        name: row.get("name")?,
        state: CampaignState::from_name(&row.get::<String>("state")?),
        priority: i32::try_from(priority)
            .map_err(|_| LibraryError::Damaged { what: format!("a priority of {priority}") })?,
        created_at: row.get("created_at")?,
        status: Status {
            waiting: row.get_u32("waiting")?,
            leased: row.get_u32("leased")?,
            finished: row.get_u32("finished")?,
            failed: row.get_u32("failed")?,
        },
        per_second: finished / over_s,
        mean_case_s: busy_s.filter(|_| finished > 0.0).map(|busy_s| busy_s / finished),
        causes: Vec::new(),
    })
}
