//! Finished results on their way to a coordinator.
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

/// Where cores put what they have finished.
pub(crate) type Outbox = mpsc::Sender<Finished>;

/// An empty outbox, and what is to be [`send`]ed.
pub(crate) fn outbox() -> (Outbox, mpsc::Receiver<Finished>) {
    mpsc::channel(GROUPS_WAITING)
}

/// Hands in what is put into the outbox, until every core has let go of it or the worker gives up.
///
/// What waits together is sent together.
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
