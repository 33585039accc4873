//! `tracktwin campaign`: adds campaigns to a library and controls them.

use super::library::choose;
use super::library_url::LibraryUrl;
use super::numbers::count;
use super::progress::Progress;
use super::signals::stop_on_signal;
use super::{OrInput, Stop, continuity, print_json, println_stderr, println_stdout};
use anyhow::{Context, anyhow};
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use std::path::PathBuf;
use tokio_util::sync::CancellationToken;
use tracktwin_experiment::MODEL_HASH;
use tracktwin_farm::campaign::Campaign;
use tracktwin_library::{CampaignState, Library, Retry, State};
use tracktwin_parameters::quantity::CASES;

/// The action.
#[derive(Subcommand)]
pub(super) enum Action {
    /// Add a campaign, or add cases to an existing one; coordinators lease them immediately.
    Add {
        /// Campaign file (TOML).
        file: PathBuf,
        /// Number of cases; overrides the number in the campaign file.
        #[arg(long, value_name = "N", value_parser = count::<u32>(CASES))]
        cases: Option<u32>,
        /// Priority of the campaign; cases of the campaign with the highest priority are leased
        /// first [default: 0].
        #[arg(long, value_name = "N", allow_negative_numbers = true)]
        priority: Option<i32>,
        #[command(flatten)]
        library: LibraryUrl,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Pause a campaign: leased cases are finished, no further cases are leased.
    Pause(Named),
    /// Resume a paused or cancelled campaign.
    Resume(Named),
    /// Cancel a campaign: leases end, no further cases are leased; stored results are kept.
    Cancel(Named),
    /// Set the given-up cases to waiting; coordinators or `tracktwin run` simulate them again.
    Retry {
        #[command(flatten)]
        named: Named,
        /// Retry only the case with this Sobol index, as shown by `tracktwin library status`; may
        /// be repeated.
        #[arg(long = "case", value_name = "INDEX", conflicts_with = "flagged")]
        cases: Vec<u32>,
        /// Retry instead the cases whose results an audit flagged; their results are deleted.
        #[arg(long)]
        flagged: bool,
        /// Retry instead the cases whose results do not match their checksum; their results are
        /// deleted. Cases whose parameters were altered get those of the campaign's definition.
        #[arg(long, conflicts_with_all = ["cases", "flagged"])]
        altered: bool,
        /// Retry instead the cases whose results another version of the physics computed; their
        /// results are deleted.
        #[arg(long, conflicts_with_all = ["cases", "flagged", "altered"])]
        other_model: bool,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Set the priority of a campaign.
    Priority {
        #[command(flatten)]
        named: Named,
        /// The priority; the campaign with the highest one is served first.
        #[arg(long, value_name = "N", allow_negative_numbers = true, required = true)]
        to: i32,
    },
    /// Release a worker from quarantine.
    Pardon {
        /// Name of the worker as shown by `tracktwin status`.
        worker: String,
        #[command(flatten)]
        library: LibraryUrl,
    },
}

/// Selects a campaign.
#[derive(Args)]
pub(super) struct Named {
    /// Id of the campaign as shown by `tracktwin status`, or its name if the name is unique;
    /// optional if the library holds one campaign.
    campaign: Option<String>,
    #[command(flatten)]
    library: LibraryUrl,
}

pub(super) async fn run(action: Action) -> Result<(), Stop> {
    match action {
        Action::Add { file, cases, priority, library, json } => {
            add(file, cases, priority, &library, json).await
        }
        Action::Pause(named) => {
            let (library, id) = named.open().await?;
            library.pause(&id).await?;
            done(library, &format!("{id} is paused; leased cases are finished")).await
        }
        Action::Resume(named) => {
            let (library, id) = named.open().await?;
            library.resume(&id).await?;
            done(library, &format!("{id} is running")).await
        }
        Action::Cancel(named) => {
            let (library, id) = named.open().await?;
            library.cancel(&id).await?;
            done(library, &format!("{id} is cancelled; its results are kept")).await
        }
        Action::Retry { named, cases, flagged, altered, other_model, json } => {
            let (library, id) = named.open().await?;
            let which = match (flagged, altered, other_model) {
                (true, ..) => Retry::Flagged,
                (_, true, _) => Retry::Altered,
                (.., true) => Retry::OtherModel(MODEL_HASH.to_owned()),
                _ if cases.is_empty() => Retry::Failed,
                _ => Retry::Cases(cases),
            };
            if let Retry::Cases(indices) = &which {
                refuse_others(&library, &id, indices).await?;
            }
            retry(library, &id, which, json).await
        }
        Action::Priority { named, to } => {
            let (library, id) = named.open().await?;
            library.set_priority(&id, to).await?;
            done(library, &format!("{id} has priority {to}")).await
        }
        Action::Pardon { worker, library } => {
            let library = library.open().await?;
            library.pardon_worker(&worker).await?;
            done(library, &format!("{worker} is released from quarantine")).await
        }
    }
}

async fn add(
    file: PathBuf,
    cases: Option<u32>,
    priority: Option<i32>,
    url: &LibraryUrl,
    json: bool,
) -> Result<(), Stop> {
    let campaign = Campaign::read(&file, cases).or_input()?;
    let library = url.open_or_create().await?;
    let id = campaign.id();
    continuity::check(&library, &campaign, println_stderr).await?;
    continuity::tell_what_training_lacks(&campaign, println_stderr);
    tracktwin_farm::campaign::insert_campaign(&library, &campaign).await?;
    // Before any case can be leased.
    if let Some(priority) = priority {
        library.set_priority(&id, priority).await?;
    }
    let shutdown = stop_on_signal("stopping")?;
    let _nothing_left_to_wind_up = shutdown.clone().drop_guard();
    add_cases(&library, &campaign, &shutdown).await?;
    let status = library.status(&id).await?;
    let (cases, left) = (status.total(), status.total() - status.done());
    let state = library.campaign_state(&id).await?;
    let line = format!("{id}: {cases} cases, {left} of them to be simulated{}", waits(state));
    let counts =
        json!({ "campaign": id, "state": state.name(), "cases": cases, "to_simulate": left });
    counted(library, json, &line, &counts).await
}

/// What the user must do before the cases of a campaign in this state are simulated; empty if it is running.
fn waits(state: CampaignState) -> String {
    match state {
        CampaignState::Running => String::new(),
        state => format!("; it is {}: run `tracktwin campaign resume`", state.name()),
    }
}

/// Sets cases to waiting, and restores altered ones before.
async fn retry(library: Library, id: &str, which: Retry, json: bool) -> Result<(), Stop> {
    let restored = match which {
        Retry::Altered => tracktwin_farm::campaign::restore_cases(&library, id).await?,
        _ => 0,
    };
    let again = library.retry(id, which).await?;
    let state = library.campaign_state(id).await?;
    let parameters = match restored {
        0 => String::new(),
        restored => format!("the parameters of {restored} cases were restored, "),
    };
    let line = format!("{id}: {parameters}{again} cases will be simulated again{}", waits(state));
    let counts = json!({
        "campaign": id, "state": state.name(), "restored": restored, "to_simulate": again,
    });
    counted(library, json, &line, &counts).await
}

/// Adds cases until `shutdown` is cancelled; then the error states the number of added cases. This number and the
/// total are passed to `tell` while there is something to add.
pub(super) async fn add_cases_told(
    library: &Library,
    campaign: &Campaign,
    shutdown: &CancellationToken,
    mut tell: impl FnMut(u32, u32),
) -> Result<(), Stop> {
    let (mut stored, total, mut adds) = (0, campaign.cases, false);
    let added = tracktwin_farm::campaign::add_cases(library, campaign, |now| {
        stored = now;
        adds |= now < total;
        if adds {
            tell(now, total);
        }
        !shutdown.is_cancelled()
    });
    let added = added.await;
    let so_far = || {
        let id = campaign.id();
        format!("{stored} of {total} cases of {id} were added; repeat the command to continue")
    };
    added.with_context(so_far)?;
    if stored < total {
        return Err(anyhow!(so_far()).into());
    }
    Ok(())
}

/// As [`add_cases_told`], with a progress bar.
pub(super) async fn add_cases(
    library: &Library,
    campaign: &Campaign,
    shutdown: &CancellationToken,
) -> Result<(), Stop> {
    let mut progress = None::<Progress>;
    let tell = |now: u32, total: u32| {
        let begin = || Progress::begin("adding cases", now.into(), total.into());
        progress.get_or_insert_with(begin).at(now.into(), "");
    };
    add_cases_told(library, campaign, shutdown, tell).await?;
    progress.into_iter().for_each(Progress::end);
    Ok(())
}

impl Named {
    async fn open(self) -> Result<(Library, String), Stop> {
        let library = self.library.open_whole().await?;
        let campaign = choose(&library, self.campaign.as_deref(), "name one").await?;
        Ok((library, campaign.id))
    }
}

/// Returns an error for a case that was not given up.
async fn refuse_others(library: &Library, id: &str, indices: &[u32]) -> Result<(), Stop> {
    for &index in indices {
        let is = match library.case(id, index).await?.map(|case| case.state) {
            Some(State::Failed) => continue,
            Some(State::Waiting) => "is waiting",
            Some(State::Leased) => "is leased",
            Some(State::Finished) => "is finished",
            None => "does not exist",
        };
        return Err(anyhow!(
            "{id}: case {index} {is}; only cases that were given up can be retried; list them with \
             `tracktwin library status`"
        ))
        .or_input();
    }
    Ok(())
}

async fn done(library: Library, line: &str) -> Result<(), Stop> {
    library.close().await;
    println_stdout(line);
    Ok(())
}

/// Prints the result of an action that counts cases: one line, or JSON.
async fn counted(library: Library, json: bool, line: &str, counts: &Value) -> Result<(), Stop> {
    if !json {
        return done(library, line).await;
    }
    library.close().await;
    print_json(counts);
    Ok(())
}
