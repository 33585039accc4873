//! Monitors the campaigns of a coordinator: log messages, and the end when all campaigns are done.

use crate::dispatch::is_news;
use std::collections::HashMap;
use std::error::Error;
use std::time::Duration;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tracktwin_library::{CampaignOverview, CampaignState, Library, LibraryError};

/// Interval of reading the state of the campaigns.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Minimum interval of progress messages in the log.
const TELL_EVERY: Duration = Duration::from_mins(1);

/// A worker whose last message is at most this old, in ms, is present.
const PRESENT_MS: i64 = 60_000;

/// Monitors the campaigns until `stop` is cancelled or nothing is left to do.
///
/// # Errors
/// Returns [`LibraryError::Closed`] or [`LibraryError::Lost`] if the library can no longer be written. The
/// program must be restarted.
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
            Err(error) if is_news(&error.to_string(), std::time::Instant::now()) => {
                tracing::error!(error = &error as &dyn Error, "the library does not respond");
            }
            Err(_) => {}
        }
        tokio::select! {
            () = tokio::time::sleep(LOOK_EVERY) => {}
            () = stop.cancelled() => {}
        }
    }
    Ok(())
}

/// State at the last log message, to avoid repeated messages.
#[derive(Default)]
struct Logged {
    /// For each campaign: number of cases given up, and whether the campaign is done.
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
    /// Open cases of running campaigns.
    cases: u64,
    /// Open cases of paused campaigns.
    paused: u64,
    /// Open audits.
    audits: u64,
    /// Open audits that a present worker could do.
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
            tracing::warn!(audits, "done, except for audits, which need a second worker");
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
