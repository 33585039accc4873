//! The gRPC server on a port.

use crate::dispatch::Dispatch;
use crate::security::{Guard, Security, SecurityError, accept};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tonic::transport::Server;
use tracktwin_protocol::farm::farm_server::FarmServer;
use tracktwin_protocol::{MESSAGE_BYTES_MAX, WINDOW_BYTES};

/// Interval of testing an idle connection, and time limit of the response.
const KEEP_ALIVE: Duration = Duration::from_secs(5);

/// Maximum number of concurrent calls per connection. A worker makes a few calls per core.
const CALLS_A_CONNECTION: u32 = 512;

/// Maximum size of an HTTP/2 frame, in bytes. With the default of 16 kB, a report would need about a
/// hundred frames.
const FRAME_BYTES: u32 = 1 << 20;

/// Time limit for running calls after the service is stopped.
const FAREWELL: Duration = Duration::from_secs(5);

/// Errors that end a service.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The certificates or the token are invalid.
    #[error(transparent)]
    Security(#[from] SecurityError),
    /// The server failed on its port.
    #[error("the farm's service failed")]
    Transport(#[from] tonic::transport::Error),
}

/// Serves workers on a port until `stop` is cancelled. Running calls are completed first, within a time
/// limit.
///
/// # Errors
/// Returns [`ServeError`] if the certificates cannot be used or the port fails.
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
