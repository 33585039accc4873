//! The line to one coordinator.

use crate::config::Dial;
use crate::credentials::{Bearer, Credentials};
use crate::error::AgentError;
use std::time::Duration;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use tracktwin_protocol::farm::farm_client::FarmClient;
use tracktwin_protocol::{MESSAGE_BYTES_MAX, WINDOW_BYTES};

/// Time limit of connecting; then it is tried again.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// An answer that takes longer is not waited for: a commit takes milliseconds, and a coordinator
/// that is busy beyond this had better be asked again later.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(20);

/// How often an idle line is tested, so that one whose other end has gone is noticed.
const KEEP_ALIVE: Duration = Duration::from_secs(5);

/// How calls are made.
pub(crate) type Client = FarmClient<InterceptedService<Channel, Bearer>>;

/// A connection to a coordinator, made when it is first used and again whenever it breaks.
pub(crate) fn connect(
    url: &str,
    credentials: &Credentials,
    dial: Dial,
) -> Result<Client, AgentError> {
    let address = |source| AgentError::Address { url: url.to_owned(), source };
    let mut endpoint = Endpoint::from_shared(url.to_owned()).map_err(address)?;
    if let Some(tls) = credentials.tls_for(url)? {
        endpoint = endpoint.tls_config(tls).map_err(address)?;
    }
    let channel = dial(
        &endpoint
            .tcp_nodelay(true)
            .connect_timeout(CONNECT_TIMEOUT)
            .timeout(ANSWER_TIMEOUT)
            .http2_keep_alive_interval(KEEP_ALIVE)
            .keep_alive_timeout(KEEP_ALIVE)
            .keep_alive_while_idle(true)
            .initial_stream_window_size(WINDOW_BYTES)
            .initial_connection_window_size(WINDOW_BYTES),
    );
    let client = FarmClient::with_interceptor(channel, Bearer(credentials.token.clone()));
    Ok(client.max_decoding_message_size(MESSAGE_BYTES_MAX))
}
