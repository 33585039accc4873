//! Counters of a coordinator for Prometheus.

use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::Registry;

/// Event counts and times of a coordinator since its start.
#[derive(Clone, Debug)]
pub struct Counts {
    pub(crate) leased: Counter,
    pub(crate) stored: Counter,
    pub(crate) duplicates: Counter,
    pub(crate) late: Counter,
    pub(crate) refused: Counter,
    pub(crate) registered: Counter,
    pub(crate) incompatible: Counter,
    pub(crate) malformed: Counter,
    pub(crate) suspended: Counter,
    pub(crate) audited: Counter,
    pub(crate) differed: Counter,
    pub(crate) lease_s: Histogram,
    pub(crate) report_s: Histogram,
}

impl Default for Counts {
    fn default() -> Self {
        // From half a millisecond, a commit, to sixteen seconds, when workers ask again.
        let times = || Histogram::new(exponential_buckets(0.0005, 2.0, 16));
        Self {
            leased: Counter::default(),
            stored: Counter::default(),
            duplicates: Counter::default(),
            late: Counter::default(),
            refused: Counter::default(),
            registered: Counter::default(),
            incompatible: Counter::default(),
            malformed: Counter::default(),
            suspended: Counter::default(),
            audited: Counter::default(),
            differed: Counter::default(),
            lease_s: times(),
            report_s: times(),
        }
    }
}

impl Counts {
    /// Registers the counts with a Prometheus registry.
    pub fn register(&self, to: &mut Registry) {
        to.register("cases_leased", "Cases leased to workers", self.leased.clone());
        to.register("reports_stored", "Reports of cases stored", self.stored.clone());
        to.register(
            "reports_duplicate",
            "Results that were already stored",
            self.duplicates.clone(),
        );
        to.register("reports_late", "Failures of ended leases", self.late.clone());
        to.register("reports_refused", "Reports of unknown cases", self.refused.clone());
        to.register("workers_registered", "Registrations", self.registered.clone());
        to.register("workers_refused", "Registrations refused", self.incompatible.clone());
        to.register("messages_malformed", "Malformed messages refused", self.malformed.clone());
        to.register("workers_suspended", "Suspensions of failing workers", self.suspended.clone());
        to.register("cases_audited", "Cases simulated a second time", self.audited.clone());
        to.register("cases_differed", "Audited cases that differed", self.differed.clone());
        to.register("lease_seconds", "Time to respond to a lease request", self.lease_s.clone());
        to.register("report_seconds", "Time to respond to a report", self.report_s.clone());
    }
}
