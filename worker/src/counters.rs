//! Counters of a worker for Prometheus.

use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;
use std::sync::atomic::AtomicU64;

/// Counts of a worker since its start.
#[derive(Debug, Default)]
pub struct Counters {
    /// Cases with a result.
    pub(crate) finished: Counter,
    /// Cases that could not be simulated.
    pub(crate) failed: Counter,
    /// Computing time of all cases in s.
    pub(crate) computing_s: Counter<f64, AtomicU64>,
    /// Cases held under a lease.
    pub(crate) held: Gauge,
    /// Cases whose results wait for a coordinator.
    pub(crate) unsent: Gauge,
    /// Leases that expired and went to other workers.
    pub(crate) lost: Counter,
    /// Calls with a response of a coordinator.
    pub(crate) answered_calls: Counter,
    /// Calls without a response.
    pub(crate) silent_calls: Counter,
}

impl Counters {
    /// The counts in Prometheus' text format.
    pub fn text(&self) -> String {
        let mut registry = Registry::with_prefix("tracktwin_worker");
        let all = &mut registry;
        all.register("cases_finished", "Cases with a result", self.finished.clone());
        all.register("cases_failed", "Cases that could not be simulated", self.failed.clone());
        all.register("computing_seconds", "Computing time of cases", self.computing_s.clone());
        all.register("cases_held", "Cases held under a lease", self.held.clone());
        all.register("cases_unsent", "Cases whose results are not sent yet", self.unsent.clone());
        all.register("leases_lost", "Leases lost to other workers", self.lost.clone());
        all.register("calls_answered", "Calls with a response", self.answered_calls.clone());
        all.register("calls_unanswered", "Calls without a response", self.silent_calls.clone());
        let mut text = String::new();
        encode(&mut text, &registry).expect("a string takes everything that is written to it");
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_told_in_prometheus_text() {
        let counters = Counters::default();
        counters.finished.inc_by(3);
        counters.computing_s.inc_by(1.5);
        let text = counters.text();
        assert!(text.contains("tracktwin_worker_cases_finished_total 3"), "{text}");
        assert!(text.contains("tracktwin_worker_computing_seconds_total 1.5"), "{text}");
    }
}
