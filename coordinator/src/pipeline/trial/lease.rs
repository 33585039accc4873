//! Leases of a trial's cases: one machine at a time processes a case.

use super::{Trial, TrialError};
use std::time::Duration;
use tokio::task::JoinHandle;
use tracktwin_farm::dispatch::Timing;

/// Duration of a lease without renewal; then another machine can lease the case.
const LEASE: Duration = Duration::from_mins(1);

/// Renews a lease until it is dropped.
pub(super) struct Renewal(JoinHandle<()>);

impl Drop for Renewal {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Trial {
    /// Leases the first of these cases that no other machine holds.
    pub(super) async fn lease(&self, of: Vec<u32>) -> Result<Option<u32>, TrialError> {
        Ok(self.library.lease_trial_case(&self.id(), &self.node, of, lease_ms()).await?)
    }

    /// Renews a case's lease regularly, until the returned value is dropped.
    pub(super) fn renewal(&self, number: u32) -> Renewal {
        let (library, trial, node) = (self.library.clone(), self.id(), self.node.clone());
        Renewal(tokio::spawn(async move {
            loop {
                tokio::time::sleep(Timing::of_lease(LEASE).heartbeat).await;
                // If this fails for long, another machine processes the case as well, and one
                // answer is kept.
                if let Err(error) =
                    library.renew_trial_case(&trial, &node, number, lease_ms()).await
                {
                    tracing::warn!("cannot renew the lease of case {number}: {error}");
                }
            }
        }))
    }

    /// Releases a case.
    pub(super) async fn release(&self, number: u32) -> Result<(), TrialError> {
        Ok(self.library.release_trial_case(&self.id(), &self.node, number).await?)
    }
}

fn lease_ms() -> i64 {
    i64::try_from(LEASE.as_millis()).expect("a minute is short")
}
