//! Dispatch: one task to one worker, and its positions back, checked as they come.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use horma_core::{Extent, ExtentRecord, Handout, Run, Stock, SubTrajectory};
use horma_proto::metrics::{POSITIONS, TRAFFIC};
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

use crate::Progress;
use crate::received::Received;
use crate::state::{Fault, Held};

/// All that an attempt needs.
pub(crate) struct Attempt {
    pub task: TaskId,
    pub worker: String,
    pub address: String,
    pub plan: Arc<Handout>,
    pub extent: Extent,
    pub overlap_rows: u32,
    /// Who holds the rows, the worker's own first, and where; nobody if they come with the task.
    pub holders: Vec<(Held, String)>,
    /// Positions of the job that have arrived so far.
    pub arrived: Arc<AtomicU64>,
    /// Those of them that were inserted, which `arrived` does not count.
    pub inserted: Arc<AtomicU64>,
    pub progress: Progress,
    pub tls: Option<Tls>,
}

/// A task, delivered.
pub(crate) struct Delivery {
    pub positions: Vec<SubTrajectory>,
    pub record: ExtentRecord,
}

/// A task that was not delivered.
pub(crate) struct Undelivered {
    pub fault: Fault,
    pub positions_received: u64,
}

/// Makes the attempt; `cut_off` ends it early and says why.
pub(crate) async fn dispatch(
    attempt: Attempt,
    cut_off: oneshot::Receiver<String>,
) -> Result<Delivery, Undelivered> {
    let mut received = Received::new(attempt.extent.first, attempt.extent.count);
    let call = call(&attempt, &mut received);
    let outcome = tokio::select! {
        outcome = call => outcome,
        reason = cut_off => Err(Fault::Lost(reason.unwrap_or("the job is over".to_owned()))),
    };
    match outcome {
        Ok(record) => Ok(Delivery {
            positions: received.into_parts(),
            record,
        }),
        Err(fault) => {
            let positions_received = received.so_far();
            attempt
                .arrived
                .fetch_sub(positions_received, Ordering::Relaxed);
            // Beyond what there is memory for the job is over, and the driver has to see it.
            let all = attempt.inserted.load(Ordering::Relaxed);
            if attempt.plan.check_inserted(all).is_ok() {
                let inserted = received.inserted();
                attempt.inserted.fetch_sub(inserted, Ordering::Relaxed);
            }
            Err(Undelivered {
                fault,
                positions_received,
            })
        }
    }
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

async fn call(attempt: &Attempt, received: &mut Received) -> Result<ExtentRecord, Fault> {
    let begin = Instant::now();
    let mut client = connect(&attempt.address, attempt.tls.as_ref()).await?;
    let sent = Arc::new(AtomicU64::new(0));
    let replies = client.digitize(requests(attempt, sent.clone())).await;
    let mut replies = replies.map_err(|s| fault(&s))?.into_inner();
    let (finished, bytes_received) = receive(attempt, received, &mut replies).await?;
    let counters = finished.counters.unwrap_or_default();
    let halo_rows = attempt.extent.halo.iter().map(|h| h.rows.len() as u32);
    let with_task = match (&attempt.plan.stock, attempt.holders.is_empty()) {
        (Stock::Rows(_), true) => attempt.extent.rows.len() as u64,
        (Stock::Rows(_), false) | (Stock::Grids(_), _) => 0,
    };
    Ok(ExtentRecord {
        extent: attempt.task.extent,
        attempt: attempt.task.attempt,
        worker: attempt.worker.clone(),
        first: attempt.extent.first,
        positions: attempt.extent.count,
        rows: attempt.extent.rows.len() as u32,
        overlap_rows: attempt.overlap_rows,
        halo_rows: halo_rows.sum(),
        rows_sent: with_task,
        bytes_sent: sent.load(Ordering::Relaxed),
        bytes_fetched: finished.halo_bytes,
        bytes_received,
        // Known to whoever placed them.
        place_seconds: 0.0,
        seconds: begin.elapsed().as_secs_f64(),
        receive_seconds: finished.receive_seconds,
        make_seconds: finished.make_seconds,
        halo_seconds: finished.halo_seconds,
        build_seconds: finished.build_seconds,
        digitize_seconds: finished.digitize_seconds,
        counters: horma_proto::counters_from_wire(counters),
    })
}

/// The task and what its rows come from, packed as they are sent.
fn requests(
    attempt: &Attempt,
    sent: Arc<AtomicU64>,
) -> impl tokio_stream::Stream<Item = DigitizeRequest> + Send + 'static {
    let (supply, chunks) = supply(attempt);
    let run = |run: Run| wire::Run {
        first: run.first,
        count: run.count,
        rows: horma_proto::spans_of(&run.rows),
    };
    let task = wire::Task {
        id: Some(attempt.task.into()),
        job: Some(horma_proto::job_to_wire(&attempt.plan.job)),
        trajectory: Some(horma_proto::trajectory_to_wire(&attempt.plan.trajectory)),
        first: attempt.extent.first,
        count: attempt.extent.count,
        runs: attempt
            .plan
            .runs(&attempt.extent)
            .into_iter()
            .map(run)
            .collect(),
        supply: Some(supply),
    };
    let requests = std::iter::once(Request::Task(task)).chain(chunks.map(Request::Rows));
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
    let (plan, rows) = (attempt.plan.clone(), attempt.extent.rows.clone());
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
            let grids = grids.iter().filter_map(|grid| grid.only(&rows));
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

/// Takes the positions in; every one must come once, for this very task.
async fn receive(
    attempt: &Attempt,
    received: &mut Received,
    replies: &mut Streaming<DigitizeReply>,
) -> Result<(wire::Finished, u64), Fault> {
    let wrong = |error: Error| Fault::Wrong(error.to_string());
    let total = attempt.plan.trajectory.positions;
    let mut bytes = 0;
    while let Some(reply) = replies.message().await.map_err(|s| fault(&s))? {
        let reply_bytes = reply.encoded_len() as u64;
        bytes += reply_bytes;
        TRAFFIC.add("results", reply_bytes);
        let id: TaskId = reply.id.try_into().map_err(wrong)?;
        if id != attempt.task {
            return Err(Fault::Wrong(format!("it speaks of {id}")));
        }
        let left = received.left();
        match reply.kind {
            Some(Reply::Positions(positions)) => {
                let run = horma_proto::unpack_positions(&positions, total).map_err(wrong)?;
                let count = run.touches.len() as u64;
                let inserted = run.between.len() as u64;
                if inserted > 0 && attempt.plan.job.motion.path_tolerance.is_none() {
                    let why = "it inserted positions that nobody asked for";
                    return Err(Fault::Wrong(why.to_owned()));
                }
                received.take(run).map_err(Fault::Wrong)?;
                let all = attempt.inserted.fetch_add(inserted, Ordering::Relaxed) + inserted;
                let fits = attempt.plan.check_inserted(all);
                fits.map_err(|e| Fault::Lost(e.to_string()))?;
                POSITIONS.add("", count);
                let arrived = attempt.arrived.fetch_add(count, Ordering::Relaxed) + count;
                (attempt.progress)("digitize", arrived, total);
            }
            Some(Reply::Finished(finished)) if left == 0 => {
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
                return Ok((finished, bytes));
            }
            Some(Reply::Finished(_)) => {
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
