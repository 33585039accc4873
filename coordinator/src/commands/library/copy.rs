//! `tracktwin library copy`: copies a library into another, SQLite or PostgreSQL.

use super::{OrInput, Stop};
use crate::commands::library_url::open_or_create;
use crate::commands::progress::Progress;
use crate::commands::{print_json, println_stdout};
use anyhow::anyhow;
use clap::Args;
use serde_json::{Value, json};
use std::error::Error;
use tracktwin_library::{Cell, Library, LibraryError, Lost, Table};

/// Maximum number of rows in memory: 4 MB of results.
const ROWS_AT_A_TIME: usize = 1000;

/// Arguments of `library copy`.
#[derive(Args)]
#[command(
    after_help = "Existing rows of the target are kept, so an interrupted copy can be continued, and two \
    libraries can be merged into a third. Workers, progress and audits are brought to the later state, and \
    flags of wrong results are added. At the end the digests are compared; the exit code is 1 if a \
    campaign differs.\n\n\
    From a damaged library the intact rows are copied. Unreadable rows, and results that do not match \
    their checksum, are left out and listed (exit code 1). `tracktwin run` on the copy simulates them again."
)]
pub(in crate::commands) struct Arguments {
    /// Source library: `sqlite:PATH` or `postgres://USER@HOST/DATABASE`.
    #[arg(long, value_name = "URL")]
    from: String,
    /// Target library; created if missing.
    #[arg(long, value_name = "URL")]
    to: String,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What was copied and what was left out.
#[derive(Default)]
struct Copied {
    done: u64,
    /// Rows added or brought up to date.
    added: u64,
    left_out: Vec<String>,
}

pub(super) async fn run(arguments: &Arguments) -> Result<(), Stop> {
    let from = Library::open_to_read(&arguments.from).await?;
    if arguments.from == arguments.to || from.is_at(&arguments.to) {
        return Err(anyhow!("--from and --to are the same library; give another --to")).or_input();
    }
    let to = open_or_create(&arguments.to).await?;
    let mut copied = copy(&from, &to).await?;
    to.finish_complete_cases().await?;
    if !copied.left_out.is_empty() {
        let incomplete = to.discard_incomplete().await?;
        if incomplete > 0 {
            copied.left_out.push(format!("{incomplete} cases with incomplete results"));
        }
    }
    if !arguments.json {
        copied.print();
    }
    let compared = compare(&from, &to).await;
    to.close().await;
    let compared = compared?;
    if arguments.json {
        print_json(&copied.json(&compared));
    } else {
        for campaign in &compared {
            println_stdout(&campaign.text());
        }
    }
    let same = copied.left_out.is_empty() && compared.iter().all(Compared::is_equal);
    if same { Ok(()) } else { Err(Stop::Negative) }
}

impl Copied {
    fn print(&self) {
        let Self { done, added, left_out } = self;
        println_stdout(&format!(
            "{added} of {done} rows copied or brought up to date; the others already existed"
        ));
        for what in left_out {
            println_stdout(&format!("left out: {what}"));
        }
    }

    fn json(&self, compared: &[Compared]) -> Value {
        let campaigns: Value = compared.iter().map(Compared::json).collect();
        json!({
            "rows": self.done, "added": self.added, "left_out": self.left_out,
            "campaigns": campaigns,
        })
    }
}

async fn copy(from: &Library, to: &Library) -> Result<Copied, Stop> {
    let mut total = 0;
    for table in Table::ALL {
        // A table that cannot be counted is read as far as possible.
        total += from.count(table).await.unwrap_or(0);
    }
    let mut progress = Progress::begin("copying", 0, total);
    let mut copied = Copied::default();
    for table in Table::ALL {
        let mut refused = Vec::new();
        let take = async |rows: Vec<Vec<Cell>>| {
            copied.done += rows.len() as u64;
            let (added, errors) = to.write_what_is_whole(table, rows).await?;
            copied.added += added;
            refused.extend(errors);
            progress.at(copied.done, table.name);
            Ok::<(), Stop>(())
        };
        let lost = from.read_what_is_whole(table, ROWS_AT_A_TIME, take).await?;
        copied.left_out.extend(lost.map(|lost| unread(table, &lost)));
        copied.left_out.extend(unwritten(table, &refused));
    }
    progress.end();
    Ok(copied)
}

fn unread(table: &Table, lost: &Lost) -> String {
    let rows = lost.rows.map_or_else(|| "some".to_owned(), |rows| format!("up to {rows}"));
    format!("{rows} unreadable rows of {}: {}", table.name, lost.reason)
}

fn unwritten(table: &Table, refused: &[LibraryError]) -> Option<String> {
    let first = refused.first()?;
    let reason = match first.source() {
        Some(source) => format!("{first}: {source}"),
        None => first.to_string(),
    };
    Some(format!("{} damaged rows of {}; the first: {reason}", refused.len(), table.name))
}

/// Digests of a campaign in both libraries, and the reason if the source has no digest.
struct Compared {
    campaign: String,
    from: Result<String, String>,
    to: String,
}

impl Compared {
    fn is_equal(&self) -> bool {
        self.from.as_ref().is_ok_and(|from| *from == self.to)
    }

    fn text(&self) -> String {
        let Self { campaign, from, to } = self;
        match from {
            Ok(from) if from == to => format!("{from}  {campaign}: equal"),
            Ok(from) => format!("{campaign}: differs: {from} and {to}"),
            Err(error) => format!("{campaign}: cannot be compared: {error}"),
        }
    }

    fn json(&self) -> Value {
        json!({
            "campaign": self.campaign, "equal": self.is_equal(), "digest_from": self.from.as_ref().ok(),
            "digest_to": self.to, "error": self.from.as_ref().err(),
        })
    }
}

/// Compares each campaign in both libraries. If the source's list of campaigns is damaged, those of the copy are
/// compared that the source has too.
async fn compare(from: &Library, to: &Library) -> Result<Vec<Compared>, LibraryError> {
    let campaigns = match from.campaigns().await {
        Err(error) if error.is_of_the_data() => to.campaigns().await?,
        read => read?,
    };
    let mut compared = Vec::new();
    for campaign in campaigns {
        let of_source = match from.digest(&campaign.id).await {
            Err(LibraryError::UnknownCampaign { .. }) => continue,
            Err(error) if error.is_of_the_data() => Err(error.to_string()),
            read => Ok(read?),
        };
        compared.push(Compared {
            to: to.digest(&campaign.id).await?,
            from: of_source,
            campaign: campaign.id,
        });
    }
    Ok(compared)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_source_that_is_away_is_not_a_source_without_campaigns() {
        let folder = tempfile::tempdir().unwrap();
        let url = |name: &str| format!("sqlite:{}", folder.path().join(name).display());
        let from = Library::open_or_create(&url("from.sqlite")).await.unwrap();
        let to = Library::open_or_create(&url("to.sqlite")).await.unwrap();
        assert!(compare(&from, &to).await.unwrap().is_empty());
        from.clone().close().await;
        let error = compare(&from, &to).await.err();
        assert!(matches!(error, Some(LibraryError::Closed)), "{error:?}");
    }
}
