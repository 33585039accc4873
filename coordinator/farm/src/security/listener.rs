//! Accepts or refuses connections; the log has the reason of a refusal.

use super::peer::{Peer, Stream};
use super::settings::HTTP2;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::AsyncReadExt;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio_rustls::TlsAcceptor;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::either::Either;

/// Maximum number of connections, enough for a few thousand nodes. Each connection needs a file descriptor
/// and about 100 kB.
const CONNECTIONS_MAX: usize = 4096;

/// Maximum number of accepted connections that wait for the service.
const WAITING_MAX: usize = 64;

/// Time limit of the connection preface; TLS over a slow line takes a second.
const PREFACE_TIME: Duration = Duration::from_secs(10);

/// Pause after an error of accepting a connection, because file descriptors soon become free.
const SYSTEM_PAUSE: Duration = Duration::from_millis(100);

/// Preface of every HTTP/2 connection (RFC 9113, 3.4).
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// Reasons for refusing a connection.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error("no data for {} s", PREFACE_TIME.as_secs())]
    Silent,
    #[error("unknown protocol; gRPC is expected")]
    UnknownProtocol,
    #[error("TLS: {0}")]
    Tls(std::io::Error),
    #[error("TLS without HTTP/2")]
    NoHttp2,
    #[error("connection lost: {0}")]
    Gone(#[from] std::io::Error),
}

/// Returns the accepted connections of a port. Accepting ends when the stream is dropped.
///
/// Each preface is read in a separate task, so that a slow or silent caller does not delay others.
pub fn accept(
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
) -> ReceiverStream<std::io::Result<Peer>> {
    let (peers, waiting) = mpsc::channel(WAITING_MAX);
    let shares = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    tokio::spawn(async move {
        loop {
            let share = shares.clone().acquire_owned().await;
            let share = share.expect("nobody closes this semaphore");
            let (stream, address) = tokio::select! {
                accepted = listener.accept() => match accepted {
                    Ok(accepted) => accepted,
                    Err(error) => {
                        tracing::warn!("cannot accept a connection: {error}");
                        tokio::time::sleep(SYSTEM_PAUSE).await;
                        continue;
                    }
                },
                () = peers.closed() => break,
            };
            tokio::spawn(accept_connection(stream, address, tls.clone(), share, peers.clone()));
        }
    });
    ReceiverStream::new(waiting)
}

async fn accept_connection(
    stream: TcpStream,
    address: SocketAddr,
    tls: Option<TlsAcceptor>,
    share: OwnedSemaphorePermit,
    peers: mpsc::Sender<std::io::Result<Peer>>,
) {
    let preface = tokio::time::timeout(PREFACE_TIME, read_preface(stream, tls)).await;
    match preface.unwrap_or(Err(Refusal::Silent)) {
        // Who would take it may be stopping.
        Ok(stream) => drop(peers.send(Ok(Peer::new(stream, PREFACE, address, share))).await),
        Err(refusal) => tracing::warn!(peer = %address, "connection refused: {refusal}"),
    }
}

/// Reads the start of a connection, up to the end of [`PREFACE`].
async fn read_preface(stream: TcpStream, tls: Option<TlsAcceptor>) -> Result<Stream, Refusal> {
    stream.set_nodelay(true)?;
    let mut stream = match tls {
        None => Either::Left(stream),
        Some(tls) => {
            let stream = tls.accept(stream).await.map_err(Refusal::Tls)?;
            if stream.get_ref().1.alpn_protocol() != Some(HTTP2) {
                return Err(Refusal::NoHttp2);
            }
            Either::Right(Box::new(stream))
        }
    };
    let mut begin = [0; PREFACE.len()];
    let mut length = 0;
    while length < begin.len() {
        let more = stream.read(&mut begin[length..]).await?;
        length += more;
        if more == 0 || !PREFACE.starts_with(&begin[..length]) {
            return Err(Refusal::UnknownProtocol);
        }
    }
    Ok(stream)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::AsyncWriteExt;
    use tokio_stream::StreamExt;

    /// Opens a port, and connects a caller that sends `begin`.
    async fn called(begin: &[u8]) -> (ReceiverStream<std::io::Result<Peer>>, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let mut caller = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        caller.write_all(begin).await.unwrap();
        (accept(listener, None), caller)
    }

    #[tokio::test(start_paused = true)]
    async fn who_does_not_finish_its_greeting_is_not_waited_for() {
        let (_peers, mut caller) = called(&PREFACE[..5]).await;
        assert_eq!(caller.read(&mut [0; 8]).await.unwrap(), 0, "it is turned away");
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_lasts_if_a_call_of_it_was_admitted() {
        for admitted in [false, true] {
            let (mut peers, mut caller) = called(&[PREFACE, b"more"].concat()).await;
            let mut peer = peers.next().await.unwrap().unwrap();
            let mut begin = [0; PREFACE.len() + 4];
            peer.read_exact(&mut begin).await.unwrap();
            assert_eq!(begin, *[PREFACE, b"more"].concat());
            if admitted {
                tonic::transport::server::Connected::connect_info(&peer).admit();
            }
            let minute = tokio::time::sleep(Duration::from_mins(1));
            let later = async {
                minute.await;
                caller.write_all(b"x").await.unwrap();
                std::future::pending::<()>().await;
            };
            let mut one = [0; 1];
            tokio::select! {
                read = peer.read_exact(&mut one) => assert_eq!(read.is_ok(), admitted),
                () = later => {}
            }
        }
    }
}
