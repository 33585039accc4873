//! Log of a coordinator's campaigns, and the end when all are done.

use std::collections::HashMap;
use std::error::Error;
use std::time::Duration;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tracktwin_library::{CampaignOverview, CampaignState, Library, LibraryError};

/// Interval of checking the campaigns.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Interval of the progress lines in the log.
const TELL_EVERY: Duration = Duration::from_mins(1);

/// A worker with a message in this time, in ms, is present.
const PRESENT_MS: i64 = 60_000;

/// Checks the campaigns until it is stopped, or until nothing is left to do.
///
/// # Errors
/// [`LibraryError::Closed`] or [`LibraryError::Lost`] when nothing can be written any more; a
/// restart is required.
pub(super) async fn watch(
    library: Library,
    exit_when_done: bool,
    stop: CancellationToken,
) -> Result<(), LibraryError> {
    let mut logged = Logged::default();
    while !stop.is_cancelled() {
        if let Err(error) = library.takes_writes() {
            stop.cancel();
            return Err(error);
        }
        match look(&library).await {
            Ok((campaigns, remaining)) => {
                for campaign in &campaigns {
                    logged.campaign(campaign);
                }
                logged.remaining(&remaining);
                if remaining.is_done() && exit_when_done {
                    remaining.log_end();
                    stop.cancel();
                }
            }
            Err(error) => {
                tracing::error!(error = &error as &dyn Error, "the library does not respond");
            }
        }
        tokio::select! {
            () = tokio::time::sleep(LOOK_EVERY) => {}
            () = stop.cancelled() => {}
        }
    }
    Ok(())
}

/// What was logged last, to avoid repetition.
#[derive(Default)]
struct Logged {
    /// Of each campaign: cases given up, and whether it is done.
    campaigns: HashMap<String, (u32, bool)>,
    remaining: Option<(u64, Instant)>,
}

impl Logged {
    fn campaign(&mut self, campaign: &CampaignOverview) {
        let CampaignOverview { id, status, causes, .. } = campaign;
        let now = (status.failed, status.done() == status.total());
        let new = !self.campaigns.contains_key(id);
        let before = self.campaigns.insert(id.clone(), now).unwrap_or((0, false));
        if now.0 > before.0 {
            let cause = causes.first().map_or("", |cause| cause.error.as_str());
            tracing::warn!(campaign = id, cases = now.0, cause, "cases were given up");
        }
        // One that was done before this coordinator came is no news.
        if now.1 && !before.1 && !new {
            tracing::info!(campaign = id, finished = status.finished, "campaign done");
        }
    }

    fn remaining(&mut self, remaining: &Remaining) {
        let is_news = |&(cases, at): &(u64, Instant)| {
            cases != remaining.cases && (at.elapsed() >= TELL_EVERY || remaining.cases == 0)
        };
        if self.remaining.as_ref().is_none_or(is_news) {
            self.remaining = Some((remaining.cases, Instant::now()));
            tracing::info!(cases = remaining.cases, "cases left to simulate");
        }
    }
}

/// Remaining work.
#[derive(Default)]
struct Remaining {
    /// In campaigns that run.
    cases: u64,
    /// In paused ones.
    paused: u64,
    /// Open audits.
    audits: u64,
    /// Those of them that a worker who is there could do.
    audits_to_do: u64,
}

impl Remaining {
    const fn is_done(&self) -> bool {
        self.cases + self.audits_to_do == 0
    }

    fn log_end(&self) {
        let Self { paused, audits, .. } = *self;
        if paused > 0 {
            tracing::warn!(cases = paused, "done, except for paused campaigns");
        } else if audits > 0 {
            tracing::warn!(audits, "waiting: audits need a second worker");
        } else {
            tracing::info!("all campaigns are done");
        }
    }
}

async fn look(library: &Library) -> Result<(Vec<CampaignOverview>, Remaining), LibraryError> {
    let mut remaining = Remaining::default();
    let since_unix_ms = library.now_unix_ms() - PRESENT_MS;
    let campaigns = library.overview().await?;
    for campaign in &campaigns {
        let cases = u64::from(campaign.status.total() - campaign.status.done());
        match campaign.state {
            CampaignState::Running => {
                remaining.cases += cases;
                remaining.audits += u64::from(library.audits(&campaign.id).await?.open);
                let to_do = library.audits_to_do(&campaign.id, since_unix_ms).await?;
                remaining.audits_to_do += u64::from(to_do);
            }
            CampaignState::Paused => remaining.paused += cases,
            CampaignState::Cancelled => {}
        }
    }
    Ok((campaigns, remaining))
}
