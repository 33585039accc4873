//! Overview of all campaigns.

use crate::engine::{Row, sql};
use crate::throughput::Throughput;
use crate::{CampaignState, Library, LibraryError, Status};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Maximum number of different failure causes per campaign.
const CAUSES_MAX: usize = 20;

/// Maximum number of error messages of a campaign that are read to find its causes; the most frequent
/// first.
const ERRORS_MAX: u32 = 2000;

/// Overview of a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct CampaignOverview {
    /// Id of the campaign.
    pub id: String,
    /// Name of the campaign.
    pub name: String,
    /// State of the campaign: running, paused or cancelled.
    pub state: CampaignState,
    /// Priority; campaigns with a larger number are leased first.
    pub priority: i32,
    /// Time at which the campaign was stored, as ISO 8601.
    pub created_at: String,
    /// Number of cases by state.
    pub status: Status,
    /// Cases finished per second. The average is over the last minute or slightly more, but not before the
    /// computation of the campaign's first results or of the first results after a pause.
    pub per_second: f64,
    /// Mean computing time of these cases, in s; `None` without results.
    pub mean_case_s: Option<f64>,
    /// Causes of given-up cases, the most frequent first.
    pub causes: Vec<Cause>,
}

/// A cause of given-up cases.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cause {
    /// Error message of the last attempt. Messages that differ only in numbers are grouped, with dots
    /// instead of the numbers.
    pub error: String,
    /// Number of cases with this cause.
    pub cases: u32,
}

impl Library {
    /// Overview of all campaigns, oldest first. The cost does not depend on the number of cases.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn overview(&self) -> Result<Vec<CampaignOverview>, LibraryError> {
        let throughputs = self.throughputs().await?;
        let ask = "select * from campaign_status order by created_at, campaign_id";
        let mut overviews = Vec::new();
        for row in self.readers().rows(sql(ask)).await? {
            let id: String = row.get("campaign_id")?;
            let mut overview = overview(&row, throughputs.get(&id).copied().unwrap_or_default())?;
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
        let rows = self.readers().rows(sql(ask).bind(campaign).bind(ERRORS_MAX)).await?;
        let cause =
            |row: &Row| Ok(Cause { error: row.get("error")?, cases: row.get_u32("cases")? });
        Ok(alike(rows.iter().map(cause).collect::<Result<_, LibraryError>>()?))
    }
}

/// Groups errors that differ only in numbers; the most frequent first.
fn alike(errors: Vec<Cause>) -> Vec<Cause> {
    let mut kinds: BTreeMap<String, Vec<Cause>> = BTreeMap::new();
    for cause in errors {
        kinds.entry(without_numbers(&cause.error)).or_default().push(cause);
    }
    let together = |(kind, causes): (String, Vec<Cause>)| {
        let cases = causes.iter().map(|cause| cause.cases).sum();
        let error = if let [one] = &causes[..] { one.error.clone() } else { kind };
        Cause { error, cases }
    };
    let mut causes: Vec<_> = kinds.into_iter().map(together).collect();
    causes.sort_by_key(|cause| Reverse(cause.cases));
    causes.truncate(CAUSES_MAX);
    causes
}

/// Replaces numbers in a text by dots. Digits within a name, as in `level_50_Hz`, are kept.
fn without_numbers(text: &str) -> String {
    let is_name = |it: char| it.is_alphanumeric() || it == '_';
    let words = text.split_inclusive(|it: char| !is_name(it) && !".+-".contains(it));
    let shown = words.map(|word| {
        let bare = word.trim_end_matches(|it: char| !is_name(it));
        let is_number =
            bare.contains(|it: char| it.is_ascii_digit()) && bare.parse::<f64>().is_ok();
        if is_number { format!("...{}", &word[bare.len()..]) } else { word.to_owned() }
    });
    shown.collect()
}

/// Creates the overview of a campaign from its row and throughput.
fn overview(row: &Row, throughput: Throughput) -> Result<CampaignOverview, LibraryError> {
    let priority: i64 = row.get("priority")?;
    Ok(CampaignOverview {
        id: row.get("campaign_id")?,
        name: row.get("name")?,
        state: CampaignState::from_name(&row.get::<String>("state")?)?,
        priority: i32::try_from(priority)
            .map_err(|_| LibraryError::Damaged { what: format!("a priority of {priority}") })?,
        created_at: row.get("created_at")?,
        status: Status {
            waiting: row.get_u32("waiting")?,
            leased: row.get_u32("leased")?,
            finished: row.get_u32("finished")?,
            failed: row.get_u32("failed")?,
        },
        per_second: throughput.per_second,
        mean_case_s: throughput.mean_case_s,
        causes: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_that_differ_in_a_place_are_one_cause() {
        let cause = |error: &str, cases| Cause { error: error.to_owned(), cases };
        let found = alike(vec![
            cause("bins_50 are too few", 2),
            cause("the wheel is 1.25 m off at -0.75 m", 1),
            cause("the wheel is 3e-5 m off at 12.5 m.", 1),
            cause("the wheel is 7 m off at 1 m", 3),
        ]);
        let expected = [
            cause("the wheel is ... m off at ... m", 4),
            cause("bins_50 are too few", 2),
            cause("the wheel is 3e-5 m off at 12.5 m.", 1),
        ];
        assert_eq!(found, expected);
    }
}
