//! What ends long work from outside.

use super::note;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

/// Is cancelled by Ctrl-C or SIGTERM, and says so.
pub(super) fn stop_on_signal(notice: &'static str) -> std::io::Result<CancellationToken> {
    let shutdown = CancellationToken::new();
    let (mut interrupt, mut terminate) =
        (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    let stop = shutdown.clone();
    tokio::spawn(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
        note(notice);
        stop.cancel();
    });
    Ok(shutdown)
}
