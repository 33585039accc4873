//! Verification of cases, and of the rows that belong to them, against the constraints of the schema.

use super::{Fault, Survey};
use crate::case::case_of;
use crate::engine::{Text, sql};
use crate::{CampaignRecord, LibraryError};
use tokio_stream::StreamExt;

/// Statements that find the indices of cases with a fault; `$1` is the campaign.
const FAULTS: [(&str, Text); 9] = [
    (
        "finished cases without a result at every speed",
        Text::Each {
            sqlite: "
                select sobol_index from campaign_case where campaign_id = $1 and state = 'finished'
                    and (select count(*) from result where result.campaign_id = campaign_case.campaign_id
                        and result.sobol_index = campaign_case.sobol_index)
                    <> (select json_array_length(speeds_km_h) from campaign where id = $1)",
            postgres: "
                select sobol_index from campaign_case where campaign_id = $1 and state = 'finished'
                    and (select count(*) from result where result.campaign_id = campaign_case.campaign_id
                        and result.sobol_index = campaign_case.sobol_index)
                    <> (select jsonb_array_length(speeds_km_h::jsonb) from campaign where id = $1)",
        },
    ),
    (
        "results of cases that are not finished",
        Text::same(
            "select distinct sobol_index from result join campaign_case using (campaign_id, sobol_index)
        where campaign_id = $1 and campaign_case.state <> 'finished'",
        ),
    ),
    (
        "results with parameters that differ from their case's",
        Text::same(
            "select distinct sobol_index from result join campaign_case using (campaign_id, sobol_index)
        where campaign_id = $1 and result.parameter_hash <> campaign_case.parameter_hash",
        ),
    ),
    (
        "results with an experiment that differs from the campaign's",
        Text::same(
            "select distinct sobol_index from result
        where campaign_id = $1
            and experiment_hash <> (select experiment_hash from campaign where id = $1)",
        ),
    ),
    (
        "results of another model than the first case's",
        Text::same(
            "select distinct sobol_index from result
        where campaign_id = $1 and model_hash <> (
            select model_hash from result where campaign_id = $1
            order by sobol_index, speed_km_h limit 1)",
        ),
    ),
    (
        "results of a worker that computed wrong results (flagged; `tracktwin campaign retry --flagged`)",
        Text::same(
            "select distinct sobol_index from result where campaign_id = $1 and flagged is not null",
        ),
    ),
    (
        "cases with the parameters and surface of an earlier case",
        Text::same(
            "select max(sobol_index) as sobol_index from campaign_case where campaign_id = $1
        group by parameter_hash having count(*) > 1",
        ),
    ),
    (
        "gaps in the cases' indices",
        Text::same(
            "select sobol_index from campaign_case as after_gap
        where campaign_id = $1 and sobol_index > 0 and not exists (
            select 1 from campaign_case as before_gap where before_gap.campaign_id = $1
                and before_gap.sobol_index = after_gap.sobol_index - 1)",
        ),
    ),
    (
        "leases with an impossible epoch",
        Text::same(
            "select distinct sobol_index from attempt join campaign_case using (campaign_id, sobol_index)
        where campaign_id = $1 and attempt.epoch not between 1 and campaign_case.epoch",
        ),
    ),
];

impl<F: FnMut()> Survey<'_, F> {
    pub(super) async fn faults(&mut self, campaign: &CampaignRecord) -> Result<(), LibraryError> {
        let readers = self.library.readers();
        for (what, ask) in FAULTS {
            let ask = sql(ask).bind(&campaign.id);
            let mut fault = Fault::default();
            let mut rows = readers.stream(ask);
            while let Some(row) = rows.next().await {
                match row.and_then(|row| row.get_u32("sobol_index")) {
                    Ok(index) => fault.at(index),
                    Err(error) => {
                        self.unreadable(&campaign.id, what, error)?;
                        break;
                    }
                }
            }
            self.fault(&campaign.id, what, &fault);
        }
        Ok(())
    }

    pub(super) fn fault(&mut self, campaign: &str, what: &str, fault: &Fault) {
        if fault.count > 0 {
            self.add(campaign, what, fault.count, fault.first_index);
        }
    }

    pub(super) async fn cases(&mut self, campaign: &CampaignRecord) -> Result<(), LibraryError> {
        let ask = sql("select * from campaign_case where campaign_id = $1 order by sobol_index");
        let mut rows = self.library.readers().stream(ask.bind(&campaign.id));
        let (mut hash, mut finite) = (Fault::default(), Fault::default());
        while let Some(row) = rows.next().await {
            let read =
                row.and_then(|row| Ok((case_of(&row)?, row.get::<String>("parameter_hash")?)));
            let (case, told) = match read {
                Ok(read) => read,
                Err(error) => {
                    self.unreadable(&campaign.id, "cases", error)?;
                    break;
                }
            };
            if case.parameter_hash() != told {
                hash.at(case.index);
            }
            if !case.parameters.values().iter().all(|value| value.is_finite()) {
                finite.at(case.index);
            }
        }
        self.fault(&campaign.id, "cases that do not match their hash", &hash);
        self.fault(&campaign.id, "cases with NaN or infinite parameters", &finite);
        Ok(())
    }

    pub(super) async fn counts(&mut self, campaign: &CampaignRecord) -> Result<(), LibraryError> {
        let count = sql("select state, count(*) as cases from campaign_case
            where campaign_id = $1 group by state");
        let library = self.library;
        let counted = library.counts(count.bind(&campaign.id)).await;
        let kept = library.status(&campaign.id).await;
        match counted.and_then(|counted| Ok(counted == kept?)) {
            Ok(true) => {}
            Ok(false) => {
                self.add(&campaign.id, "the stored counts of cases differ from the cases", 1, None);
            }
            Err(error) => self.unreadable(&campaign.id, "counts of cases", error)?,
        }
        Ok(())
    }
}
