//! Dispatch: one task to one worker, and its positions back, checked as they come.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use horma_core::{Counters, Extent, ExtentRecord, Handout, Run, Stock};
use horma_proto::metrics::{POSITIONS, TRAFFIC};
use horma_proto::trace::calling;
use horma_proto::transport::{self, Trouble};
use horma_proto::wire::digitize_reply::Kind as Reply;
use horma_proto::wire::digitize_request::Kind as Request;
use horma_proto::wire::task::Supply;
use horma_proto::wire::worker_client::WorkerClient;
use horma_proto::wire::{self, DigitizeReply, DigitizeRequest};
use horma_proto::{Answer, Chunks, Error, MAX_MESSAGE, Role, TaskId, Tls};
use prost::Message;
use tokio::sync::oneshot;
use tonic::transport::Channel;
use tonic::{Status, Streaming};
use tracing::debug;

use crate::Progress;
use crate::received::{Received, Sent, Taken};
use crate::state::{Fault, Held};

/// All that an attempt needs.
pub(crate) struct Attempt {
    pub task: TaskId,
    pub worker: String,
    pub address: String,
    pub plan: Arc<Handout>,
    pub extent: Extent,
    pub overlap_rows: u32,
    /// What it is to do of the extent.
    pub runs: Vec<Run>,
    /// The rows that go with the task: none if workers hold them or make them.
    pub rows: Vec<u32>,
    /// Who holds the rows, the worker's own first, and where; nobody if they come with the task.
    pub holders: Vec<(Held, String)>,
    /// What has come of the extent, by whomever.
    pub coming: Arc<Coming>,
    /// Positions that this attempt has sent so far.
    pub came: Arc<AtomicU64>,
    /// Positions of the job that have arrived so far.
    pub arrived: Arc<AtomicU64>,
    /// Those of them that were inserted, which `arrived` does not count.
    pub inserted: Arc<AtomicU64>,
    pub progress: Progress,
    pub tls: Option<Tls>,
}

/// An extent on its way, from one worker or two.
#[derive(Default)]
pub(crate) struct Coming {
    received: Mutex<Received>,
    /// Bytes that were sent for it.
    pub sent: Arc<AtomicU64>,
    /// Bytes that have come.
    pub bytes: AtomicU64,
}

impl Coming {
    /// Nothing yet of an extent.
    pub fn of(extent: &Extent) -> Self {
        Self {
            received: Mutex::new(Received::new(extent.first, extent.count)),
            ..Self::default()
        }
    }

    /// What has come. Not for as long as anything is waited for.
    pub fn received(&self) -> MutexGuard<'_, Received> {
        // Every change is a single call: there is no half of one to be seen.
        self.received.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A task that was not delivered.
pub(crate) struct Undelivered {
    pub fault: Fault,
    pub positions_received: u64,
}

impl std::fmt::Display for Undelivered {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.fault.fmt(f)
    }
}

/// Makes the attempt; `cut_off` ends it early and says why. It is over as soon as nothing of the extent
/// is missing.
pub(crate) async fn dispatch(
    attempt: Attempt,
    cut_off: oneshot::Receiver<String>,
) -> Result<ExtentRecord, Undelivered> {
    let asked = attempt.runs.iter().map(|r| r.first..r.first + r.count);
    let mut sent = Sent::nothing_of(asked);
    let call = call(&attempt, &mut sent);
    let outcome = tokio::select! {
        outcome = call => outcome,
        reason = cut_off => Err(Fault::Lost(reason.unwrap_or("the job is over".to_owned()))),
    };
    outcome.map_err(|fault| {
        if matches!(fault, Fault::Wrong(_)) {
            let (positions, inserted) = attempt.coming.received().forget(attempt.task.attempt);
            attempt.arrived.fetch_sub(positions, Ordering::Relaxed);
            attempt.inserted.fetch_sub(inserted, Ordering::Relaxed);
        }
        Undelivered {
            fault,
            positions_received: sent.so_far(),
        }
    })
}

/// A connection to a worker.
pub(crate) async fn connect(
    address: &str,
    tls: Option<&Tls>,
) -> Result<WorkerClient<Channel>, Fault> {
    let lost = |e: tonic::transport::Error| lost(&e);
    let endpoint = transport::endpoint(address).map_err(lost)?;
    let channel = transport::connect(&endpoint, Role::Worker, tls)
        .await
        .map_err(lost)?;
    Ok(WorkerClient::new(channel)
        .max_decoding_message_size(MAX_MESSAGE)
        .max_encoding_message_size(MAX_MESSAGE))
}

