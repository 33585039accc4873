//! A TCP listener for dashboards and probes: few connections, each with a read and write timeout.

use axum::serve::Listener;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_io_timeout::TimeoutStream;

/// Connections at a time; browsers hold six each.
const CONNECTIONS_MAX: usize = 128;

/// A connection without traffic for this time is closed.
const SILENCE: Duration = Duration::from_secs(30);

/// A TCP listener with a limit of connections and timeouts.
#[derive(Debug)]
pub struct BoundedListener {
    listener: TcpListener,
    shares: Arc<Semaphore>,
}

impl BoundedListener {
    /// Sets the limits of a listener.
    pub fn new(listener: TcpListener) -> Self {
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
        let mut stream = TimeoutStream::new(stream);
        stream.set_read_timeout(Some(SILENCE));
        stream.set_write_timeout(Some(SILENCE));
        (Connection { stream: Box::pin(stream), _share: share }, address)
    }

    fn local_addr(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection with its permit.
#[derive(Debug)]
pub struct Connection {
    stream: Pin<Box<TimeoutStream<TcpStream>>>,
    _share: OwnedSemaphorePermit,
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        self.stream.as_mut().poll_read(context, buffer)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        self.stream.as_mut().poll_write(context, bytes)
    }

    fn poll_flush(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        self.stream.as_mut().poll_flush(context)
    }

    fn poll_shutdown(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        self.stream.as_mut().poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    #[tokio::test(start_paused = true)]
    async fn who_says_nothing_is_not_waited_for() {
        let mut port = BoundedListener::new(TcpListener::bind("127.0.0.1:0").await.unwrap());
        let mut client = TcpStream::connect(port.local_addr().unwrap()).await.unwrap();
        let (mut connection, _) = port.accept().await;
        client.write_all(b"GET").await.unwrap();
        let mut text = [0; 8];
        assert_eq!(connection.read(&mut text).await.unwrap(), 3);
        let error = connection.read(&mut text).await.unwrap_err();
        assert_eq!(error.kind(), std::io::ErrorKind::TimedOut);
        assert_eq!(port.shares.available_permits(), CONNECTIONS_MAX - 1);
        drop(connection);
        assert_eq!(port.shares.available_permits(), CONNECTIONS_MAX);
    }
}
