//! Connections with TLS, as a server takes them in. A caller that does not prove who it is gets told
//! why and the log says who it was; one that takes its time keeps nobody else waiting.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tokio_stream::wrappers::ReceiverStream;
use tracing::{debug, warn};

use crate::refused::Refused;
use crate::tls::HANDSHAKE;

/// Handshakes under way at once; further callers wait in the system's queue.
const HANDSHAKES: usize = 256;

/// Connections that may wait to be served.
const WAITING: usize = 16;

/// Pause after the system could not give a connection, most likely for want of descriptors.
const PAUSE: Duration = Duration::from_millis(100);

/// How long a caller that was refused may go on talking, and how much of it is listened to.
const LINGER: Duration = Duration::from_secs(1);
const LINGER_BYTES: usize = 1 << 16;

type Accepted = std::io::Result<TlsStream<TcpStream>>;

/// Connections whose handshake is done, until the stream is dropped; each is taken in by the acceptor that
/// counts then.
pub(crate) fn secured(
    listener: TcpListener,
    acceptor: impl Fn() -> TlsAcceptor + Send + 'static,
    refused: Arc<Refused>,
) -> ReceiverStream<Accepted> {
    let (ready, stream) = mpsc::channel(WAITING);
    tokio::spawn(accept(listener, acceptor, ready, refused));
    ReceiverStream::new(stream)
}

async fn accept(
    listener: TcpListener,
    acceptor: impl Fn() -> TlsAcceptor,
    ready: mpsc::Sender<Accepted>,
    refused: Arc<Refused>,
) {
    let slots = Arc::new(Semaphore::new(HANDSHAKES));
    loop {
        let next = async {
            // Nobody closes the semaphore.
            let slot = slots.clone().acquire_owned().await.ok();
            (slot, listener.accept().await)
        };
        let (slot, accepted) = tokio::select! {
            next = next => next,
            () = ready.closed() => return,
        };
        let (socket, peer) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                warn!(%error, "no connection");
                tokio::time::sleep(PAUSE).await;
                continue;
            }
        };
        let (acceptor, ready, refused) = (acceptor(), ready.clone(), refused.clone());
        tokio::spawn(async move {
            if let Some(stream) = handshake(socket, peer, &acceptor, &refused).await {
                // The server may have stopped.
                let _ = ready.send(Ok(stream)).await;
            }
            drop(slot);
        });
    }
}

async fn handshake(
    socket: TcpStream,
    peer: SocketAddr,
    acceptor: &TlsAcceptor,
    refused: &Refused,
) -> Option<TlsStream<TcpStream>> {
    if let Err(error) = socket.set_nodelay(true) {
        debug!(%peer, %error, "no TCP_NODELAY");
    }
    let accepting = acceptor.accept(socket).into_fallible();
    let outcome = timeout(HANDSHAKE, accepting).await;
    if let Ok(Ok(stream)) = outcome {
        return Some(stream);
    }
    refused.connection();
    if let Ok(Err((reason, socket))) = outcome {
        warn!(%peer, %reason, "connection refused");
        // Closing with something unread would be a reset, and might overtake the reason.
        let _ = timeout(LINGER, linger(socket)).await;
    } else {
        warn!(%peer, reason = "no handshake in time", "connection refused");
    }
    None
}

/// Lets the other end read the reason: what it has sent meanwhile goes unread until it closes.
async fn linger(mut socket: TcpStream) -> std::io::Result<()> {
    socket.shutdown().await?;
    let mut left = LINGER_BYTES;
    let mut unread = [0; 1024];
    while left > 0 {
        let read = socket.read(&mut unread).await?;
        if read == 0 {
            break;
        }
        left = left.saturating_sub(read);
    }
    Ok(())
}
