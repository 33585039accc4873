//! What ends long work from outside.

use super::println_stderr;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

/// Is cancelled by the first Ctrl-C or SIGTERM, which is answered with `notice`.
///
/// A signal after that, or once the caller has cancelled it because nothing is left to wind up,
/// ends the process as if nobody listened.
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
