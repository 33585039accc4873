//! Looking a library over: what it holds is what it says it holds.

use crate::case::case_of;
use crate::engine::{Dialect, Row, Statement, sql};
use crate::result::features_of;
use crate::{CampaignRecord, Library, LibraryError};
use tokio_stream::StreamExt;
use tracktwin_parameters::Case;

/// Something that is wrong, and how often.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Where: a campaign, or the file.
    pub place: String,
    /// What.
    pub what: String,
    /// How often.
    pub count: u64,
    /// The first case that shows it.
    pub first_index: Option<u32>,
}

/// Statements that find the indices of cases with a fault; `$1` is the campaign.
const FAULTS: [(&str, &str); 6] = [
    (
        "finished cases without result at every speed",
        "select sobol_index from campaign_case where campaign_id = $1 and state = 'finished'
            and (select count(*) from result where result.campaign_id = campaign_case.campaign_id
                and result.sobol_index = campaign_case.sobol_index)
            <> (select {speeds} from campaign where id = $1)",
    ),
    (
        "results of cases that are not finished",
        "select distinct sobol_index from result join campaign_case using (campaign_id, sobol_index)
        where campaign_id = $1 and campaign_case.state <> 'finished'",
    ),
    (
        "results of other parameters than their case has",
        "select distinct sobol_index from result join campaign_case using (campaign_id, sobol_index)
        where campaign_id = $1 and result.parameter_hash <> campaign_case.parameter_hash",
    ),
    (
        "results of another experiment than the campaign's",
        "select distinct sobol_index from result
        where campaign_id = $1
            and experiment_hash <> (select experiment_hash from campaign where id = $1)",
    ),
    (
        "cases with the parameters and surface of an earlier one",
        "select max(sobol_index) as sobol_index from campaign_case where campaign_id = $1
        group by parameter_hash having count(*) > 1",
    ),
    (
        "gaps in the cases' indices",
        "select sobol_index from campaign_case as after_gap
        where campaign_id = $1 and sobol_index > 0 and not exists (
            select 1 from campaign_case as before_gap where before_gap.campaign_id = $1
                and before_gap.sobol_index = after_gap.sobol_index - 1)",
    ),
];

/// Statements that count what lies about in a server's library, where no foreign key looks for a result's case
/// or a series' result (docs/decisions/0035), and find its first index.
const LOOSE: [(&str, &str); 3] = [
    (
        "results of cases that are not there",
        "select count(*) as n, min(sobol_index) as first_index from case_result
        left join campaign_case using (campaign_id, sobol_index) where state is null",
    ),
    (
        "results without their series",
        "select count(*) as n, min(sobol_index) as first_index from case_result
        cross join unnest(speeds_km_h) as of (speed_km_h)
        left join case_series
            on result_id = id and case_series.speed_km_h = of.speed_km_h
        where result_id is null",
    ),
    (
        "series without their results",
        "select count(*) as n, cast(null as bigint) as first_index from case_series
        left join case_result on id = result_id where id is null",
    ),
];

