//! The connection to one coordinator.

use crate::config::Dial;
use crate::credentials::{Bearer, Credentials};
use crate::error::AgentError;
use std::time::Duration;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use tracktwin_protocol::farm::farm_client::FarmClient;
use tracktwin_protocol::{MESSAGE_BYTES_MAX, WINDOW_BYTES};

/// Time limit of one attempt to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Time limit of a response. A commit takes milliseconds; a call to a busy coordinator is better
/// repeated later.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(20);

/// Interval of tests of an idle connection. They detect a coordinator that has disappeared.
const KEEP_ALIVE: Duration = Duration::from_secs(5);

/// Client for calls to a coordinator.
pub(crate) type Client = FarmClient<InterceptedService<Channel, Bearer>>;

/// Creates a connection to a coordinator. It opens at first use, and again after each failure.
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