async fn call(attempt: &Attempt, sent: &mut Sent) -> Result<ExtentRecord, Fault> {
    let begin = Instant::now();
    let mut client = connect(&attempt.address, attempt.tls.as_ref()).await?;
    let replies = client.digitize(calling(requests(attempt))).await;
    let mut replies = replies.map_err(|s| fault(&s))?.into_inner();
    let finished = receive(attempt, sent, &mut replies).await?;
    let halo_rows = attempt.extent.halo.iter().map(|h| h.rows.len() as u32);
    Ok(ExtentRecord {
        extent: attempt.task.extent,
        attempt: attempt.task.attempt,
        worker: attempt.worker.clone(),
        first: attempt.extent.first,
        positions: attempt.extent.count,
        rows: attempt.extent.rows.len() as u32,
        overlap_rows: attempt.overlap_rows,
        halo_rows: halo_rows.sum(),
        bytes_fetched: finished.halo_bytes,
        seconds: begin.elapsed().as_secs_f64(),
        receive_seconds: finished.receive_seconds,
        make_seconds: finished.make_seconds,
        halo_seconds: finished.halo_seconds,
        build_seconds: finished.build_seconds,
        digitize_seconds: finished.digitize_seconds,
        // The rest is known once the extent is complete.
        ..ExtentRecord::default()
    })
}

/// The task and what its rows come from, packed as they are sent.
fn requests(
    attempt: &Attempt,
) -> impl tokio_stream::Stream<Item = DigitizeRequest> + Send + 'static {
    let (supply, chunks) = supply(attempt);
    let run = |run: &Run| wire::Run {
        first: run.first,
        count: run.count,
        rows: horma_proto::spans_of(&run.rows),
    };
    let task = wire::Task {
        id: Some(attempt.task.into()),
        job: Some(horma_proto::job_to_wire(&attempt.plan.job)),
        trajectory: Some(horma_proto::trajectory_to_wire(&attempt.plan.trajectory)),
        runs: attempt.runs.iter().map(run).collect(),
        supply: Some(supply),
    };
    let sent = attempt.coming.sent.clone();
    let requests =
        std::iter::once(Request::Task(horma_proto::seal(&task))).chain(chunks.map(Request::Rows));
    tokio_stream::iter(requests.map(move |kind| {
        let request = DigitizeRequest { kind: Some(kind) };
        let bytes = request.encoded_len() as u64;
        sent.fetch_add(bytes, Ordering::Relaxed);
        TRAFFIC.add("to_workers", bytes);
        request
    }))
}

type AllChunks = Box<dyn Iterator<Item = wire::Chunk> + Send>;

/// How the worker comes by its rows. This is all in which the distributions differ here.
fn supply(attempt: &Attempt) -> (Supply, AllChunks) {
    let (plan, rows) = (attempt.plan.clone(), attempt.rows.clone());
    match (&attempt.plan.stock, &attempt.holders[..]) {
        (_, [(own, _), others @ ..]) => {
            let source = |(held, address): &(Held, String)| wire::Source {
                id: Some(held.id.into()),
                worker: held.worker.clone(),
                address: address.clone(),
                rows: halo_of(&attempt.extent, held.id.extent),
            };
            let holdings = wire::Holdings {
                own: Some(own.id.into()),
                halo: others.iter().map(source).collect(),
            };
            (Supply::Holdings(holdings), Box::new(std::iter::empty()))
        }
        (Stock::Rows(_), []) => {
            let supply = Supply::Rows(rows.len() as u32);
            (supply, Box::new(Chunks::of(rows_to_wire(plan, rows))))
        }
        (Stock::Grids(grids), []) => {
            let needed = needed(&attempt.runs);
            let grids = grids.iter().filter_map(|grid| grid.only(&needed));
            let grids: Vec<_> = grids.map(|g| horma_proto::grid_to_wire(&g)).collect();
            let supply = Supply::Grids(grids.len() as u32);
            (supply, Box::new(Chunks::of(grids.into_iter())))
        }
    }
}

/// The rows that an extent needs of another.
fn halo_of(extent: &Extent, other: u32) -> Vec<wire::Span> {
    let halo = extent.halo.iter().find(|h| h.extent == other);
    halo.map_or(Vec::new(), |h| horma_proto::spans_of(&h.rows))
}

/// Rows by their ids, packed as they are taken.
pub(crate) fn rows_to_wire(
    plan: Arc<Handout>,
    ids: Vec<u32>,
) -> impl Iterator<Item = wire::Row> + Send + 'static {
    ids.into_iter().filter_map(move |id| match &plan.stock {
        Stock::Rows(rows) => Some(horma_proto::row_to_wire(&rows[id as usize])),
        Stock::Grids(_) => None,
    })
}

/// The rows that runs need together, in order.
pub(crate) fn needed(runs: &[Run]) -> Vec<u32> {
    let mut rows: Vec<u32> = runs.iter().flat_map(|run| run.rows.clone()).collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}

