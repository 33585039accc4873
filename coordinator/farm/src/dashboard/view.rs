//! Reads the state of a farm from its library.

use super::status::{Farm, FarmCampaign, FarmWorker};
use time::OffsetDateTime;
use tracktwin_experiment::Experiment;
use tracktwin_library::{
    CampaignOverview, ContactLoss, Library, LibraryError, WorkerRecord, WorkerState,
};

/// Newest cases whose spectra are shown.
const NEWEST: u32 = 5;

/// Maximum number of finished cases shown in the parameter space; enough to judge its coverage.
const COVERED: u32 = 2000;

/// Maximum number of given-up cases shown in the parameter space.
const GIVEN_UP: u32 = 200;

/// A worker without a message for this time, in ms, is not shown.
const HISTORY_MS: i64 = 3_600_000;

/// Amount of data to read from the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Counts, rates and workers.
    Counts,
    /// Spectra and parameter space as well.
    Pictures,
}

/// Reads the state of a farm from its library. The library contains the complete state, because several
/// coordinators can share it.
///
/// # Errors
/// Returns [`LibraryError`] if the library cannot be read.
pub async fn farm(library: &Library, detail: Detail) -> Result<Farm, LibraryError> {
    let now_unix_ms = library.now_unix_ms();
    let mut overview = library.overview().await?;
    // In the order of leasing: highest priority first, the oldest among equals.
    overview.sort_by_key(|campaign| std::cmp::Reverse(campaign.priority));
    let mut campaigns = Vec::with_capacity(overview.len());
    for overview in overview {
        let lost = library.contact_loss(&overview.id).await?;
        let campaign = with_counts(&overview, lost);
        campaigns.push(match detail {
            Detail::Counts => campaign,
            Detail::Pictures => with_charts(library, campaign).await?,
        });
    }
    let workers = library.workers(now_unix_ms - HISTORY_MS).await?;
    let mut workers: Vec<_> = workers.into_iter().map(|it| worker(it, now_unix_ms)).collect();
    workers.sort_by(|a, b| a.silent_s.total_cmp(&b.silent_s).then_with(|| a.id.cmp(&b.id)));
    let at = format_utc(now_unix_ms);
    Ok(Farm { library: library.name(), at, campaigns, workers, may_control: false })
}

fn with_counts(overview: &CampaignOverview, lost: ContactLoss) -> FarmCampaign {
    let CampaignOverview { status, causes, .. } = overview;
    FarmCampaign {
        id: overview.id.clone(),
        state: overview.state.name().to_owned(),
        priority: overview.priority.into(),
        waiting: status.waiting,
        leased: status.leased,
        finished: status.finished,
        failed: status.failed,
        per_second: overview.per_second,
        contact_lost: lost.cases,
        contact_loss_share_max: lost.largest_share,
        causes: causes.iter().map(|it| (it.error.clone(), it.cases)).collect(),
        ..FarmCampaign::default()
    }
}

/// Reads what the charts of a campaign show; the counts are left out.
///
/// # Errors
/// Returns [`LibraryError`] if the library cannot be read or has no such campaign.
pub(super) async fn drawn(library: &Library, id: String) -> Result<FarmCampaign, LibraryError> {
    with_charts(library, FarmCampaign { id, ..FarmCampaign::default() }).await
}

async fn with_charts(
    library: &Library,
    campaign: FarmCampaign,
) -> Result<FarmCampaign, LibraryError> {
    let id = &campaign.id;
    let record = library.campaign(id).await?;
    let frequencies_hz = Experiment::from_json(&record.experiment_json)
        .map(|experiment| experiment.features.frequencies_hz())
        .unwrap_or_default();
    let newest = library.newest(id, NEWEST).await?.into_iter().filter_map(|entry| {
        let features = entry.features.into_iter().next()?;
        Some((entry.case.index.to_string(), features.log_power))
    });
    let newest = newest.collect();
    let covered = library.covered(id, COVERED).await?;
    let given_up = library.failures(id, GIVEN_UP).await?.into_iter();
    let given_up = given_up.map(|case| case.case.parameters).collect();
    Ok(FarmCampaign { frequencies_hz, newest, covered, given_up, ..campaign })
}

fn worker(record: WorkerRecord, now_unix_ms: i64) -> FarmWorker {
    let silent_ms = now_unix_ms.saturating_sub(record.last_seen_unix_ms).max(0);
    let case_s = record.mean_case_s();
    let in_a_row = record.failures_in_a_row;
    let failing = (in_a_row > 1).then(|| format!("{in_a_row} failures in a row"));
    FarmWorker {
        quarantined: record.state == WorkerState::Quarantined,
        aside: record.reason.map(|reason| format!("quarantine: {reason}")).or(failing),
        id: record.id,
        code_version: record.code_version,
        cores: record.cores,
        finished: record.cases_finished.into(),
        failed: record.cases_failed.into(),
        case_s,
        silent_s: silent_ms as f64 / 1000.0,
    }
}

/// An instant, in UTC to the second.
fn format_utc(unix_ms: i64) -> String {
    let instant = OffsetDateTime::from_unix_timestamp(unix_ms.div_euclid(1000));
    let instant = instant.unwrap_or(OffsetDateTime::UNIX_EPOCH);
    let (date, (hour, minute, second)) = (instant.date(), instant.to_hms());
    format!("{date} {hour:02}:{minute:02}:{second:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::format_utc;

    #[test]
    fn instants_are_said_in_utc() {
        assert_eq!(format_utc(1_000_000_000_000), "2001-09-09 01:46:40 UTC");
    }
}
