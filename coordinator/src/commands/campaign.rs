//! `tracktwin campaign`: adds campaigns to a library and steers them, whoever serves it.

use super::{OrInput, Stop, say};
use crate::campaign::Campaign;
use crate::farm;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use tracktwin_library::{Library, Retry};

/// What is to be done.
#[derive(Subcommand)]
pub(super) enum Action {
    /// Add a campaign, or more cases to one that is there; coordinators hand them out at once.
    Add {
        /// Campaign file (TOML).
        file: PathBuf,
        /// How many cases, instead of the campaign's own number.
        #[arg(long, value_name = "N")]
        cases: Option<u32>,
        /// Cases of the campaign with the largest priority are handed out first; 0 is the usual.
        #[arg(long, value_name = "N", allow_negative_numbers = true)]
        priority: Option<i32>,
        #[command(flatten)]
        which: Which,
    },
    /// Hand out no more of a campaign's cases; those in work are finished.
    Pause(Named),
    /// Hand out a paused or cancelled campaign's cases again.
    Resume(Named),
    /// Hand out no more of a campaign's cases and take back those in work. Results stay.
    Cancel(Named),
    /// Try cases again that were given up.
    Retry {
        #[command(flatten)]
        named: Named,
        /// Only this case; may be repeated.
        #[arg(long = "case", value_name = "INDEX", conflicts_with = "flagged")]
        cases: Vec<u32>,
        /// Cases whose results were flagged by an audit; those results are thrown away.
        #[arg(long)]
        flagged: bool,
    },
    /// Say how urgent a campaign is.
    Priority {
        #[command(flatten)]
        named: Named,
        /// The largest goes first; 0 is the usual.
        #[arg(long, value_name = "N", allow_negative_numbers = true, required = true)]
        to: i32,
    },
    /// Give cases to a worker again that is in quarantine.
    Pardon {
        /// The worker's name.
        worker: String,
        #[command(flatten)]
        which: Which,
    },
}

/// Which library is meant.
#[derive(Args)]
pub(super) struct Which {
    /// The library: sqlite:PATH or `postgres://USER@HOST/DATABASE`.
    #[arg(long, value_name = "URL", env = "TRACKTWIN_LIBRARY")]
    library: String,
}

/// Which campaign is meant.
#[derive(Args)]
pub(super) struct Named {
    /// Its id, as `tracktwin status` tells it, or its name if no other has the same; may be left
    /// out where there is only one.
    campaign: Option<String>,
    #[command(flatten)]
    which: Which,
}

pub(super) async fn run(action: Action) -> Result<(), Stop> {
    match action {
        Action::Add { file, cases, priority, which } => add(file, cases, priority, &which).await,
        Action::Pause(named) => {
            let (library, id) = named.open().await?;
            library.pause(&id).await?;
            done(library, &format!("{id} is paused; cases in work are finished")).await
        }
        Action::Resume(named) => {
            let (library, id) = named.open().await?;
            library.resume(&id).await?;
            done(library, &format!("{id} runs")).await
        }
        Action::Cancel(named) => {
            let (library, id) = named.open().await?;
            library.cancel(&id).await?;
            done(library, &format!("{id} is cancelled; its results stay")).await
        }
        Action::Retry { named, cases, flagged } => {
            let (library, id) = named.open().await?;
            let which = match (flagged, cases.is_empty()) {
                (true, _) => Retry::Flagged,
                (false, true) => Retry::Failed,
                (false, false) => Retry::Cases(cases),
            };
            let again = library.retry(&id, which).await?;
            done(library, &format!("{id}: {again} cases are tried again")).await
        }
        Action::Priority { named, to } => {
            let (library, id) = named.open().await?;
            library.set_priority(&id, to).await?;
            done(library, &format!("{id} has priority {to}")).await
        }
        Action::Pardon { worker, which } => {
            let library = Library::open(&which.library).await.map_err(Stop::from_library)?;
            library.pardon_worker(&worker).await.map_err(Stop::from_library)?;
            done(library, &format!("{worker} gets cases again")).await
        }
    }
}

async fn add(
    file: PathBuf,
    cases: Option<u32>,
    priority: Option<i32>,
    which: &Which,
) -> Result<(), Stop> {
    let campaign = Campaign::read(&file, cases).or_input()?;
    let library = Library::open_or_create(&which.library).await.map_err(Stop::from_library)?;
    farm::prepare(&library, &campaign).await?;
    let id = campaign.id();
    if let Some(priority) = priority {
        library.set_priority(&id, priority).await?;
    }
    let status = library.status(&id).await?;
    let (cases, left) = (status.total(), status.total() - status.done());
    done(library, &format!("{id}: {cases} cases, {left} of them to be simulated")).await
}

impl Named {
    async fn open(self) -> Result<(Library, String), Stop> {
        let library = Library::open(&self.which.library).await.map_err(Stop::from_library)?;
        let named = self.campaign.as_deref();
        let all = library.campaigns().await?;
        let mut same = all.iter().filter(|it| Some(it.name.as_str()) == named);
        if let (Some(only), None) = (same.next(), same.next()) {
            return Ok((library, only.id.clone()));
        }
        let record = super::library::choose(&library, named).await?;
        Ok((library, record.id))
    }
}

async fn done(library: Library, line: &str) -> Result<(), Stop> {
    library.close().await;
    say(line);
    Ok(())
}
