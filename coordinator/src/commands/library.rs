//! `tracktwin library`: what a library holds.

use super::{OrInput, Stop, say};
use clap::{Args, Subcommand};
use serde::Serialize;
use tracktwin_library::{CampaignRecord, Library};

/// How many given-up cases `status` explains.
const FAILURES_SHOWN: u32 = 5;

/// What can be asked.
#[derive(Subcommand)]
pub(super) enum Question {
    /// How many cases of each campaign are finished, waiting, in work and given up.
    Status(Which),
    /// A hash over all results in order: equal for equal campaigns, however they were run.
    Digest(Which),
}

/// Which library is asked, and how it answers.
#[derive(Args)]
pub(super) struct Which {
    /// The library: sqlite:PATH.
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY")]
    library: String,
    /// Answer in JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Counts {
    campaign: String,
    cases: u32,
    finished: u32,
    waiting: u32,
    leased: u32,
    failed: u32,
    speeds_km_h: Vec<f64>,
    failures: Vec<Failure>,
}

#[derive(Serialize)]
struct Failure {
    sobol_index: u32,
    error: String,
}

#[derive(Serialize)]
struct Digest {
    campaign: String,
    digest: String,
}

pub(super) async fn run(question: Question) -> Result<(), Stop> {
    match question {
        Question::Status(which) => status(&which).await,
        Question::Digest(which) => digest(&which).await,
    }
}

async fn status(which: &Which) -> Result<(), Stop> {
    let (library, campaigns) = open(&which.library).await?;
    let mut answers = Vec::new();
    for campaign in campaigns {
        answers.push(counts(&library, campaign).await?);
    }
    answer(which.json, &answers, Counts::text);
    Ok(())
}

impl Counts {
    fn text(&self) -> String {
        let Self { campaign, cases, finished, waiting, leased, failed, .. } = self;
        let counts = format!(
            "{campaign}: {cases} cases, {finished} finished, {waiting} waiting, {leased} in work, \
             {failed} given up"
        );
        let failures = self.failures.iter().map(|Failure { sobol_index, error }| {
            format!("\n  case {sobol_index} was given up: {error}")
        });
        counts + &failures.collect::<String>()
    }
}

async fn counts(library: &Library, campaign: CampaignRecord) -> Result<Counts, Stop> {
    let status = library.status(&campaign.id).await?;
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
        speeds_km_h: campaign.speeds_km_h,
        failures: failures.collect(),
        campaign: campaign.id,
    })
}

async fn digest(which: &Which) -> Result<(), Stop> {
    let (library, campaigns) = open(&which.library).await?;
    let mut answers = Vec::new();
    for campaign in campaigns {
        let digest = library.digest(&campaign.id).await?;
        answers.push(Digest { campaign: campaign.id, digest });
    }
    answer(which.json, &answers, |Digest { campaign, digest }| format!("{digest}  {campaign}"));
    Ok(())
}

async fn open(url: &str) -> Result<(Library, Vec<CampaignRecord>), Stop> {
    let library = Library::open(url).await.or_input()?;
    let campaigns = library.campaigns().await?;
    Ok((library, campaigns))
}

/// One campaign of a library: the named one, or the only one.
pub(super) async fn choose(library: &Library, id: Option<&str>) -> Result<CampaignRecord, Stop> {
    if let Some(id) = id {
        return library.campaign(id).await.or_input();
    }
    let mut campaigns = library.campaigns().await?;
    let names: Vec<_> = campaigns.iter().map(|campaign| campaign.id.as_str()).collect();
    let path = library.name();
    match campaigns.len() {
        0 => Err(anyhow::anyhow!(
            "library {path}: it holds no campaign yet; `tracktwin run` adds one"
        ))
        .or_input(),
        1 => Ok(campaigns.remove(0)),
        _ => Err(anyhow::anyhow!(
            "library {path}: it holds several campaigns; choose one with --campaign: {}",
            names.join(", ")
        ))
        .or_input(),
    }
}

fn answer<T: Serialize>(json: bool, answers: &[T], text: impl Fn(&T) -> String) {
    if json {
        let json = serde_json::to_string_pretty(answers).expect("counts and names become JSON");
        say(&json);
    } else {
        for answer in answers {
            say(&text(answer));
        }
    }
}
