//! `tracktwin library`: queries, copies and verifies a library.

mod copy;
mod digest;
mod export;
mod files;
mod import;
mod sql;
mod status;
mod upgrade;
mod verify;

use super::{OrInput, Stop, print_json, println_stderr, println_stdout};
use crate::commands::library_url::LibraryUrl;
use anyhow::anyhow;
use clap::{Args, Subcommand};
use serde::Serialize;
use tracktwin_library::{CampaignRecord, Library};

/// The subcommands.
#[derive(Subcommand)]
pub(super) enum Question {
    /// Count the finished, waiting, leased and given-up cases of each campaign.
    Status(Which),
    /// Print one hash over all results of each campaign; equal campaigns have equal hashes.
    Digest(Which),
    /// Query with SQL (read-only).
    Sql(sql::Arguments),
    /// Write the tables or the training set as Parquet or CSV files.
    Export(export::Arguments),
    /// Add tables written by `export` (Parquet) to a library, which is created if missing.
    Import(import::Arguments),
    /// Copy a library into another, SQLite or PostgreSQL; repeat the command to continue an
    /// interrupted copy.
    Copy(copy::Arguments),
    /// Update the schema of a library that an earlier version wrote. Stop its coordinators first.
    Upgrade(LibraryUrl),
    /// Verify integrity: hashes, gaps, duplicates, NaN and infinite values.
    #[command(after_help = "\
`tracktwin library copy` copies the intact rows to another library. `tracktwin campaign retry
--altered` has altered results simulated again.

Exit codes: 0 no faults found, 1 faults found, 2 wrong input, 3 failure.")]
    Verify(Which),
}

/// Library and output format.
#[derive(Args)]
pub(super) struct Which {
    #[command(flatten)]
    library: LibraryUrl,
    /// Print JSON.
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
        Question::Upgrade(url) => upgrade::run(&url).await,
        Question::Verify(which) => verify::run(&which).await,
    }
}

async fn open(url: &LibraryUrl) -> Result<(Library, Vec<CampaignRecord>), Stop> {
    let library = url.open_to_read().await?;
    let campaigns = library.campaigns().await?;
    Ok((library, campaigns))
}

/// Remedy if the library holds several campaigns, for most commands.
pub(super) const CHOOSE_REMEDY: &str = "choose one with --campaign";

/// One campaign of a library: the one with this id or name, or the only one; `remedy` states how to
/// choose one of several.
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
        ([], _) if all.is_empty() => {
            "it holds no campaign; add one with `tracktwin run` or `tracktwin campaign add`"
                .to_owned()
        }
        ([], named) => {
            let all: Vec<_> = all.iter().collect();
            format!(
                "it has no campaign {}; choose one of: {}",
                named.unwrap_or_default(),
                ids(&all)
            )
        }
        (several, None) => format!("it holds several campaigns; {remedy}: {}", ids(several)),
        (several, Some(named)) => {
            format!("several campaigns are named {named}; give the id: {}", ids(several))
        }
    };
    Err(Stop::Input(anyhow!("library {}: {wrong}", library.name())))
}

fn print_answers<T: Serialize>(json: bool, answers: &[T], text: impl Fn(&T) -> String) {
    if json {
        print_json(&answers);
    } else {
        if answers.is_empty() {
            println_stderr(
                "the library holds no campaign; add one with `tracktwin campaign add FILE`",
            );
        }
        for answer in answers {
            println_stdout(&text(answer));
        }
    }
}
