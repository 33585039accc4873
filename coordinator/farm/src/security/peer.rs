//! An accepted connection.

use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::Sleep;
use tokio_rustls::server::TlsStream;
use tokio_util::either::Either;
use tonic::transport::server::Connected;

/// Maximum duration of a connection without an admitted call.
const ADMISSION_TIME: Duration = Duration::from_secs(30);

/// Plain text or TLS connection.
pub(crate) type Stream = Either<TcpStream, Box<TlsStream<TcpStream>>>;

/// Caller of a request; added to every request of its connection.
#[derive(Clone, Debug)]
pub struct Caller {
    /// Network address of the caller.
    pub address: SocketAddr,
    admitted: Arc<AtomicBool>,
}

impl Caller {
    /// Records that a call of this connection was admitted, so that the connection is kept.
    pub(crate) fn admit(&self) {
        self.admitted.store(true, Ordering::Relaxed);
    }
}

/// An accepted connection. It counts towards the maximum number of connections.
pub struct Peer {
    stream: Stream,
    caller: Caller,
    /// Bytes of the preface that were already read and are not yet passed on.
    begin: &'static [u8],
    /// Time limit of the first admitted call; `None` after that call.
    deadline: Option<Pin<Box<Sleep>>>,
    _share: OwnedSemaphorePermit,
}

impl Peer {
    /// Creates a connection of which the bytes `begin` were already read.
    pub(crate) fn new(
        stream: Stream,
        begin: &'static [u8],
        address: SocketAddr,
        share: OwnedSemaphorePermit,
    ) -> Self {
        let caller = Caller { address, admitted: Arc::default() };
        let deadline = Some(Box::pin(tokio::time::sleep(ADMISSION_TIME)));
        Self { stream, caller, begin, deadline, _share: share }
    }

    /// Returns an error if no call was admitted within the time limit.
    fn check_deadline(&mut self, context: &mut Context<'_>) -> std::io::Result<()> {
        let Some(deadline) = &mut self.deadline else { return Ok(()) };
        if self.caller.admitted.load(Ordering::Relaxed) {
            self.deadline = None;
        } else if deadline.as_mut().poll(context).is_ready() {
            let reason = format!("no call was admitted for {} s", ADMISSION_TIME.as_secs());
            tracing::warn!(peer = %self.caller.address, "connection ended: {reason}");
            return Err(std::io::Error::new(std::io::ErrorKind::TimedOut, reason));
        }
        Ok(())
    }
}

impl Connected for Peer {
    type ConnectInfo = Caller;

    fn connect_info(&self) -> Caller {
        self.caller.clone()
    }
}

impl AsyncRead for Peer {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        if !self.begin.is_empty() {
            let (now, later) = self.begin.split_at(self.begin.len().min(buffer.remaining()));
            buffer.put_slice(now);
            self.begin = later;
            return Poll::Ready(Ok(()));
        }
        self.check_deadline(context)?;
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl AsyncWrite for Peer {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
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

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[std::io::IoSlice<'_>],
    ) -> Poll<std::io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}
