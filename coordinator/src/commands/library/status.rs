//! `tracktwin library status`: counts of cases by state.

use super::{Stop, Which, open, print_answers};
use crate::commands::contact::contact_sentence;
use serde::Serialize;
use tracktwin_library::{CampaignRecord, ContactLoss, Library};

/// Number of given-up cases listed with their reason.
const FAILURES_SHOWN: u32 = 5;

#[derive(Serialize)]
struct Counts {
    campaign: String,
    cases: u32,
    finished: u32,
    waiting: u32,
    leased: u32,
    failed: u32,
    flagged: u32,
    speeds_km_h: Vec<f64>,
    contact_lost: u32,
    contact_loss_share_max: f64,
    failures: Vec<Failure>,
}

#[derive(Serialize)]
struct Failure {
    sobol_index: u32,
    error: String,
}

pub(super) async fn run(which: &Which) -> Result<(), Stop> {
    let (library, campaigns) = open(&which.library).await?;
    let mut answers = Vec::new();
    for campaign in campaigns {
        answers.push(counts(&library, campaign).await?);
    }
    print_answers(which.json, &answers, Counts::text);
    Ok(())
}

impl Counts {
    fn text(&self) -> String {
        let Self { campaign, cases, finished, waiting, leased, failed, .. } = self;
        let counts = format!(
            "{campaign}: {cases} cases, {finished} finished, {waiting} waiting, {leased} \
                 leased, {failed} given up"
        );
        let failures = self.failures.iter().map(|Failure { sobol_index, error }| {
            format!("\n  case {sobol_index} was given up: {error}")
        });
        let lost =
            ContactLoss { cases: self.contact_lost, largest_share: self.contact_loss_share_max };
        let contact = format!("\n  {}", contact_sentence(lost, *finished));
        let flagged = match self.flagged {
            0 => String::new(),
            flagged => format!(
                "\n  {flagged} cases have results of a worker that computed wrong results: `tracktwin campaign \
                     retry --flagged` deletes them, and `tracktwin run` or a coordinator computes them again"
            ),
        };
        counts + &contact + &flagged + &failures.collect::<String>()
    }
}

async fn counts(library: &Library, campaign: CampaignRecord) -> Result<Counts, Stop> {
    let status = library.status(&campaign.id).await?;
    let lost = library.contact_loss(&campaign.id).await?;
    let failures = library.failures(&campaign.id, FAILURES_SHOWN).await?;
    let failures = failures.into_iter().map(|case| Failure {
        sobol_index: case.case.index,
        error: case.error.unwrap_or_default(),
    });
    Ok(Counts {
        cases: status.total(),
        finished: status.finished,
        waiting: status.waiting,
        leased: status.leased,
        failed: status.failed,
        flagged: library.flagged(&campaign.id).await?,
        speeds_km_h: campaign.speeds_km_h,
        contact_lost: lost.cases,
        contact_loss_share_max: lost.largest_share,
        failures: failures.collect(),
        campaign: campaign.id,
    })
}
