//! Dispatch: one task to one worker, and its positions back, checked as they come.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use horma_core::{Extent, ExtentRecord, Inserted, Plan, SubTrajectory};
use horma_proto::transport::{self, Trouble};
use horma_proto::wire::digitize_reply::Kind as Reply;
use horma_proto::wire::digitize_request::Kind as Request;
use horma_proto::wire::worker_client::WorkerClient;
use horma_proto::wire::{self, DigitizeReply, DigitizeRequest};
use horma_proto::{Answer, Chunks, Error, MAX_MESSAGE, Role, TaskId, Tls};
use prost::Message;
use tokio::sync::oneshot;
use tonic::{Status, Streaming};

use crate::Progress;
use crate::state::Fault;

/// All that an attempt needs.
pub(crate) struct Attempt {
    pub task: TaskId,
    pub worker: String,
    pub address: String,
    pub plan: Arc<Plan>,
    pub extent: Extent,
    pub overlap_rows: u32,
    /// Positions of the job that have arrived so far.
    pub arrived: Arc<AtomicU64>,
    /// Those of them that were inserted, which `arrived` does not count.
    pub inserted: Arc<AtomicU64>,
    pub progress: Progress,
    pub tls: Option<Tls>,
}

/// A task, delivered.
pub(crate) struct Delivery {
    pub positions: SubTrajectory,
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
    let mut received = SubTrajectory {
        first: attempt.extent.first,
        ..SubTrajectory::default()
    };
    let call = call(&attempt, &mut received);
    let outcome = tokio::select! {
        outcome = call => outcome,
        reason = cut_off => Err(Fault::Lost(reason.unwrap_or("the job is over".to_owned()))),
    };
    match outcome {
        Ok(record) => Ok(Delivery {
            positions: received,
            record,
        }),
        Err(fault) => {
            let positions_received = received.touches.len() as u64;
            attempt
                .arrived
                .fetch_sub(positions_received, Ordering::Relaxed);
            // Beyond what there is memory for the job is over, and the driver has to see it.
            let all = attempt.inserted.load(Ordering::Relaxed);
            if attempt.plan.check_inserted(all).is_ok() {
                let inserted = received.between.len() as u64;
                attempt.inserted.fetch_sub(inserted, Ordering::Relaxed);
            }
            Err(Undelivered {
                fault,
                positions_received,
            })
        }
    }
}

async fn call(attempt: &Attempt, received: &mut SubTrajectory) -> Result<ExtentRecord, Fault> {
    let begin = Instant::now();
    let tls = attempt.tls.as_ref();
    let lost = |e: tonic::transport::Error| lost(&e);
    let endpoint = transport::endpoint(&attempt.address).map_err(lost)?;
    let channel = transport::connect(&endpoint, Role::Worker, tls)
        .await
        .map_err(lost)?;
    let mut client = WorkerClient::new(channel)
        .max_decoding_message_size(MAX_MESSAGE)
        .max_encoding_message_size(MAX_MESSAGE);
    let sent = Arc::new(AtomicU64::new(0));
    let replies = client.digitize(requests(attempt, sent.clone())).await;
    let mut replies = replies.map_err(|s| fault(&s))?.into_inner();
    let (finished, bytes_received) = receive(attempt, received, &mut replies).await?;
    let counters = finished.counters.unwrap_or_default();
    Ok(ExtentRecord {
        extent: attempt.task.extent,
        attempt: attempt.task.attempt,
        worker: attempt.worker.clone(),
        first: attempt.extent.first,
        positions: attempt.extent.count,
        rows: attempt.extent.rows.len() as u32,
        overlap_rows: attempt.overlap_rows,
        bytes_sent: sent.load(Ordering::Relaxed),
        bytes_received,
        seconds: begin.elapsed().as_secs_f64(),
        build_seconds: finished.build_seconds,
        digitize_seconds: finished.digitize_seconds,
        counters: horma_proto::counters_from_wire(counters),
    })
}

