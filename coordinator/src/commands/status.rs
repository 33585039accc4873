//! `tracktwin status`: progress of a farm, once or continuously.

use super::library_url::LibraryUrl;
use super::{Stop, println_stderr, write_stdout};
use crate::commands::contact::contact_sentence;
use clap::Args;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::IsTerminal;
use std::time::Duration;
use tracktwin_farm::dashboard::{Detail, Farm, FarmCampaign, FarmWorker, duration, farm};
use tracktwin_library::{ContactLoss, Library};

/// Characters of a progress bar.
const BAR: usize = 30;

/// Number of failure causes shown per campaign.
const CAUSES: usize = 3;

/// Number of workers shown; the others are counted.
const WORKERS: usize = 20;

/// Clears the screen and puts the cursor into its corner (ECMA-48).
const CLEAR: &str = "\x1b[2J\x1b[H";

/// Arguments of `status`.
#[derive(Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    library: LibraryUrl,
    /// Repeat until Ctrl-C, also while the library is away.
    #[arg(long, conflicts_with = "json")]
    watch: bool,
    /// Interval of `--watch`.
    #[arg(long, value_name = "SECONDS", default_value_t = 2, requires = "watch",
          value_parser = clap::value_parser!(u64).range(1..=86_400))]
    every: u64,
    /// Print JSON; not with `--watch`.
    #[arg(long)]
    json: bool,
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let library = arguments.library.open_to_read().await?;
    let pause = Duration::from_secs(arguments.every);
    while show(&library, &arguments).await? && arguments.watch {
        tokio::time::sleep(pause).await;
    }
    library.close().await;
    Ok(())
}

/// Prints the present state. Returns whether somebody reads it. With `--watch`, a temporary error of the library is
/// printed instead, because the next state may be readable.
async fn show(library: &Library, arguments: &Arguments) -> Result<bool, Stop> {
    let farm = match farm(library, Detail::Counts).await {
        Err(error) if arguments.watch && error.is_temporary() => {
            println_stderr(&format!("{error}; trying again"));
            return Ok(true);
        }
        read => read?,
    };
    let text = if arguments.json {
        format!("{:#}\n", as_json(&farm))
    } else if arguments.watch && std::io::stdout().is_terminal() {
        format!("{CLEAR}{}\n", text(&farm))
    } else {
        format!("{}\n", text(&farm))
    };
    Ok(write_stdout(text.as_bytes()))
}

fn text(farm: &Farm) -> String {
    let mut text = format!("{}   {}\n", farm.library, farm.at);
    if farm.campaigns.is_empty() {
        text += "\nno campaign yet; add one with `tracktwin campaign add FILE`\n";
    }
    for campaign in &farm.campaigns {
        campaign_text(&mut text, campaign);
    }
    if !farm.workers.is_empty() {
        workers_text(&mut text, &farm.workers);
    }
    text.truncate(text.trim_end().len());
    text
}

fn campaign_text(text: &mut String, campaign: &FarmCampaign) {
    let FarmCampaign { id, waiting, leased, finished, failed, .. } = campaign;
    let cases = campaign.cases();
    let share = f64::from(*finished) / f64::from(cases.max(1));
    let full = (share * BAR as f64) as usize;
    let bar = format!("{}{}", "█".repeat(full), "░".repeat(BAR - full));
    let rate = format!("{:.1} cases/s  ", campaign.per_second);
    let rate = if campaign.is_at_work() { rate } else { String::new() };
    let priority = match campaign.priority {
        0 => String::new(),
        priority => format!(", priority {priority}"),
    };
    let _ = write!(
        text,
        "\n{id}  ({}{priority})\n{bar} {:5.1} %  {rate}{}\n\
         {cases} cases: {finished} finished, {leased} in work, {waiting} waiting, {failed} given up\n",
        campaign.state_text(),
        100.0 * share,
        campaign.left(),
    );
    if campaign.contact_lost > 0 {
        let lost = ContactLoss {
            cases: campaign.contact_lost,
            largest_share: campaign.contact_loss_share_max,
        };
        let _ = writeln!(text, "{}", contact_sentence(lost, *finished));
    }
    for (cause, count) in campaign.causes.iter().take(CAUSES) {
        let _ = writeln!(text, "  {count} given up: {cause}");
    }
    if campaign.causes.len() > CAUSES {
        let others = campaign.causes[CAUSES..].iter().map(|(_, count)| count).sum::<u32>();
        let _ = writeln!(text, "  {others} given up for other reasons");
    }
}

