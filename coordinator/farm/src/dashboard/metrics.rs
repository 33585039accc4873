//! State of the farm as Prometheus metrics.

use super::status::Farm;
use crate::dispatch::Counts;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;
use tracktwin_library::AuditCounts;

/// Gauges by label.
type Gauges = Family<Vec<(&'static str, String)>, Gauge>;

/// Returns the gauges of the farm and the counts of this coordinator, in the text format of Prometheus.
/// `audits` are those of the farm's campaigns, in the same order.
pub(crate) fn text(farm: &Farm, audits: &[AuditCounts], counts: &Counts) -> String {
    let mut registry = Registry::with_prefix("tracktwin");
    counts.register(&mut registry);
    register_campaigns(&mut registry, farm);
    register_cases(&mut registry, farm, audits);
    register_workers(&mut registry, farm);
    let mut text = String::new();
    encode(&mut text, &registry).expect("a string takes everything that is written to it");
    text
}

fn register_campaigns(registry: &mut Registry, farm: &Farm) {
    let campaigns = Gauges::default();
    for state in ["running", "paused", "cancelled"] {
        let count = farm.campaigns.iter().filter(|campaign| campaign.state == state).count();
        set(&campaigns, &[("state", state.to_owned())], count);
    }
    registry.register("campaigns", "Campaigns by state", campaigns);
}

fn register_cases(registry: &mut Registry, farm: &Farm, audits: &[AuditCounts]) {
    let (cases, audited) = (Gauges::default(), Gauges::default());
    let mut depth: u64 = 0;
    for (campaign, audits) in farm.campaigns.iter().zip(audits) {
        let labels = |state: &str| [("campaign", campaign.id.clone()), ("state", state.to_owned())];
        set(&cases, &labels("waiting"), campaign.waiting);
        set(&cases, &labels("leased"), campaign.leased);
        set(&cases, &labels("finished"), campaign.finished);
        set(&cases, &labels("failed"), campaign.failed);
        set(&audited, &labels("open"), audits.open);
        set(&audited, &labels("agrees"), audits.agree);
        set(&audited, &labels("differs"), audits.differ);
        // Paused and cancelled campaigns need no workers.
        if campaign.state == "running" {
            depth +=
                [campaign.waiting, campaign.leased, audits.open].map(u64::from).iter().sum::<u64>();
        }
    }
    registry.register("campaign_cases", "Cases of a campaign by state", cases);
    registry.register("campaign_audits", "Audits of a campaign by state", audited);
    let queue = Gauge::<i64>::default();
    queue.set(i64::try_from(depth).unwrap_or(i64::MAX));
    let help = "Cases and audits left in running campaigns, for autoscaling";
    registry.register("queue_depth", help, queue);
}

fn register_workers(registry: &mut Registry, farm: &Farm) {
    let (workers, cores) = (Gauges::default(), Gauges::default());
    for (state, quarantined) in [("active", false), ("quarantined", true)] {
        let of_state =
            farm.workers.iter().filter(|it| it.is_present() && it.quarantined == quarantined);
        let (count, sum) =
            of_state.fold((0, 0), |(count, sum), it| (count + 1, sum + i64::from(it.cores)));
        set(&workers, &[("state", state.to_owned())], count);
        set(&cores, &[("state", state.to_owned())], sum);
    }
    registry.register("workers", "Workers with a message in the last minute, by state", workers);
    registry.register("worker_cores", "Cores of these workers", cores);
}

/// Sets the gauge with these labels.
fn set(gauges: &Gauges, labels: &[(&'static str, String)], value: impl TryInto<i64>) {
    gauges.get_or_create(&labels.to_vec()).set(value.try_into().unwrap_or(i64::MAX));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dashboard::status::{FarmCampaign, FarmWorker};

    #[test]
    fn the_queue_is_what_running_campaigns_lack_and_every_state_has_a_series() {
        let campaign = |state: &str| FarmCampaign {
            id: format!("{state}-1"),
            state: state.to_owned(),
            waiting: 5,
            leased: 2,
            finished: 3,
            ..FarmCampaign::default()
        };
        let worker = FarmWorker { cores: 8, silent_s: 3.0, ..FarmWorker::default() };
        let gone = FarmWorker { silent_s: 300.0, ..worker.clone() };
        let wrong = FarmWorker { quarantined: true, cores: 4, ..worker.clone() };
        let farm = Farm {
            campaigns: vec![campaign("running"), campaign("paused")],
            workers: vec![worker, gone, wrong],
            ..Farm::default()
        };
        let audits = AuditCounts { open: 4, agree: 1, differ: 0 };
        let text = text(&farm, &[audits, audits], &Counts::default());
        for line in [
            "tracktwin_queue_depth 11",
            "tracktwin_workers{state=\"active\"} 1",
            "tracktwin_workers{state=\"quarantined\"} 1",
            "tracktwin_worker_cores{state=\"active\"} 8",
            "tracktwin_workers_suspended_total 0",
            "tracktwin_workers_refused_total 0",
            "tracktwin_campaigns{state=\"cancelled\"} 0",
            "tracktwin_campaign_audits{campaign=\"running-1\",state=\"open\"} 4",
            "tracktwin_campaign_cases{campaign=\"paused-1\",state=\"finished\"} 3",
        ] {
            assert!(text.contains(line), "{line} is not in\n{text}");
        }
    }
}
