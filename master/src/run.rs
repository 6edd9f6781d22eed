//! A handle to a running master, and a job from its plan to its path.

use std::sync::Arc;
use std::time::{Duration, Instant};

use horma_core::{Handout, Job, Part, Phase, Record, Sharing, SubTrajectory, stitch};
use horma_proto::metrics::JOB_SECONDS;
use horma_proto::trace;
use tokio::sync::{mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;
use tracing::field::Empty;
use tracing::{Span, info_span};

use crate::driver::{self, Message};
use crate::error::{Error, Result};
use crate::history::Happening;
use crate::journal::Resumed;
use crate::snapshot::Snapshot;
use crate::{Config, Outcome, Progress, blocking};

/// A handle to a running master.
#[derive(Debug, Clone)]
pub struct Master {
    inbox: mpsc::Sender<Message>,
    workers: watch::Receiver<usize>,
    config: Config,
    /// New each time a master starts: it counts its jobs anew.
    pub(crate) incarnation: u64,
    /// Cancelled when the master is about to stop.
    pub(crate) draining: CancellationToken,
}

/// A job with its plan.
pub(crate) struct Planned {
    pub plan: Arc<Handout>,
    took: Duration,
}

/// A job that workers are at.
pub(crate) struct Running {
    planned: Planned,
    progress: Progress,
    begin: Instant,
    outcome: oneshot::Receiver<Result<(Vec<SubTrajectory>, Record)>>,
}

impl Master {
    pub(crate) fn start(config: Config, shutdown: CancellationToken) -> Self {
        let (inbox, workers, incarnation) = driver::start(config.clone(), shutdown);
        Self {
            inbox,
            workers,
            config,
            incarnation,
            draining: CancellationToken::new(),
        }
    }

    /// Takes nothing in and begins nothing from now on; returns when what workers are at is done, or
    /// after so long.
    pub async fn drain(&self, within: Duration) {
        self.draining.cancel();
        let (reply, drained) = oneshot::channel();
        let draining = async {
            if self.tell(Message::Drain { reply }).await.is_ok() {
                // A driver that has stopped has nothing to wait for.
                let _ = drained.await;
            }
        };
        let _ = tokio::time::timeout(within, draining).await;
    }

    /// Number of workers, as it changes.
    pub fn workers(&self) -> watch::Receiver<usize> {
        self.workers.clone()
    }

    /// Memory for all jobs, bytes, and whether workers share it.
    pub(crate) fn memory(&self) -> (u64, bool) {
        (self.config.memory, self.config.workers_here)
    }

    /// Runs a job on the workers there are, after waiting for `at_least` of them to register, or for
    /// as long as the master's patience lasts.
    /// Dropping the future cancels the job.
    ///
    /// # Errors
    /// [`Error::Plan`] if the job cannot be done at all, [`Error::NoWorkers`] if nobody comes in
    /// time, and whatever made it fail on the cluster.
    pub async fn run(
        &self,
        part: Arc<Part>,
        job: Job,
        sharing: Sharing,
        at_least: usize,
        progress: Progress,
    ) -> Result<Outcome> {
        let run = async {
            progress("discretize", 0, 0);
            let memory = self.config.memory;
            let planned = self.plan(part, job, sharing, memory).await?;
            let workers = self.gather(at_least.max(1)).await?;
            let running = self.begin(planned, workers, None, progress).await?;
            running.end().await
        };
        trace::within(info_span!("job", job = Empty), run).await
    }

    /// Plans a job that may take so much memory, on a thread of its own: discretizing a part is work.
    pub(crate) async fn plan(
        &self,
        part: Arc<Part>,
        job: Job,
        sharing: Sharing,
        memory: u64,
    ) -> Result<Planned> {
        let begin = Instant::now();
        let here = self.config.workers_here;
        let plan = move || Handout::new(&part, job, sharing, memory, here).map_err(Error::Plan);
        Ok(Planned {
            plan: Arc::new(trace::within(info_span!("discretize"), blocking(plan)).await?),
            took: begin.elapsed(),
        })
    }

    /// Waits until enough workers are there; returns how many.
    pub(crate) async fn gather(&self, at_least: usize) -> Result<u32> {
        let mut workers = self.workers.clone();
        let enough = workers.wait_for(|&n| n >= at_least);
        match tokio::time::timeout(self.config.patience, enough).await {
            Ok(Ok(count)) => Ok(*count as u32),
            Ok(Err(_)) => Err(Error::Interrupted),
            // Those who came can do it.
            Err(_) if *self.workers.borrow() > 0 => Ok(*self.workers.borrow() as u32),
            Err(_) => Err(Error::NoWorkers {
                seconds: self.config.patience.as_secs(),
            }),
        }
    }

    /// Gives a job to the workers, split for so many of them; some of it may be there already. What they
    /// do for it is done for the current span. Dropping what this returns cancels it.
    pub(crate) async fn begin(
        &self,
        planned: Planned,
        workers: u32,
        resumed: Option<Resumed>,
        progress: Progress,
    ) -> Result<Running> {
        let (reply, outcome) = oneshot::channel();
        let message = Message::Run {
            plan: planned.plan.clone(),
            workers,
            resumed,
            progress: progress.clone(),
            span: Span::current(),
            reply,
        };
        self.tell(message).await?;
        Ok(Running {
            planned,
            progress,
            begin: Instant::now(),
            outcome,
        })
    }

    /// What goes on, and what has happened since the event of that number.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the master has stopped.
    pub async fn look(&self, since: u64) -> Result<(Snapshot, Vec<Happening>)> {
        let (reply, seen) = oneshot::channel();
        self.tell(Message::Look { since, reply }).await?;
        seen.await.map_err(|_| Error::Interrupted)
    }

    pub(crate) async fn tell(&self, message: Message) -> Result<()> {
        self.inbox
            .send(message)
            .await
            .map_err(|_| Error::Interrupted)
    }
}

impl Running {
    /// Waits for the workers, and stitches the path.
    pub async fn end(self) -> Result<Outcome> {
        let outcome = self.outcome.await;
        let (parts, mut record) = outcome.map_err(|_| Error::Interrupted)??;
        let digitized = self.begin.elapsed();
        (self.progress)("stitch", 0, 0);
        let begin = Instant::now();
        let plan = self.planned.plan;
        let path = info_span!("stitch").in_scope(|| stitch(plan.trajectory, parts));
        let path = path.map_err(Error::Stitch)?;
        let stitched = begin.elapsed();
        record.phases = [
            ("discretize", self.planned.took),
            ("digitize", digitized),
            ("stitch", stitched),
        ]
        .map(|(name, time)| {
            let seconds = time.as_secs_f64();
            JOB_SECONDS.record(name, seconds);
            let name = name.to_owned();
            Phase { name, seconds }
        })
        .into();
        record.bodies.clone_from(&plan.bodies);
        Ok((path, record))
    }
}
