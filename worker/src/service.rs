//! The worker's service: rows in, positions out.

use std::sync::Arc;
use std::time::Instant;

use horma_core::{Digitizer, Job, Row, Simd, SubTrajectory, Trajectory};
use horma_proto::wire::digitize_reply::Kind as Reply;
use horma_proto::wire::digitize_request::Kind as Request;
use horma_proto::wire::worker_server::Worker;
use horma_proto::wire::{self, DigitizeReply, DigitizeRequest};
use horma_proto::{Error, Guard, Messages, Role, TaskId};
use rayon::ThreadPool;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Response, Status, Streaming};
use tracing::{debug, info};

/// Chunks of positions that may wait for the master to take them.
const WAITING_CHUNKS: usize = 4;

pub(crate) struct Service {
    pool: Arc<ThreadPool>,
    simd: Simd,
    guard: Guard,
    shutdown: CancellationToken,
}

impl Service {
    pub fn new(pool: ThreadPool, simd: Simd, guard: Guard, shutdown: CancellationToken) -> Self {
        let pool = Arc::new(pool);
        Self {
            pool,
            simd,
            guard,
            shutdown,
        }
    }
}

#[tonic::async_trait]
impl Worker for Service {
    type DigitizeStream = ReceiverStream<Result<DigitizeReply, Status>>;

    async fn digitize(
        &self,
        request: tonic::Request<Streaming<DigitizeRequest>>,
    ) -> Result<Response<Self::DigitizeStream>, Status> {
        self.guard.admit(&request, Role::Master)?;
        let task = receive(request.into_inner()).await?;
        info!(id = %task.id, first = task.first, count = task.count, rows = task.rows.len(), "task");
        let (replies, stream) = mpsc::channel(WAITING_CHUNKS);
        let (pool, simd, shutdown) = (self.pool.clone(), self.simd, self.shutdown.clone());
        tokio::task::spawn_blocking(move || {
            pool.install(|| digitize(&task, simd, &replies, &shutdown));
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

/// A task with everything it needs.
struct Task {
    id: TaskId,
    job: Job,
    trajectory: Trajectory,
    first: u64,
    count: u64,
    rows: Vec<Row>,
}

/// Receives a task and its rows, and checks that they are what was announced.
async fn receive(mut requests: Streaming<DigitizeRequest>) -> Result<Task, Status> {
    let mut task: Option<Task> = None;
    let mut announced = 0;
    let mut messages = Messages::default();
    while let Some(request) = requests.message().await? {
        match (request.kind, &mut task) {
            (Some(Request::Task(header)), None) => {
                announced = u64::from(header.rows);
                task = Some(header_from_wire(header)?);
            }
            (Some(Request::Rows(chunk)), Some(task)) => {
                messages.push(&chunk)?;
                while let Some(row) = messages.pop::<wire::Row>()? {
                    let row = horma_proto::row_from_wire(&row)?;
                    if let Some(last) = task.rows.last() {
                        if last.id >= row.id {
                            let why = format!("row {} comes out of order", row.id);
                            return Err(Error::Malformed(why).into());
                        }
                        last.validate_next(&row).map_err(Error::Core)?;
                    }
                    task.rows.push(row);
                }
            }
            _ => {
                let why = "a task begins with its header, once".to_owned();
                return Err(Error::Malformed(why).into());
            }
        }
    }
    let task = task.ok_or(Error::Missing {
        message: "task",
        field: "a header",
    })?;
    let found = task.rows.len() as u64;
    if found != announced || !messages.is_empty() {
        let (what, expected) = ("rows of a task", announced);
        return Err(Error::Incomplete {
            what,
            expected,
            found,
        }
        .into());
    }
    Ok(task)
}

fn header_from_wire(header: wire::Task) -> horma_proto::Result<Task> {
    let job = header.job.ok_or(Error::Missing {
        message: "task",
        field: "a job",
    })?;
    let trajectory = horma_proto::trajectory_from_wire(header.trajectory.as_ref())?;
    let end = header.first.checked_add(header.count);
    if end.is_none_or(|end| end > trajectory.positions) {
        return Err(Error::Incomplete {
            what: "positions of a task",
            expected: trajectory.positions,
            found: end.unwrap_or(u64::MAX),
        });
    }
    Ok(Task {
        id: header.id.try_into()?,
        job: horma_proto::job_from_wire(&job)?,
        trajectory,
        first: header.first,
        count: header.count,
        rows: Vec::new(),
    })
}

/// Digitizes a task on the current thread pool and sends each chunk as soon as it is there. Stops
/// when the master no longer listens.
fn digitize(
    task: &Task,
    simd: Simd,
    replies: &mpsc::Sender<Result<DigitizeReply, Status>>,
    shutdown: &CancellationToken,
) {
    let send = |kind| {
        let id = Some(task.id.into());
        let kind = Some(kind);
        replies
            .blocking_send(Ok(DigitizeReply { id, kind }))
            .is_ok()
    };
    let begin = Instant::now();
    let digitizer = Digitizer::new(&task.job, &task.rows, simd);
    let build_seconds = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let positions = task.first..task.first + task.count;
    let counters = digitizer.run_chunks(&task.trajectory, positions, |run| {
        let SubTrajectory {
            first,
            touches,
            between,
        } = run;
        debug!(id = %task.id, first, count = touches.len(), between = between.len(), "positions");
        let mut messages = horma_proto::position_chunks(first, &touches, &between);
        messages.all(|m| !shutdown.is_cancelled() && send(Reply::Positions(m)))
    });
    if shutdown.is_cancelled() {
        // Nobody may be left to hear it; either way the extent goes to another worker.
        let status = Error::ShuttingDown("this worker").into();
        let _ = replies.blocking_send(Err(status));
        return;
    }
    let finished = wire::Finished {
        counters: Some(horma_proto::counters_to_wire(counters)),
        build_seconds,
        digitize_seconds: begin.elapsed().as_secs_f64(),
    };
    if send(Reply::Finished(finished)) {
        debug!(id = %task.id, "finished");
    } else {
        info!(id = %task.id, "abandoned by the master");
    }
}
