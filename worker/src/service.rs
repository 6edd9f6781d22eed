//! The worker's service: what the master and other workers see of it.

use std::pin::Pin;

use horma_proto::wire::worker_server::Worker;
use horma_proto::wire::{
    Chunk, DigitizeReply, DigitizeRequest, FetchRequest, PlaceReply, PlaceRequest,
};
use horma_proto::{Chunks, Error, Guard, Role, TaskId, trace};
use tokio::sync::mpsc;
use tokio_stream::Stream;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use tracing::field::{Empty, display};
use tracing::{Instrument, info, info_span};

use crate::receive;
use crate::work::{Means, work};

/// Chunks of positions that may wait for the master to take them.
const WAITING_CHUNKS: usize = 4;

pub(crate) struct Service {
    pub means: Means,
    pub guard: Guard,
}

#[tonic::async_trait]
impl Worker for Service {
    type DigitizeStream = ReceiverStream<Result<DigitizeReply, Status>>;
    type FetchRowsStream = Pin<Box<dyn Stream<Item = Result<Chunk, Status>> + Send>>;

    async fn digitize(
        &self,
        request: Request<Streaming<DigitizeRequest>>,
    ) -> Result<Response<Self::DigitizeStream>, Status> {
        self.guard.admit(&request, Role::Master)?;
        let span = info_span!("task", otel.kind = "server", id = Empty, positions = Empty);
        let span = trace::child_of(trace::caller(&request), span);
        let receiving = receive::task(request.into_inner());
        let task = trace::within(span.clone(), receiving).await?;
        let positions: u64 = task.runs.iter().map(|r| r.count).sum();
        info!(id = %task.id, positions, runs = task.runs.len(), "task");
        span.record("id", display(task.id))
            .record("positions", positions);
        let (replies, stream) = mpsc::channel(WAITING_CHUNKS);
        tokio::spawn(work(task, self.means.clone(), replies).instrument(span));
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn place(
        &self,
        request: Request<Streaming<PlaceRequest>>,
    ) -> Result<Response<PlaceReply>, Status> {
        self.guard.admit(&request, Role::Master)?;
        let span = info_span!("hold rows", otel.kind = "server");
        let span = trace::child_of(trace::caller(&request), span);
        let receiving = receive::placement(request.into_inner());
        let (master, id, rows) = trace::within(span, receiving).await?;
        info!(%id, rows = rows.len(), "holds rows");
        self.means.store.put(master, id, rows);
        Ok(Response::new(PlaceReply {}))
    }

    async fn fetch_rows(
        &self,
        request: Request<FetchRequest>,
    ) -> Result<Response<Self::FetchRowsStream>, Status> {
        self.guard.admit(&request, Role::Worker)?;
        let span = info_span!("give rows", otel.kind = "server", id = Empty, rows = Empty);
        let span = trace::child_of(trace::caller(&request), span);
        let FetchRequest { id, rows: spans } = request.into_inner();
        let id: TaskId = id.try_into()?;
        let Some(rows) = self.means.store.get(id) else {
            return Err(Error::NotHeld { id }.into());
        };
        let asked = horma_proto::spanned(&spans);
        info!(%id, rows = asked, "asked for rows");
        span.record("id", display(id)).record("rows", asked);
        let count = rows.len();
        let wanted = (0..count).filter_map(move |i| {
            let row = &rows[i];
            horma_proto::in_spans(&spans, row.id).then(|| horma_proto::row_to_wire(row))
        });
        // Packed as they are taken, a chunk at a time.
        let packed = Chunks::of(wanted).map(move |chunk| span.in_scope(|| Ok(chunk)));
        let chunks = tokio_stream::iter(packed);
        Ok(Response::new(Box::pin(chunks)))
    }
}
