//! Connections of a server, no more than so many at once: beyond that callers wait in the system's
//! queue, and cost nothing here.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_stream::{Stream, StreamExt};
use tonic::transport::server::Connected;

/// A connection in its place, which is free again when it is closed.
pub(crate) struct Placed<Io> {
    io: Io,
    _place: Option<OwnedSemaphorePermit>,
}

/// Takes connections as places become free.
pub(crate) fn at_most<Io: Send>(
    most: usize,
    incoming: impl Stream<Item = io::Result<Io>> + Send,
) -> impl Stream<Item = io::Result<Placed<Io>>> + Send {
    let places = Arc::new(Semaphore::new(most));
    incoming.then(move |io| {
        let places = places.clone();
        async move {
            // Nobody closes the semaphore.
            let _place = places.acquire_owned().await.ok();
            io.map(|io| Placed { io, _place })
        }
    })
}

impl<Io: Connected> Connected for Placed<Io> {
    type ConnectInfo = Io::ConnectInfo;

    fn connect_info(&self) -> Io::ConnectInfo {
        self.io.connect_info()
    }
}

impl<Io: AsyncRead + Unpin> AsyncRead for Placed<Io> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        into: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_read(context, into)
    }
}

impl<Io: AsyncWrite + Unpin> AsyncWrite for Placed<Io> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.io).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.io).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.io.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, DuplexStream, duplex};

    use super::*;

    #[tokio::test]
    async fn a_connection_waits_until_another_is_closed() {
        let pairs: Vec<(DuplexStream, DuplexStream)> = (0..3).map(|_| duplex(8)).collect();
        let (ours, theirs): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
        let incoming = tokio_stream::iter(ours.into_iter().map(Ok));
        let mut taken = std::pin::pin!(at_most(2, incoming));
        let mut next = async || taken.next().await.expect("one more").expect("connected");
        let (first, second) = (next().await, next().await);
        let mut third = std::pin::pin!(next());
        let waits = std::future::poll_fn(|context| Poll::Ready(third.as_mut().poll(context)));
        assert!(waits.await.is_pending());
        drop(first);
        drop(third.await);
        drop(second);
        for mut other in theirs {
            assert_eq!(other.read(&mut [0]).await.expect("closed"), 0);
        }
    }
}
