//! One task: its rows, however they come here, and its positions, run by run.

use std::sync::Arc;
use std::time::Instant;

use horma_core::{Digitizer, Row, Simd};
use horma_proto::metrics::{DIGITIZED, EVALUATIONS, NODES, TASK_SECONDS, TASKS};
use horma_proto::wire::digitize_reply::Kind as Reply;
use horma_proto::wire::{self, DigitizeReply, HaloLost, Run, Span};
use horma_proto::{Error, TaskId, Tls};
use rayon::ThreadPool;
use tokio::sync::mpsc::Sender;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tonic::Status;
use tracing::{Instrument, debug, info, info_span};

use crate::halo::{Fetched, Lost, fetch_all, some_of};
use crate::receive::{Supply, Task};
use crate::store::Store;

/// What a worker digitizes with.
#[derive(Clone)]
pub(crate) struct Means {
    pub pool: Arc<ThreadPool>,
    pub simd: Simd,
    pub store: Arc<Store>,
    pub tls: Option<Tls>,
    pub shutdown: CancellationToken,
}

/// Where a task's answer goes.
pub(crate) type Replies = Sender<Result<DigitizeReply, Status>>;

/// Why a task comes to nothing.
enum Failure {
    /// Nobody listens any more.
    Abandoned,
    Halo(Lost),
    Status(Status),
}

impl<E: Into<Status>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Status(error.into())
    }
}

/// Digitizes a task and sends each chunk as soon as it is there. Stops when the master no longer
/// listens.
pub(crate) async fn work(task: Task, means: Means, replies: Replies) {
    let id = task.id;
    TASKS.change("", 1.0);
    let done = tokio::select! {
        done = digitize(task, &means, &replies) => done,
        // Dropping the work drops what it waits for; what computes notices by itself.
        () = replies.closed() => Err(Failure::Abandoned),
        () = means.shutdown.cancelled() => Err(Failure::Abandoned),
    };
    TASKS.change("", -1.0);
    let last = match done {
        Ok(finished) => {
            count(&finished);
            Ok(Reply::Finished(finished))
        }
        Err(Failure::Abandoned) if means.shutdown.is_cancelled() => {
            // Nobody may be left to hear it; either way the extent goes to another worker.
            Err(Error::ShuttingDown("this worker").into())
        }
        Err(Failure::Abandoned) => {
            info!(%id, "abandoned by the master");
            return;
        }
        Err(Failure::Halo(Lost { source, reason })) => {
            info!(%id, %source, reason, "halo lost");
            let source = Some(source.into());
            Ok(Reply::HaloLost(HaloLost { source, reason }))
        }
        Err(Failure::Status(status)) => Err(status),
    };
    if replies.send(last.map(|kind| reply(id, kind))).await.is_ok() {
        debug!(%id, "finished");
    }
}

/// Tells those who watch where the time of a task went.
fn count(finished: &wire::Finished) {
    for (phase, seconds) in [
        ("receive", finished.receive_seconds),
        ("make", finished.make_seconds),
        ("halo", finished.halo_seconds),
        ("build", finished.build_seconds),
        ("digitize", finished.digitize_seconds),
    ] {
        TASK_SECONDS.record(phase, seconds);
    }
}

fn reply(id: TaskId, kind: Reply) -> DigitizeReply {
    DigitizeReply {
        id: Some(id.into()),
        kind: Some(kind),
        counters: None,
    }
}

async fn digitize(task: Task, means: &Means, replies: &Replies) -> Result<wire::Finished, Failure> {
    let mut finished = wire::Finished {
        receive_seconds: task.receive_seconds,
        ..wire::Finished::default()
    };
    let begin = Instant::now();
    let (mut rows, mut halo) = at_hand(task.supply, task.id, means).await?;
    finished.make_seconds = begin.elapsed().as_secs_f64();
    for run in task.runs {
        if let Some(mut coming) = halo.take_if(|_| !all_there(&rows, &run.rows)) {
            let begin = Instant::now();
            let fetched = (&mut coming.rows).await.map_err(|_| Failure::Abandoned)?;
            let fetched = fetched.map_err(Failure::Halo)?;
            finished.halo_seconds += begin.elapsed().as_secs_f64();
            finished.halo_bytes = fetched.bytes;
            rows = Arc::new(merged(&rows, fetched.rows)?);
        }
        if !all_there(&rows, &run.rows) {
            let expected = horma_proto::spanned(&run.rows);
            let found = some_of(&rows, &run.rows).count() as u64;
            let what = "rows of a run";
            let error = Error::Incomplete {
                what,
                expected,
                found,
            };
            return Err(error.into());
        }
        let job = Digitizing {
            id: task.id,
            job: task.job,
            trajectory: task.trajectory,
            run,
            rows: rows.clone(),
            simd: means.simd,
            replies: replies.clone(),
            shutdown: means.shutdown.clone(),
        };
        let pool = means.pool.clone();
        let span = info_span!("digitize", first = job.run.first, count = job.run.count);
        let run = move || span.in_scope(|| pool.install(|| job.run()));
        let done = tokio::task::spawn_blocking(run).await;
        let done = done.map_err(|_| Status::internal("digitizing panicked"))?;
        let cost = done.ok_or(Failure::Abandoned)?;
        finished.build_seconds += cost.build_seconds;
        finished.digitize_seconds += cost.digitize_seconds;
    }
    Ok(finished)
}

