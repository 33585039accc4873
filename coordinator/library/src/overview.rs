//! How all campaigns stand, at a glance.

use crate::engine::{Row, sql};
use crate::tally::{INTERVAL_S, interval};
use crate::{CampaignState, Library, LibraryError, Status};

/// What the rate is a mean over, in s.
const RATE_OVER_S: i64 = 60;

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
    /// Cases finished in the last whole minute, to ten seconds.
    pub finished_last_minute: u32,
    /// Mean computing time of these, in s.
    pub mean_case_s: Option<f64>,
    /// Why cases were given up, the most frequent first.
    pub causes: Vec<Cause>,
}

impl CampaignOverview {
    /// How long the rest takes at the present rate, in s.
    pub fn remaining_s(&self) -> Option<f64> {
        let left = self.status.total() - self.status.done();
        let rate = f64::from(self.finished_last_minute) / RATE_OVER_S as f64;
        (rate > 0.0).then(|| f64::from(left) / rate)
    }
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
        let now = interval(self.now_unix_ms());
        let ask = "select campaign_status.*,
                (select cast(coalesce(sum(finished), 0) as bigint) from progress
                where progress.campaign_id = campaign_status.campaign_id
                    and from_unix_s >= $1 and from_unix_s < $2) as finished_last_minute,
                (select sum(busy_s) from progress
                where progress.campaign_id = campaign_status.campaign_id
                    and from_unix_s >= $1 and from_unix_s < $2) as busy_s
            from campaign_status order by created_at, campaign_id";
        // The present interval is not over; the rate is that of the six before.
        let ask = sql(ask).bind(now - RATE_OVER_S / INTERVAL_S * INTERVAL_S).bind(now);
        let mut overviews = Vec::new();
        for row in self.readers().rows(ask).await? {
            let mut overview = overview(&row)?;
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

fn overview(row: &Row) -> Result<CampaignOverview, LibraryError> {
    let finished_last_minute = row.get_u32("finished_last_minute")?;
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
        finished_last_minute,
        mean_case_s: busy_s
            .filter(|_| finished_last_minute > 0)
            .map(|busy_s| busy_s / f64::from(finished_last_minute)),
        causes: Vec::new(),
    })
}