/// Takes the positions in, each once and for this very task, until all are there.
async fn receive(
    attempt: &Attempt,
    sent: &mut Sent,
    replies: &mut Streaming<DigitizeReply>,
) -> Result<wire::Finished, Fault> {
    let wrong = |error: Error| Fault::Wrong(error.to_string());
    while let Some(reply) = replies.message().await.map_err(|s| fault(&s))? {
        let bytes = reply.encoded_len() as u64;
        attempt.coming.bytes.fetch_add(bytes, Ordering::Relaxed);
        TRAFFIC.add("results", bytes);
        let id: TaskId = reply.id.try_into().map_err(wrong)?;
        if id != attempt.task {
            return Err(Fault::Wrong(format!("it speaks of {id}")));
        }
        match reply.kind {
            Some(Reply::Positions(positions)) => {
                let cost = horma_proto::counters_from_wire(reply.counters.unwrap_or_default());
                let cost = cost.map_err(wrong)?;
                take(attempt, sent, &positions, cost)?;
                if sent.left() > 0 && attempt.coming.received().left() == 0 {
                    // The rest has come from whoever it helps, or is helped by.
                    return Ok(wire::Finished::default());
                }
            }
            Some(Reply::Finished(finished)) if sent.left() == 0 => {
                let wire::Finished {
                    build_seconds,
                    digitize_seconds,
                    receive_seconds,
                    make_seconds,
                    halo_seconds,
                    ..
                } = finished;
                let seconds = build_seconds + digitize_seconds + receive_seconds;
                let seconds = seconds + make_seconds + halo_seconds;
                if !seconds.is_finite() {
                    return Err(Fault::Wrong(format!("it worked for {seconds} s")));
                }
                return Ok(finished);
            }
            Some(Reply::Finished(_)) => {
                let left = sent.left();
                return Err(Fault::Wrong(format!(
                    "it finished with {left} positions left"
                )));
            }
            Some(Reply::HaloLost(lost)) => {
                let source: TaskId = lost.source.try_into().map_err(wrong)?;
                let mut others = attempt.holders.iter().skip(1);
                if !others.any(|(held, _)| held.id == source) {
                    return Err(Fault::Wrong(format!("it asked for the rows of {source}")));
                }
                let reason = lost.reason;
                return Err(Fault::Halo { source, reason });
            }
            None => return Err(Fault::Wrong("it sent an empty reply".to_owned())),
        }
    }
    Err(Fault::Lost("it ended its answer early".to_owned()))
}

/// Takes in the positions of one message.
fn take(
    attempt: &Attempt,
    sent: &mut Sent,
    positions: &wire::Positions,
    cost: Counters,
) -> Result<(), Fault> {
    let total = attempt.plan.trajectory.positions;
    let run = horma_proto::unpack_positions(positions, total);
    let run = run.map_err(|error| Fault::Wrong(error.to_string()))?;
    let (count, inserted) = (run.touches.len() as u64, run.between.len() as u64);
    if inserted > 0 && attempt.plan.job.motion.path_tolerance.is_none() {
        let why = "it inserted positions that nobody asked for";
        return Err(Fault::Wrong(why.to_owned()));
    }
    POSITIONS.add("", count);
    sent.note(run.first..run.end()).map_err(Fault::Wrong)?;
    attempt.came.store(sent.so_far(), Ordering::Relaxed);
    let (first, worker) = (run.first, &attempt.worker);
    debug!(task = %attempt.task, worker, first, count, "positions");
    let taken = attempt
        .coming
        .received()
        .take(attempt.task.attempt, run, cost);
    match taken {
        Taken::New => {}
        Taken::Again => return Ok(()),
        Taken::Different { attempt } => return Err(Fault::Different { attempt }),
    }
    let all = attempt.inserted.fetch_add(inserted, Ordering::Relaxed) + inserted;
    let fits = attempt.plan.check_inserted(all);
    fits.map_err(|e| Fault::Lost(e.to_string()))?;
    let arrived = attempt.arrived.fetch_add(count, Ordering::Relaxed) + count;
    (attempt.progress)("digitize", arrived, total);
    Ok(())
}

/// What a status says of the worker. Only an answer about the content is the worker's fault; a
/// partition may show as almost anything else.
pub(crate) fn fault(status: &Status) -> Fault {
    match Answer::of(status) {
        Answer::Wrong => Fault::Wrong(status.message().to_owned()),
        Answer::Silence => lost(status),
        Answer::Impossible | Answer::Failed | Answer::Forbidden | Answer::Stranger => {
            Fault::Lost(status.message().to_owned())
        }
    }
}

/// The worker cannot be reached, or not be trusted to be one.
fn lost(error: &(dyn std::error::Error + 'static)) -> Fault {
    match Trouble::of(error, Role::Worker) {
        Trouble::Untrusted(reason) => Fault::Lost(format!("it is not trusted: {reason}")),
        Trouble::Unreachable(_) | Trouble::Broken(_) => Fault::Lost(chain(error)),
    }
}

/// An error with its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |e| e.source());
    causes.fold(error.to_string(), |all, cause| format!("{all}: {cause}"))
}
