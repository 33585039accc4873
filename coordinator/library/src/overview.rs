//! How all campaigns stand, at a glance.

use crate::engine::{Row, sql};
use crate::pace::Pace;
use crate::{CampaignState, Library, LibraryError, Status};

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
    /// Cases finished a second: in the last minute or a little more, or since the campaign's first
    /// results, or the first after a pause.
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
        let paces = self.paces().await?;
        let ask = "select * from campaign_status order by created_at, campaign_id";
        let mut overviews = Vec::new();
        for row in self.readers().rows(sql(ask)).await? {
            let id: String = row.get("campaign_id")?;
            let mut overview = overview(&row, paces.get(&id).copied().unwrap_or_default())?;
            if overview.status.failed > 0 {
                overview.causes = self.causes(&id).await?;
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

/// What a row says of a campaign that goes at this pace.
fn overview(row: &Row, pace: Pace) -> Result<CampaignOverview, LibraryError> {
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
        per_second: pace.per_second,
        mean_case_s: pace.mean_case_s,
        causes: Vec::new(),
    })
}