/// The task and its rows, packed as they are sent.
fn requests(
    attempt: &Attempt,
    sent: Arc<AtomicU64>,
) -> impl tokio_stream::Stream<Item = DigitizeRequest> + Send + 'static {
    let task = wire::Task {
        id: Some(attempt.task.into()),
        job: Some(horma_proto::job_to_wire(&attempt.plan.job)),
        trajectory: Some(horma_proto::trajectory_to_wire(&attempt.plan.trajectory)),
        first: attempt.extent.first,
        count: attempt.extent.count,
        rows: attempt.extent.rows.len() as u32,
    };
    let (plan, rows) = (attempt.plan.clone(), attempt.extent.rows.clone());
    let rows = rows
        .into_iter()
        .map(move |id| horma_proto::row_to_wire(&plan.model.rows[id as usize]));
    let chunks = Chunks::of(rows).map(Request::Rows);
    let requests = std::iter::once(Request::Task(task)).chain(chunks);
    tokio_stream::iter(requests.map(move |kind| {
        let request = DigitizeRequest { kind: Some(kind) };
        sent.fetch_add(request.encoded_len() as u64, Ordering::Relaxed);
        request
    }))
}

/// Takes the positions in; every one must come once, in order, for this very task.
async fn receive(
    attempt: &Attempt,
    received: &mut SubTrajectory,
    replies: &mut Streaming<DigitizeReply>,
) -> Result<(wire::Finished, u64), Fault> {
    let wrong = |error: Error| Fault::Wrong(error.to_string());
    let total = attempt.plan.trajectory.positions;
    let mut bytes = 0;
    while let Some(reply) = replies.message().await.map_err(|s| fault(&s))? {
        bytes += reply.encoded_len() as u64;
        let id: TaskId = reply.id.try_into().map_err(wrong)?;
        if id != attempt.task {
            return Err(Fault::Wrong(format!("it speaks of {id}")));
        }
        let next = received.first + received.touches.len() as u64;
        let left = attempt.extent.first + attempt.extent.count - next;
        match reply.kind {
            Some(Reply::Positions(positions)) => {
                let run = horma_proto::unpack_positions(&positions, total).map_err(wrong)?;
                let count = run.touches.len() as u64;
                if run.first != next || count > left {
                    return Err(Fault::Wrong(format!(
                        "it sent positions {} to {} where position {next} was next and {left} were left",
                        run.first,
                        run.end(),
                    )));
                }
                receive_inserted(attempt, received, run.between)?;
                received.touches.extend(run.touches);
                let arrived = attempt.arrived.fetch_add(count, Ordering::Relaxed) + count;
                (attempt.progress)("digitize", arrived, total);
            }
            Some(Reply::Finished(finished)) if left == 0 => {
                let seconds = finished.build_seconds + finished.digitize_seconds;
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
            None => return Err(Fault::Wrong("it sent an empty reply".to_owned())),
        }
    }
    Err(Fault::Lost("it ended its answer early".to_owned()))
}

/// Takes in what was inserted, if that was asked for and there is memory for it.
fn receive_inserted(
    attempt: &Attempt,
    received: &mut SubTrajectory,
    between: Vec<Inserted>,
) -> Result<(), Fault> {
    if attempt.plan.job.motion.path_tolerance.is_none() && !between.is_empty() {
        let why = "it inserted positions that nobody asked for";
        return Err(Fault::Wrong(why.to_owned()));
    }
    let count = between.len() as u64;
    let all = attempt.inserted.fetch_add(count, Ordering::Relaxed) + count;
    received.between.extend(between);
    let fits = attempt.plan.check_inserted(all);
    fits.map_err(|e| Fault::Lost(e.to_string()))
}

/// What a status says of the worker. Only an answer about the content is the worker's fault; a
/// partition may show as almost anything else.
fn fault(status: &Status) -> Fault {
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
