//! An HTTP server for dashboards and probes: few connections, each for one request within a time limit.

use axum::http::{HeaderValue, header};
use axum::middleware::map_response;
use axum::response::Response;
use axum::serve::Listener;
use axum::{Router, serve};
use std::io::ErrorKind::TimedOut;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::Sleep;
use tokio_util::sync::CancellationToken;

/// Connections at a time; browsers hold six each.
const CONNECTIONS_MAX: usize = 128;

/// Time limit of the head of a request.
const HEAD_TIME: Duration = Duration::from_secs(5);

/// Further time for the rest of the request and the response, after a head that arrived in time.
const REST_TIME: Duration = Duration::from_secs(25);

/// End of the head of an HTTP/1.1 request.
const HEAD_END: &[u8] = b"\r\n\r\n";

/// Serves HTTP requests on a port until `stop` is cancelled. Each connection has one request and a time
/// limit, so that slow callers do not keep others away.
///
/// # Errors
/// Returns the error of the port.
pub async fn serve_bounded(
    listener: TcpListener,
    routes: Router,
    stop: CancellationToken,
) -> std::io::Result<()> {
    let routes = routes.layer(map_response(last_of_its_connection));
    serve(BoundedListener::new(listener), routes)
        .with_graceful_shutdown(stop.cancelled_owned())
        .await
}

/// Ends the connection after this response.
async fn last_of_its_connection(mut response: Response) -> Response {
    response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    response
}

/// A TCP listener with a limit of connections.
struct BoundedListener {
    listener: TcpListener,
    shares: Arc<Semaphore>,
}

impl BoundedListener {
    fn new(listener: TcpListener) -> Self {
        Self { listener, shares: Arc::new(Semaphore::new(CONNECTIONS_MAX)) }
    }
}

impl Listener for BoundedListener {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        let share = self.shares.clone().acquire_owned().await;
        let share = share.expect("nobody closes this semaphore");
        let (stream, address) = Listener::accept(&mut self.listener).await;
        let deadline = Box::pin(tokio::time::sleep(HEAD_TIME));
        (Connection { stream, head_end: HEAD_END, deadline, _share: share }, address)
    }

    fn local_addr(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection with its time limit and its permit.
struct Connection {
    stream: TcpStream,
    /// The part of [`HEAD_END`] that is still to come; empty after the head.
    head_end: &'static [u8],
    deadline: Pin<Box<Sleep>>,
    _share: OwnedSemaphorePermit,
}

impl Connection {
    /// Returns an error after the deadline.
    fn check_deadline(&mut self, context: &mut Context<'_>) -> std::io::Result<()> {
        if self.deadline.as_mut().poll(context).is_ready() { Err(TimedOut.into()) } else { Ok(()) }
    }

    /// Extends the deadline if these bytes complete the head of the request.
    fn heard(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let Some((next, rest)) = self.head_end.split_first() else { return };
            let again = usize::from(*byte == HEAD_END[0]);
            self.head_end = if next == byte { rest } else { &HEAD_END[again..] };
            if self.head_end.is_empty() {
                let until = self.deadline.deadline() + REST_TIME;
                self.deadline.as_mut().reset(until);
            }
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        self.check_deadline(context)?;
        let before = buffer.filled().len();
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        self.heard(&buffer.filled()[before..]);
        read
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        self.check_deadline(context)?;
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    /// Opens a connection and sends the begin of a request.
    async fn called(address: SocketAddr, begin: &str) -> TcpStream {
        let mut caller = TcpStream::connect(address).await.unwrap();
        caller.write_all(begin.as_bytes()).await.unwrap();
        caller
    }

    #[tokio::test]
    async fn callers_that_never_finish_their_request_do_not_keep_others_away() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let routes = Router::new().route("/", get(async || "served"));
        tokio::spawn(serve_bounded(listener, routes, CancellationToken::new()));
        for number in 0..CONNECTIONS_MAX {
            let begin = if number % 2 == 0 { "" } else { "GET / HTTP/1.1\r\n" };
            let mut caller = called(address, begin).await;
            tokio::spawn(async move {
                // A byte now and then is no silence.
                while caller.write_all(b"x").await.is_ok() {
                    tokio::time::sleep(Duration::from_millis(200)).await;
                }
            });
        }
        let mut caller = called(address, "GET / HTTP/1.1\r\nHost: a\r\n\r\n").await;
        let mut response = String::new();
        let answered = caller.read_to_string(&mut response);
        tokio::time::timeout(2 * HEAD_TIME, answered).await.unwrap().unwrap();
        assert!(response.ends_with("served"), "{response}");
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_ends_in_time_also_after_its_head() {
        let head = "GET / HTTP/1.1\r\nHost: a\r\r\n\r\n";
        for (begin, time) in [("GET", HEAD_TIME), (head, HEAD_TIME + REST_TIME)] {
            let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
            let mut port = BoundedListener::new(listener);
            let _caller = called(port.local_addr().unwrap(), begin).await;
            let (mut connection, _) = port.accept().await;
            let accepted = tokio::time::Instant::now();
            let mut text = vec![0; begin.len()];
            connection.read_exact(&mut text).await.unwrap();
            let error = connection.read(&mut text).await.unwrap_err();
            assert_eq!((error.kind(), accepted.elapsed().as_secs()), (TimedOut, time.as_secs()));
            assert_eq!(port.shares.available_permits(), CONNECTIONS_MAX - 1);
            drop(connection);
            assert_eq!(port.shares.available_permits(), CONNECTIONS_MAX);
        }
    }
}