/// Rows of others on their way; dropping it gives them up.
struct Coming {
    rows: JoinHandle<Result<Fetched, Lost>>,
}

impl Drop for Coming {
    fn drop(&mut self) {
        self.rows.abort();
    }
}

/// The rows that are here at once, and those that are fetched meanwhile.
async fn at_hand(
    supply: Supply,
    id: TaskId,
    means: &Means,
) -> Result<(Arc<Vec<Row>>, Option<Coming>), Failure> {
    match supply {
        Supply::Rows(rows) => Ok((Arc::new(rows), None)),
        Supply::Grids(grids) => {
            let span = info_span!("make rows");
            let make = move || {
                let mut rows: Vec<Row> = Vec::new();
                for grid in &grids {
                    grid.rows(&mut |row| rows.push(row));
                }
                rows
            };
            let made = tokio::task::spawn_blocking(move || span.in_scope(make)).await;
            let rows = made.map_err(|_| Status::internal("making rows panicked"))?;
            debug!(%id, rows = rows.len(), "rows made");
            if let Some(pair) = rows.windows(2).find(|pair| pair[0].id >= pair[1].id) {
                let why = format!("row {} comes out of order", pair[1].id);
                return Err(Error::Malformed(why).into());
            }
            Ok((Arc::new(rows), None))
        }
        Supply::Held { own, halo } => {
            let rows = means.store.get(own).ok_or(Error::NotHeld { id: own })?;
            let fetching = fetch_all(halo, means.store.clone(), means.tls.clone());
            let coming = Coming {
                rows: tokio::spawn(fetching.in_current_span()),
            };
            Ok((rows, Some(coming)))
        }
    }
}

/// Whether every row in the spans is there.
fn all_there(rows: &[Row], spans: &[Span]) -> bool {
    some_of(rows, spans).count() as u64 == horma_proto::spanned(spans)
}

/// Rows of two lists, none in both, in order.
fn merged(own: &[Row], others: Vec<Row>) -> Result<Vec<Row>, Error> {
    let mut rows = others;
    rows.extend_from_slice(own);
    rows.sort_by_key(|row| row.id);
    for pair in rows.windows(2) {
        if pair[0].id == pair[1].id {
            let why = format!("row {} comes twice", pair[0].id);
            return Err(Error::Malformed(why));
        }
        pair[0].validate_next(&pair[1]).map_err(Error::Core)?;
    }
    Ok(rows)
}

/// A run that has all of its rows.
struct Digitizing {
    id: TaskId,
    job: horma_core::Job,
    trajectory: horma_core::Trajectory,
    run: Run,
    rows: Arc<Vec<Row>>,
    simd: Simd,
    replies: Replies,
    shutdown: CancellationToken,
}

/// What a run took.
struct Cost {
    build_seconds: f64,
    digitize_seconds: f64,
}

impl Digitizing {
    /// Digitizes on the current thread pool; nothing if nobody listens any more.
    fn run(self) -> Option<Cost> {
        let (id, run) = (self.id, &self.run);
        let begin = Instant::now();
        let digitizer = if horma_proto::spanned(&run.rows) == self.rows.len() as u64 {
            Digitizer::new(&self.job, &self.rows, self.simd)
        } else {
            let rows: Vec<Row> = some_of(&self.rows, &run.rows).cloned().collect();
            Digitizer::new(&self.job, &rows, self.simd)
        };
        let build_seconds = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let mut abandoned = false;
        let positions = run.first..run.first + run.count;
        digitizer.run_chunks(&self.trajectory, positions, |run, cost| {
            let (first, count) = (run.first, run.touches.len());
            DIGITIZED.add("", count as u64);
            EVALUATIONS.add("", cost.evaluations);
            NODES.add("", cost.nodes);
            debug!(%id, first, count, between = run.between.len(), "positions");
            let mut messages = horma_proto::position_chunks(first, &run.touches, &run.between);
            // The first message of a chunk has what all of it cost.
            let mut cost = Some(horma_proto::counters_to_wire(cost));
            let sent = messages.all(|m| {
                let mut message = reply(id, Reply::Positions(m));
                message.counters = cost.take();
                !self.shutdown.is_cancelled() && self.replies.blocking_send(Ok(message)).is_ok()
            });
            abandoned = !sent;
            sent
        });
        (!abandoned).then(|| Cost {
            build_seconds,
            digitize_seconds: begin.elapsed().as_secs_f64(),
        })
    }
}
