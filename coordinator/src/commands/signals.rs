//! Signals that stop long work.

use super::println_stderr;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

/// Returns a token that the first Ctrl-C or SIGTERM cancels; the signal also prints `notice`.
///
/// A second signal, or a signal after the caller has cancelled the token, ends the process at once.
pub(super) fn stop_on_signal(notice: &'static str) -> std::io::Result<CancellationToken> {
    let shutdown = CancellationToken::new();
    let (mut interrupt, mut terminate) =
        (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    let stop = shutdown.clone();
    tokio::spawn(async move {
        loop {
            let kind = tokio::select! {
                _ = interrupt.recv() => SignalKind::interrupt(),
                _ = terminate.recv() => SignalKind::terminate(),
            };
            if stop.is_cancelled() {
                std::process::exit(128 + kind.as_raw_value());
            }
            println_stderr(notice);
            stop.cancel();
        }
    });
    Ok(shutdown)
}
