//! Rows from the workers that hold them. Who holds what is the master's to say; a worker that cannot
//! get rows says whose, and tries nobody else.

use std::sync::Arc;
use std::time::Duration;

use horma_core::Row;
use horma_proto::metrics::TRAFFIC;
use horma_proto::trace::{self, calling};
use horma_proto::transport::{self, Trouble};
use horma_proto::wire::worker_client::WorkerClient;
use horma_proto::wire::{FetchRequest, Span};
use horma_proto::{Answer, Error, MAX_MESSAGE, Role, TaskId, Tls};
use tokio::task::JoinSet;
use tokio::time::timeout;
use tonic::transport::Channel;
use tonic::{Code, Status};
use tracing::{Instrument, debug, info_span, warn};

use crate::receive::Rows;
use crate::store::Store;

/// Longest silence within an answer.
const SILENCE: Duration = Duration::from_secs(15);

/// How often a worker is asked that does not answer, and the pause after the first time; it doubles.
const TRIES: u32 = 3;
const PAUSE: Duration = Duration::from_millis(200);

/// A worker that holds rows which a task needs.
#[derive(Debug, Clone)]
pub(crate) struct Source {
    /// By which it holds them.
    pub id: TaskId,
    pub worker: String,
    pub address: String,
    pub rows: Vec<Span>,
}

/// Rows that came.
#[derive(Debug, Default)]
pub(crate) struct Fetched {
    pub rows: Vec<Row>,
    /// Bytes of those that other workers sent.
    pub bytes: u64,
}

/// Rows that could not be had.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Lost {
    pub source: TaskId,
    pub reason: String,
}

/// Fetches rows from all sources at once; what this worker holds itself needs no connection.
pub(crate) async fn fetch_all(
    sources: Vec<Source>,
    store: Arc<Store>,
    tls: Option<Tls>,
) -> Result<Fetched, Lost> {
    let mut all = Fetched::default();
    let mut fetching = JoinSet::new();
    for source in sources {
        match store.get(source.id) {
            Some(rows) => all.rows.extend(some_of(&rows, &source.rows).cloned()),
            None => drop(fetching.spawn(fetch(source, tls.clone()).in_current_span())),
        }
    }
    while let Some(fetched) = fetching.join_next().await {
        // Nothing ends these but a runtime that stops, and then nobody waits for the rows.
        let Ok(fetched) = fetched else { continue };
        let fetched = fetched?;
        all.rows.extend(fetched.rows);
        all.bytes += fetched.bytes;
    }
    all.rows.sort_by_key(|row| row.id);
    Ok(all)
}

/// Those of some rows that are in the spans.
pub(crate) fn some_of<'a>(rows: &'a [Row], spans: &'a [Span]) -> impl Iterator<Item = &'a Row> {
    let wanted = |row: &&Row| horma_proto::in_spans(spans, row.id);
    rows.iter().filter(wanted)
}

async fn fetch(source: Source, tls: Option<Tls>) -> Result<Fetched, Lost> {
    let mut pause = PAUSE;
    let mut tried = 1;
    loop {
        let (id, worker) = (source.id, &source.worker);
        let span = info_span!("fetch rows", otel.kind = "client", %id, worker);
        match trace::within(span, ask(&source, tls.as_ref())).await {
            Ok(fetched) => {
                debug!(%id, worker, rows = fetched.rows.len(), "rows fetched");
                return Ok(fetched);
            }
            Err(status) if tried < TRIES && may_pass(&status) => {
                warn!(%id, worker, reason = chain(&status), "no rows yet");
                tokio::time::sleep(pause).await;
                (pause, tried) = (2 * pause, tried + 1);
            }
            Err(status) => {
                let address = &source.address;
                let reason = format!("worker {worker} at {address}: {}", chain(&status));
                warn!(%id, reason, "no rows");
                return Err(Lost { source: id, reason });
            }
        }
    }
}

/// Whether the way there may have failed: a worker that does not hold the rows, holds others, or has
/// been silent for long will not do better when it is asked again.
fn may_pass(status: &Status) -> bool {
    Answer::of(status) == Answer::Silence && status.code() != Code::DeadlineExceeded
}

async fn ask(source: &Source, tls: Option<&Tls>) -> Result<Fetched, Status> {
    let mut client = connect(&source.address, tls).await?;
    let request = FetchRequest {
        id: Some(source.id.into()),
        rows: source.rows.clone(),
    };
    let silent = |_| {
        let seconds = SILENCE.as_secs();
        Status::deadline_exceeded(format!("it sent nothing for {seconds} s"))
    };
    let reply = timeout(SILENCE, client.fetch_rows(calling(request))).await;
    let mut chunks = reply.map_err(silent)??.into_inner();
    let (mut rows, mut bytes) = (Rows::default(), 0);
    let expected = horma_proto::spanned(&source.rows);
    while let Some(chunk) = timeout(SILENCE, chunks.message()).await.map_err(silent)?? {
        let length = chunk.data.len() as u64;
        bytes += length;
        TRAFFIC.add("between_workers", length);
        rows.push(&chunk)?;
        if rows.len() > expected {
            break;
        }
    }
    let rows = rows.finish(expected)?;
    if let Some(row) = rows
        .iter()
        .find(|row| !horma_proto::in_spans(&source.rows, row.id))
    {
        let why = format!("row {} was not asked for", row.id);
        return Err(Error::Malformed(why).into());
    }
    Ok(Fetched { rows, bytes })
}

async fn connect(address: &str, tls: Option<&Tls>) -> Result<WorkerClient<Channel>, Status> {
    let failed = |e: tonic::transport::Error| match Trouble::of(&e, Role::Worker) {
        Trouble::Untrusted(reason) => {
            Status::unauthenticated(format!("it is not trusted: {reason}"))
        }
        Trouble::Unreachable(_) | Trouble::Broken(_) => Status::unavailable(chain(&e)),
    };
    let endpoint = transport::endpoint(address).map_err(failed)?;
    let channel = transport::connect(&endpoint, Role::Worker, tls)
        .await
        .map_err(failed)?;
    Ok(WorkerClient::new(channel)
        .max_decoding_message_size(MAX_MESSAGE)
        .max_encoding_message_size(MAX_MESSAGE))
}

/// An error with its causes; of a status, what it says.
fn chain(error: &(dyn std::error::Error + 'static)) -> String {
    let what = match error.downcast_ref::<Status>() {
        Some(status) => status.message().to_owned(),
        None => error.to_string(),
    };
    let causes = std::iter::successors(error.source(), |e| e.source());
    causes.fold(what, |all, cause| format!("{all}: {cause}"))
}
