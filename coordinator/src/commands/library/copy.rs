//! `tracktwin library copy`: a library into another, of either kind.

use super::{OrInput, Stop};
use crate::commands::progress::Progress;
use crate::commands::say;
use anyhow::anyhow;
use clap::Args;
use tracktwin_library::{Cell, Library, Table};

/// Rows held at a time: 4 MB of results.
const ROWS_AT_A_TIME: usize = 1000;

/// What `library copy` is told.
#[derive(Args)]
#[command(
    after_help = "Rows that are there already stay as they are, so a copy that was interrupted \
    is gone on with,\nand two libraries can be joined in a third. In the end the digests are compared: \
    exit code 1\nwhere a campaign is not the same in both."
)]
pub(in crate::commands) struct Arguments {
    /// The library to copy: `sqlite:PATH` or `postgres://USER@HOST/DATABASE`.
    #[arg(long, value_name = "URL")]
    from: String,
    /// Where to; made where there is none.
    #[arg(long, value_name = "URL")]
    to: String,
}

pub(super) async fn run(arguments: &Arguments) -> Result<(), Stop> {
    if arguments.from == arguments.to {
        return Err(anyhow!("--from and --to are the same library")).or_input();
    }
    let from = Library::open(&arguments.from).await?;
    let to = Library::open_or_create(&arguments.to).await?;
    let mut total = 0;
    for table in Table::ALL {
        total += from.count(table).await?;
    }
    let mut progress = Progress::begin("copying", 0, total);
    let mut done = 0;
    let mut added = 0;
    for table in Table::ALL {
        let take = async |rows: Vec<Vec<Cell>>| {
            done += rows.len() as u64;
            added += to.write_table(table, rows).await?;
            progress.at(done, table.name);
            Ok::<(), Stop>(())
        };
        from.read_table(table, ROWS_AT_A_TIME, take).await?;
    }
    progress.end();
    to.settle().await?;
    say(&format!("{added} of {done} rows copied; the others were there"));
    let same = compare(&from, &to).await;
    to.close().await;
    same
}

/// Says of each campaign whether it is the same in both.
async fn compare(from: &Library, to: &Library) -> Result<(), Stop> {
    let mut differ = false;
    for campaign in from.campaigns().await? {
        let (here, there) = (from.digest(&campaign.id).await?, to.digest(&campaign.id).await?);
        if here == there {
            say(&format!("{here}  {}: the same in both", campaign.id));
        } else {
            differ = true;
            say(&format!("{}: differs: {here} and {there}", campaign.id));
        }
    }
    if differ { Err(Stop::Negative) } else { Ok(()) }
}