impl Library {
    /// Looks over everything: hashes, gaps, duplicates, numbers that are none, counts, and with
    /// `SQLite` the file itself. Empty when nothing is wrong.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn verify(&self) -> Result<Vec<Finding>, LibraryError> {
        let mut findings = match self.readers().dialect() {
            Dialect::Sqlite => self.damage_of_the_file().await?,
            Dialect::Postgres => self.what_lies_about().await?,
        };
        for campaign in self.campaigns().await? {
            verify_definition(&campaign, &mut findings);
            for (what, ask) in FAULTS {
                let speeds = self.readers().dialect().json_length("speeds_km_h");
                let ask = sql(ask.replace("{speeds}", &speeds)).bind(&campaign.id);
                findings.extend(self.faults(&campaign.id, what, ask).await?);
            }
            self.verify_cases(&campaign, &mut findings).await?;
            self.verify_results(&campaign, &mut findings).await?;
            self.verify_counts(&campaign, &mut findings).await?;
        }
        Ok(findings)
    }

    async fn damage_of_the_file(&self) -> Result<Vec<Finding>, LibraryError> {
        let rows =
            self.readers().rows(sql("select integrity_check from pragma_integrity_check")).await?;
        let mut findings = Vec::new();
        for row in rows {
            let what: String = row.get("integrity_check")?;
            if what != "ok" {
                findings.push(Finding { place: self.name(), what, count: 1, first_index: None });
            }
        }
        Ok(findings)
    }

    async fn what_lies_about(&self) -> Result<Vec<Finding>, LibraryError> {
        let mut findings = Vec::new();
        for (what, ask) in LOOSE {
            let Some(row) = self.readers().row(sql(ask)).await? else { continue };
            let count = row.get_u32("n")?.into();
            let first: Option<i64> = row.get("first_index")?;
            let first_index = first.and_then(|index| u32::try_from(index).ok());
            let place = self.name();
            findings.push(Finding { place, what: what.to_owned(), count, first_index });
        }
        findings.retain(|finding| finding.count > 0);
        Ok(findings)
    }

    /// Counts the cases that a statement finds.
    async fn faults(
        &self,
        campaign: &str,
        what: &str,
        ask: Statement,
    ) -> Result<Option<Finding>, LibraryError> {
        let mut fault = Fault::default();
        let mut rows = self.readers().stream(ask);
        while let Some(row) = rows.next().await {
            fault.at(row?.get_u32("sobol_index")?);
        }
        Ok(fault.finding(campaign, what))
    }

    async fn verify_cases(
        &self,
        campaign: &CampaignRecord,
        findings: &mut Vec<Finding>,
    ) -> Result<(), LibraryError> {
        let ask = sql("select * from campaign_case where campaign_id = $1 order by sobol_index");
        let mut rows = self.readers().stream(ask.bind(&campaign.id));
        let (mut hash, mut finite) = (Fault::default(), Fault::default());
        while let Some(row) = rows.next().await {
            let row = row?;
            let case = case_of(&row)?;
            if !has_hash(&case, &row)? {
                hash.at(case.index);
            }
            if !case.parameters.values().iter().all(|value| value.is_finite()) {
                finite.at(case.index);
            }
        }
        findings.extend(hash.finding(&campaign.id, "cases that do not have their hash"));
        findings.extend(finite.finding(&campaign.id, "cases with parameters that are no numbers"));
        Ok(())
    }

    async fn verify_results(
        &self,
        campaign: &CampaignRecord,
        findings: &mut Vec<Finding>,
    ) -> Result<(), LibraryError> {
        let bins = self.bins(&campaign.experiment_hash).await?;
        let ask = sql("select * from result where campaign_id = $1 and log_power is not null
                order by sobol_index, speed_km_h");
        let mut rows = self.readers().stream(ask.bind(&campaign.id));
        let (mut finite, mut shape) = (Fault::default(), Fault::default());
        while let Some(row) = rows.next().await {
            let row = row?;
            let index = row.get_u32("sobol_index")?;
            let features = features_of(&row)?;
            let mut values = features.log_power.iter().chain(&features.band_levels_db);
            if !values.all(|value| value.is_finite()) {
                finite.at(index);
            }
            if bins > 0 && features.log_power.len() != bins {
                shape.at(index);
            }
        }
        findings.extend(finite.finding(&campaign.id, "results with features that are no numbers"));
        findings.extend(shape.finding(&campaign.id, "results with too many or too few bins"));
        Ok(())
    }

    async fn bins(&self, experiment_hash: &str) -> Result<usize, LibraryError> {
        let ask = sql("select count(*) as n from frequency_bin where experiment_hash = $1");
        let row = self.readers().row(ask.bind(experiment_hash)).await?;
        row.map_or(Ok(0), |row| row.get_u32("n").map(|count| count as usize))
    }

    async fn verify_counts(
        &self,
        campaign: &CampaignRecord,
        findings: &mut Vec<Finding>,
    ) -> Result<(), LibraryError> {
        let count = sql("select state, count(*) as cases from campaign_case
            where campaign_id = $1 group by state");
        let counted = self.counts(count.bind(&campaign.id)).await?;
        if counted != self.status(&campaign.id).await? {
            let what = "the counts of cases are not those of the cases".to_owned();
            let place = campaign.id.clone();
            findings.push(Finding { place, what, count: 1, first_index: None });
        }
        Ok(())
    }
}

fn verify_definition(campaign: &CampaignRecord, findings: &mut Vec<Finding>) {
    let hashes = [
        ("definition", &campaign.definition_json, &campaign.definition_hash),
        ("experiment", &campaign.experiment_json, &campaign.experiment_hash),
    ];
    for (what, json, hash) in hashes {
        if blake3::hash(json.as_bytes()).to_hex().as_str() != hash {
            let what = format!("the {what} does not have its hash");
            let place = campaign.id.clone();
            findings.push(Finding { place, what, count: 1, first_index: None });
        }
    }
}

fn has_hash(case: &Case, row: &Row) -> Result<bool, LibraryError> {
    Ok(case.parameter_hash() == row.get::<String>("parameter_hash")?)
}

/// How often a fault was met.
#[derive(Default)]
struct Fault {
    count: u64,
    first_index: Option<u32>,
}

impl Fault {
    fn at(&mut self, index: u32) {
        self.count += 1;
        self.first_index = Some(self.first_index.map_or(index, |first| first.min(index)));
    }

    fn finding(self, campaign: &str, what: &str) -> Option<Finding> {
        let Self { count, first_index } = self;
        let (place, what) = (campaign.to_owned(), what.to_owned());
        (count > 0).then_some(Finding { place, what, count, first_index })
    }
}