fn workers_text(text: &mut String, workers: &[FarmWorker]) {
    let present = workers.iter().filter(|worker| worker.is_present()).count();
    let heard_of = workers.len();
    let _ = writeln!(text, "\nworkers: {present} in the last minute, {heard_of} in the last hour");
    let width = workers.iter().map(|it| it.id.len()).max().unwrap_or(0).max("worker".len());
    let _ = writeln!(text, "{:width$}  cores  finished  failed  s a case  heard of", "worker");
    for worker in workers.iter().take(WORKERS) {
        let case_s = worker.case_s.map_or_else(String::new, |case_s| format!("{case_s:.3}"));
        let _ = writeln!(
            text,
            "{:width$}  {:5}  {:8}  {:6}  {case_s:>8}  {} ago  {}",
            worker.id,
            worker.cores,
            worker.finished,
            worker.failed,
            duration(worker.silent_s),
            worker.aside.as_deref().unwrap_or_default(),
        );
    }
    if workers.len() > WORKERS {
        let _ = writeln!(text, "and {} more", workers.len() - WORKERS);
    }
}

fn as_json(farm: &Farm) -> Value {
    let campaign = |it: &FarmCampaign| {
        let causes = it.causes.iter().map(|(error, cases)| json!({"error": error, "cases": cases}));
        json!({
            "campaign": it.id, "state": it.state, "done": it.is_done(), "priority": it.priority, "cases": it.cases(),
            "finished": it.finished, "leased": it.leased, "waiting": it.waiting,
            "failed": it.failed, "contact_lost": it.contact_lost,
            "contact_loss_share_max": it.contact_loss_share_max, "cases_per_s": it.per_second, "remaining_s": it.eta_s(),
            "causes": causes.collect::<Vec<_>>(),
        })
    };
    let worker = |it: &FarmWorker| {
        json!({
            "worker": it.id, "code_version": it.code_version, "cores": it.cores,
            "finished": it.finished, "failed": it.failed, "case_s": it.case_s,
            "silent_s": it.silent_s, "aside": it.aside,
        })
    };
    json!({
        "library": farm.library, "at": farm.at,
        "campaigns": farm.campaigns.iter().map(campaign).collect::<Vec<_>>(),
        "workers": farm.workers.iter().map(worker).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_tells_progress_causes_and_workers() {
        let campaign = FarmCampaign {
            id: "v-track-1".to_owned(),
            state: "running".to_owned(),
            waiting: 50,
            finished: 49,
            failed: 1,
            per_second: 10.0,
            causes: vec![("the sleeper floats".to_owned(), 1)],
            contact_lost: 3,
            contact_loss_share_max: 0.02,
            ..FarmCampaign::default()
        };
        let worker = FarmWorker { id: "node-1".to_owned(), cores: 8, ..FarmWorker::default() };
        let farm = Farm { campaigns: vec![campaign], workers: vec![worker; 25], ..Farm::default() };
        let text = text(&farm);
        for part in [
            "49.0 %",
            "10.0 cases/s",
            "5 s left",
            "1 given up: the sleeper floats",
            "3 of 49 cases lost contact between wheel and rail (at most 2.0 % of the time)",
            "workers: 25 in the last minute, 25 in the last hour",
            "and 5 more",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }
}
