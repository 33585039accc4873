//! A case is worked on by one node at a time, for as long as the node lives.

use super::{Trial, TrialError};
use std::time::Duration;
use tokio::task::JoinHandle;
use tracktwin_farm::dispatch::Timing;

/// A node that is silent for so long has lost its case to the next that asks.
const LEASE: Duration = Duration::from_mins(1);

/// Renews a lease until it is dropped.
pub(super) struct Renewal(JoinHandle<()>);

impl Drop for Renewal {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Trial {
    /// Leases the first of these cases that nobody works on.
    pub(super) async fn lease(&self, of: Vec<u32>) -> Result<Option<u32>, TrialError> {
        Ok(self.library.lease_trial_case(&self.id(), &self.node, of, lease_ms()).await?)
    }

    /// Keeps a case's lease.
    pub(super) fn renewal(&self, number: u32) -> Renewal {
        let (library, trial, node) = (self.library.clone(), self.id(), self.node.clone());
        Renewal(tokio::spawn(async move {
            loop {
                tokio::time::sleep(Timing::of_lease(LEASE).heartbeat).await;
                // Should it fail for long, another node does the case too, and one answer is kept.
                if let Err(error) =
                    library.renew_trial_case(&trial, &node, number, lease_ms()).await
                {
                    tracing::warn!("cannot renew the lease of case {number}: {error}");
                }
            }
        }))
    }

    /// Lets go of a case.
    pub(super) async fn release(&self, number: u32) -> Result<(), TrialError> {
        Ok(self.library.release_trial_case(&self.id(), &self.node, number).await?)
    }
}

fn lease_ms() -> i64 {
    i64::try_from(LEASE.as_millis()).expect("a minute is short")
}
