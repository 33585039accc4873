//! `tracktwin library`: what a library holds, asked, copied and looked over.

mod copy;
mod digest;
mod export;
mod files;
mod import;
mod sql;
mod status;
mod verify;

use super::{OrInput, Stop, note, say};
use crate::commands::library_url::LibraryUrl;
use clap::{Args, Subcommand};
use serde::Serialize;
use tracktwin_library::{CampaignRecord, Library};

/// What can be asked of a library, and done with it.
#[derive(Subcommand)]
pub(super) enum Question {
    /// How many cases of each campaign are finished, waiting, in work and given up.
    Status(Which),
    /// A hash over all results in order: equal for equal campaigns, however and wherever they were
    /// run.
    Digest(Which),
    /// Ask in SQL; nothing can be changed.
    Sql(sql::Arguments),
    /// Write the library's tables, or its training set, as Parquet or CSV files.
    Export(export::Arguments),
    /// Add what `export` wrote as Parquet files to a library.
    Import(import::Arguments),
    /// Copy a library into another, of either kind; interrupted, the same command goes on.
    Copy(copy::Arguments),
    /// Look everything over: hashes, gaps, duplicates, numbers that are none.
    Verify(Which),
}

/// Which library is asked, and how it answers.
#[derive(Args)]
pub(super) struct Which {
    #[command(flatten)]
    library: LibraryUrl,
    /// Answer in JSON.
    #[arg(long)]
    json: bool,
}

pub(super) async fn run(question: Question) -> Result<(), Stop> {
    match question {
        Question::Status(which) => status::run(&which).await,
        Question::Digest(which) => digest::run(&which).await,
        Question::Sql(arguments) => sql::run(&arguments).await,
        Question::Export(arguments) => export::run(&arguments).await,
        Question::Import(arguments) => import::run(&arguments).await,
        Question::Copy(arguments) => copy::run(&arguments).await,
        Question::Verify(which) => verify::run(&which).await,
    }
}

async fn open(url: &LibraryUrl) -> Result<(Library, Vec<CampaignRecord>), Stop> {
    let library = url.open().await?;
    let campaigns = library.campaigns().await?;
    Ok((library, campaigns))
}

/// One campaign of a library: the named one, or the only one.
pub(super) async fn choose(library: &Library, id: Option<&str>) -> Result<CampaignRecord, Stop> {
    if let Some(id) = id {
        return library.campaign(id).await.map_err(Stop::from_library);
    }
    let campaigns = library.campaigns().await?;
    only(library, &campaigns, "choose one with --campaign").or_input().cloned()
}

/// The only campaign of a library that has these; `mend` says how to name one of several.
pub(super) fn only<'a>(
    library: &Library,
    campaigns: &'a [CampaignRecord],
    mend: &str,
) -> anyhow::Result<&'a CampaignRecord> {
    let name = library.name();
    match campaigns {
        [] => Err(anyhow::anyhow!(
            "library {name}: it holds no campaign yet; `tracktwin run` or `tracktwin campaign add` \
             adds one"
        )),
        [only] => Ok(only),
        _ => {
            let ids: Vec<_> = campaigns.iter().map(|campaign| campaign.id.as_str()).collect();
            let ids = ids.join(", ");
            Err(anyhow::anyhow!("library {name}: it holds several campaigns; {mend}: {ids}"))
        }
    }
}

fn answer<T: Serialize>(json: bool, answers: &[T], text: impl Fn(&T) -> String) {
    if json {
        let json = serde_json::to_string_pretty(answers).expect("counts and names become JSON");
        say(&json);
    } else {
        if answers.is_empty() {
            note("it holds no campaign yet; `tracktwin campaign add FILE` adds one");
        }
        for answer in answers {
            say(&text(answer));
        }
    }
}
