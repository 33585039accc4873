//! Queue of finished results for a coordinator.
//!
//! The simulation continues during a report, and while no coordinator responds: finished cases wait
//! here and are sent later. The capacity is bounded; when it is full, the cores wait.

use crate::error::AgentError;
use crate::finished::Finished;
use crate::session::Session;
use std::sync::Arc;
use tokio::sync::mpsc;

/// Groups that may wait: some 500 cases, or a few megabytes.
const GROUPS_WAITING: usize = 64;

/// Queue into which the cores put finished results.
pub(crate) type Outbox = mpsc::Sender<Finished>;

/// An empty outbox, and its receiver for [`send`].
pub(crate) fn outbox() -> (Outbox, mpsc::Receiver<Finished>) {
    mpsc::channel(GROUPS_WAITING)
}

/// Reports the results in the outbox until every core has dropped its sender, or the worker gives up.
///
/// Results that wait at the same time are sent in one report.
pub(crate) async fn send(
    session: Arc<Session>,
    mut outbox: mpsc::Receiver<Finished>,
) -> Result<(), AgentError> {
    let mut next = None;
    loop {
        let first = match next.take() {
            Some(finished) => Some(finished),
            None => outbox.recv().await,
        };
        let Some(mut together) = first else { return Ok(()) };
        while let Ok(finished) = outbox.try_recv() {
            if let Some(other) = together.join(finished) {
                next = Some(other);
                break;
            }
        }
        session.report(together).await?;
    }
}
