//! The cases a worker holds.

use crate::counters::Counters;
use parking_lot::Mutex;
use prometheus_client::metrics::gauge::Gauge;
use std::collections::BTreeSet;
use std::sync::Arc;
use tracktwin_protocol::{CASES_MAX, CaseLease, farm};

/// A case this worker holds: campaign, index, epoch.
type Held = (String, u32, u32);

/// Cases that a worker holds: leased, not yet reported or returned. Clones share the state: a
/// coordinator in the same process reads through one what its worker holds.
#[derive(Clone, Debug)]
pub struct Holdings {
    held: Arc<Mutex<BTreeSet<Held>>>,
    count: Gauge,
}

impl Holdings {
    pub(crate) fn new(counters: &Counters) -> Self {
        Self { held: Arc::default(), count: counters.held.clone() }
    }

    /// The cases of a campaign that the worker holds, as (index, epoch).
    pub fn of(&self, campaign: &str) -> Vec<(u32, u32)> {
        let held = self.held.lock();
        let of_campaign = held.iter().filter(|(of, ..)| of == campaign);
        of_campaign.map(|&(_, index, epoch)| (index, epoch)).collect()
    }

    /// Adds leased cases.
    pub(crate) fn take(&self, lease: &CaseLease) {
        let cases = lease.cases.iter();
        let held = cases.map(|leased| (lease.campaign.clone(), leased.case.index, leased.epoch));
        self.change(|all| all.extend(held));
    }

    /// Removes cases; returns how many of them were held.
    pub(crate) fn let_go(
        &self,
        campaign: &str,
        cases: impl IntoIterator<Item = (u32, u32)>,
    ) -> usize {
        self.change(|all| {
            let held =
                |(index, epoch): &(u32, u32)| all.remove(&(campaign.to_owned(), *index, *epoch));
            cases.into_iter().filter(held).count()
        })
    }

    /// Whether the worker still holds a case.
    pub(crate) fn has(&self, campaign: &str, index: u32, epoch: u32) -> bool {
        self.held.lock().contains(&(campaign.to_owned(), index, epoch))
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.held.lock().is_empty()
    }

    /// Requests to renew all leases, each with one campaign and a bounded number of cases.
    pub(crate) fn renewals(&self, worker: &str) -> Vec<farm::RenewRequest> {
        let mut requests: Vec<farm::RenewRequest> = Vec::new();
        for (campaign, index, epoch) in self.held.lock().iter() {
            let case = farm::HeldCase { sobol_index: *index, epoch: *epoch };
            match requests.last_mut() {
                Some(request)
                    if request.campaign_id == *campaign && request.cases.len() < CASES_MAX =>
                {
                    request.cases.push(case);
                }
                _ => requests.push(farm::RenewRequest {
                    worker: worker.to_owned(),
                    campaign_id: campaign.clone(),
                    cases: vec![case],
                }),
            }
        }
        requests
    }

    fn change<T>(&self, change: impl FnOnce(&mut BTreeSet<Held>) -> T) -> T {
        let mut held = self.held.lock();
        let changed = change(&mut held);
        self.count.set(i64::try_from(held.len()).unwrap_or(i64::MAX));
        changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::{Case, ParameterSet};
    use tracktwin_protocol::LeasedCase;

    fn lease(campaign: &str, indices: std::ops::Range<u32>) -> CaseLease {
        let case = |index| Case { index, parameters: ParameterSet::nominal(), surface_seed: 0 };
        CaseLease {
            campaign: campaign.to_owned(),
            experiment_json: String::new(),
            experiment_hash: String::new(),
            cases: indices.map(|index| LeasedCase { case: case(index), epoch: 1 }).collect(),
            traceparent: String::new(),
        }
    }

    #[test]
    fn renewals_are_of_one_campaign_and_no_larger_than_a_message_may_be() {
        let holdings = Holdings::new(&Counters::default());
        let many = CASES_MAX as u32 + 1;
        holdings.take(&lease("a", 0..many));
        holdings.take(&lease("b", 0..3));
        assert_eq!(holdings.let_go("b", [(1, 1), (2, 7)]), 1, "one of them was held");
        let renewals = holdings.renewals("w");
        let sizes: Vec<_> =
            renewals.iter().map(|it| (it.campaign_id.as_str(), it.cases.len())).collect();
        assert_eq!(sizes, [("a", CASES_MAX), ("a", 1), ("b", 2)]);
        assert!(holdings.has("b", 2, 1) && !holdings.has("b", 1, 1));
        assert_eq!(holdings.clone().of("b"), [(0, 1), (2, 1)]);
    }
}
