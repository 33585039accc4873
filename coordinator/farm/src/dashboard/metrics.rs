//! State of the farm as Prometheus metrics.

use super::status::Farm;
use crate::dispatch::Counts;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;

type Labels = Vec<(&'static str, String)>;

/// Returns the gauges of the farm and the counts of this coordinator, in the text format of Prometheus.
pub(crate) fn text(farm: &Farm, counts: &Counts) -> String {
    let mut registry = Registry::with_prefix("tracktwin");
    counts.register(&mut registry);

    let cases = Family::<Labels, Gauge>::default();
    for campaign in &farm.campaigns {
        let states = [
            ("waiting", campaign.waiting),
            ("leased", campaign.leased),
            ("finished", campaign.finished),
            ("failed", campaign.failed),
        ];
        for (state, count) in states {
            let labels = vec![("campaign", campaign.id.clone()), ("state", state.to_owned())];
            cases.get_or_create(&labels).set(count.into());
        }
    }
    registry.register("campaign_cases", "Cases of a campaign by state", cases);

    // Paused and cancelled campaigns need no workers.
    let running = farm.campaigns.iter().filter(|campaign| campaign.state == "running");
    let depth: u64 = running.map(|it| u64::from(it.waiting) + u64::from(it.leased)).sum();
    let queue = Gauge::<i64>::default();
    queue.set(i64::try_from(depth).unwrap_or(i64::MAX));
    registry.register("queue_depth", "Cases left in running campaigns, for autoscaling", queue);

    let present = farm.workers.iter().filter(|worker| worker.is_present());
    let (workers, cores) =
        present.fold((0, 0), |(count, cores), worker| (count + 1, cores + i64::from(worker.cores)));
    let gauge = |value: i64| {
        let gauge = Gauge::<i64>::default();
        gauge.set(value);
        gauge
    };
    registry.register("workers", "Workers with a message in the last minute", gauge(workers));
    registry.register("worker_cores", "Cores of these workers", gauge(cores));

    let mut text = String::new();
    encode(&mut text, &registry).expect("a string takes everything that is written to it");
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dashboard::status::{FarmCampaign, FarmWorker};

    #[test]
    fn the_queue_is_what_running_campaigns_lack() {
        let campaign = |state: &str| FarmCampaign {
            id: format!("{state}-1"),
            state: state.to_owned(),
            waiting: 5,
            leased: 2,
            finished: 3,
            ..FarmCampaign::default()
        };
        let worker = FarmWorker { cores: 8, silent_s: 3.0, ..FarmWorker::default() };
        let gone = FarmWorker { cores: 8, silent_s: 300.0, ..FarmWorker::default() };
        let farm = Farm {
            campaigns: vec![campaign("running"), campaign("paused")],
            workers: vec![worker, gone],
            ..Farm::default()
        };
        let text = text(&farm, &Counts::default());
        for line in [
            "tracktwin_queue_depth 7",
            "tracktwin_worker_cores 8",
            "tracktwin_campaign_cases{campaign=\"paused-1\",state=\"finished\"} 3",
        ] {
            assert!(text.contains(line), "{line} is not in\n{text}");
        }
    }
}
