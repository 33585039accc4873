//! `tracktwin library`: what a library holds, asked, copied and looked over.

mod copy;
mod digest;
mod export;
mod files;
mod import;
mod sql;
mod status;
mod verify;

use super::{OrInput, Stop, println_stderr, println_stdout};
use crate::commands::library_url::LibraryUrl;
use anyhow::anyhow;
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

/// How one of several campaigns is named with most commands.
pub(super) const CHOOSE_REMEDY: &str = "choose one with --campaign";

/// One campaign of a library: the one with this id or this name, or the only one; `remedy` says how
/// to name one of several.
pub(super) async fn choose(
    library: &Library,
    named: Option<&str>,
    remedy: &str,
) -> Result<CampaignRecord, Stop> {
    let all = library.campaigns().await?;
    let ids =
        |of: &[&CampaignRecord]| of.iter().map(|it| it.id.as_str()).collect::<Vec<_>>().join(", ");
    let is_meant =
        |it: &&CampaignRecord| named.is_none_or(|named| it.id == named || it.name == named);
    let meant: Vec<_> = all.iter().filter(is_meant).collect();
    let wrong = match (&meant[..], named) {
        ([one], _) => return Ok((*one).clone()),
        ([], _) if all.is_empty() => "it holds no campaign yet; `tracktwin run` or `tracktwin \
                                      campaign add` adds one"
            .to_owned(),
        ([], named) => {
            let all: Vec<_> = all.iter().collect();
            format!("it has no campaign {}; it has {}", named.unwrap_or_default(), ids(&all))
        }
        (several, None) => format!("it holds several campaigns; {remedy}: {}", ids(several)),
        (several, Some(named)) => {
            format!("several campaigns are called {named}; give the id: {}", ids(several))
        }
    };
    Err(Stop::Input(anyhow!("library {}: {wrong}", library.name())))
}

fn print_answers<T: Serialize>(json: bool, answers: &[T], text: impl Fn(&T) -> String) {
    if json {
        let json = serde_json::to_string_pretty(answers).expect("counts and names become JSON");
        println_stdout(&json);
    } else {
        if answers.is_empty() {
            println_stderr("it holds no campaign yet; `tracktwin campaign add FILE` adds one");
        }
        for answer in answers {
            println_stdout(&text(answer));
        }
    }
}
