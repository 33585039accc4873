//! The gRPC server on a port.

use crate::dispatch::Dispatch;
use crate::security::{Guard, Security, SecurityError, accept};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tonic::transport::Server;
use tracktwin_protocol::farm::farm_server::FarmServer;
use tracktwin_protocol::{MESSAGE_BYTES_MAX, WINDOW_BYTES};

/// How often an idle connection is tested, and how long an answer may take.
const KEEP_ALIVE: Duration = Duration::from_secs(5);

/// Calls of one connection at a time: a worker has a few a core.
const CALLS_A_CONNECTION: u32 = 512;

/// Most bytes of a message in one piece: HTTP/2's own 16 kB make a hundred of a report.
const FRAME_BYTES: u32 = 1 << 20;

/// Time limit of running calls after the service is stopped.
const FAREWELL: Duration = Duration::from_secs(5);

/// Errors that end a service.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Its certificates or token are invalid.
    #[error(transparent)]
    Security(#[from] SecurityError),
    /// The port was lost.
    #[error("the farm's service failed")]
    Transport(#[from] tonic::transport::Error),
}

/// Serves workers on a port until it is stopped; running calls are finished first.
///
/// # Errors
/// [`ServeError`] when certificates can't be used or the port fails.
pub async fn serve(
    listener: TcpListener,
    dispatch: Dispatch,
    security: &Security,
    stop: CancellationToken,
) -> Result<(), ServeError> {
    let incoming = accept(listener, security.acceptor()?);
    let guard = Guard::new(security.token.as_deref());
    let service = FarmServer::new(dispatch).max_decoding_message_size(MESSAGE_BYTES_MAX);
    let guarded = tonic::service::interceptor::InterceptedService::new(service, guard);
    let served = Server::builder()
        .http2_keepalive_interval(Some(KEEP_ALIVE))
        .http2_keepalive_timeout(Some(KEEP_ALIVE))
        .initial_stream_window_size(WINDOW_BYTES)
        .initial_connection_window_size(WINDOW_BYTES)
        .max_frame_size(FRAME_BYTES)
        .max_concurrent_streams(CALLS_A_CONNECTION)
        .add_service(guarded)
        .serve_with_incoming_shutdown(incoming, stop.clone().cancelled_owned());
    let farewell = async {
        stop.cancelled().await;
        tokio::time::sleep(FAREWELL).await;
    };
    tokio::select! {
        served = served => Ok(served?),
        // Whoever still talks is cut off, and will ask again.
        () = farewell => Ok(()),
    }
}
