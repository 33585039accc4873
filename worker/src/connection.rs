//! The line to the coordinator.

use std::time::Duration;
use tonic::transport::{Channel, Endpoint};
use tracktwin_protocol::farm::farm_client::FarmClient;
use tracktwin_protocol::{MESSAGE_BYTES_MAX, WINDOW_BYTES};

/// A connection that does not come about within this is tried anew.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// An answer that takes longer is not waited for: a commit takes milliseconds, and a coordinator
/// that is busy beyond this had better be asked again later.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(20);

/// How often an idle line is tested, so that one whose other end has gone is noticed.
const KEEP_ALIVE: Duration = Duration::from_secs(5);

/// A connection to the coordinator, made when it is first used and again whenever it breaks.
pub(crate) fn connect(coordinator: &str) -> Result<FarmClient<Channel>, tonic::transport::Error> {
    let channel = Endpoint::from_shared(coordinator.to_owned())?
        .tcp_nodelay(true)
        .connect_timeout(CONNECT_TIMEOUT)
        .timeout(ANSWER_TIMEOUT)
        .http2_keep_alive_interval(KEEP_ALIVE)
        .keep_alive_timeout(KEEP_ALIVE)
        .keep_alive_while_idle(true)
        .initial_stream_window_size(WINDOW_BYTES)
        .initial_connection_window_size(WINDOW_BYTES)
        .connect_lazy();
    Ok(FarmClient::new(channel).max_decoding_message_size(MESSAGE_BYTES_MAX))
}
