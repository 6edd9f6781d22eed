//! The driver: one task that owns the state, turns messages into events, and carries out commands.
//!
//! Positions never pass through the state. They wait here, by job and extent, until the job is
//! complete and can be stitched.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use horma_core::{ExtentRecord, Handout};
use horma_proto::TaskId;
use horma_proto::clock::incarnation;
use horma_proto::trace;
use tokio::sync::{mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;
use tracing::{Span, info, info_span, warn};

use crate::dispatch::{Undelivered, dispatch};
use crate::error::Error;
use crate::history::{Happening, History};
use crate::journal::Resumed;
use crate::place::{Placed, place};
use crate::running::{Reply, RunningJob};
use crate::snapshot::{self, JobState, Snapshot, snapshot};
use crate::state::{Command, Event, Fault, Held, State, Step, apply};
use crate::{Config, Progress};

/// Messages that may wait for the driver.
const INBOX: usize = 256;

/// How often it looks who is silent, who is late, and who has hung up.
const TICK: Duration = Duration::from_millis(250);

/// The jobs that are going on, and the number of the next one.
pub(crate) struct Going {
    pub jobs: Vec<u64>,
    pub next_job: u64,
}

/// What the driver is told.
pub(crate) enum Message {
    Register {
        worker: String,
        incarnation: u64,
        address: String,
        /// Whether it is welcome.
        reply: oneshot::Sender<bool>,
    },
    Heartbeat {
        worker: String,
        incarnation: u64,
        /// What is going on, if it is known.
        reply: oneshot::Sender<Option<Going>>,
    },
    /// Somebody wants to see what goes on, and what has happened since.
    Look {
        since: u64,
        reply: oneshot::Sender<(Snapshot, Vec<Happening>)>,
    },
    /// A worker is about to stop.
    Leave {
        worker: String,
        incarnation: u64,
        reply: oneshot::Sender<()>,
    },
    /// The master is about to: it answers when everybody is through with what was begun.
    Drain { reply: oneshot::Sender<()> },
    Run {
        plan: Arc<Handout>,
        workers: u32,
        /// What there is of it already, if it has a journal.
        resumed: Option<Resumed>,
        progress: Progress,
        /// What is done for it is a child of this.
        span: Span,
        reply: Reply,
    },
    Over {
        worker: String,
        task: TaskId,
        outcome: Result<ExtentRecord, Undelivered>,
    },
    /// Rows are placed, or not.
    Placed {
        worker: String,
        task: TaskId,
        outcome: Result<Placed, Fault>,
    },
}

/// Starts a driver, until the shutdown; returns where it is told things, the number of workers as it
/// changes, and which start of a master this is.
pub(crate) fn start(
    config: Config,
    shutdown: CancellationToken,
) -> (mpsc::Sender<Message>, watch::Receiver<usize>, u64) {
    let (inbox, messages) = mpsc::channel(INBOX);
    let (count, workers) = watch::channel(0);
    let incarnation = incarnation();
    let driver = Driver {
        begin: Instant::now(),
        state: State::new(config.lease, config.regroup),
        config,
        addresses: BTreeMap::new(),
        jobs: BTreeMap::new(),
        next_job: 1,
        incarnation,
        drained: None,
        inbox: inbox.downgrade(),
        count,
        history: History::default(),
    };
    tokio::spawn(driver.run(messages, shutdown));
    (inbox, workers, incarnation)
}

struct Driver {
    config: Config,
    begin: Instant,
    state: State,
    addresses: BTreeMap<String, String>,
    jobs: BTreeMap<u64, RunningJob>,
    next_job: u64,
    incarnation: u64,
    /// Who waits for the end of what was begun.
    drained: Option<oneshot::Sender<()>>,
    inbox: mpsc::WeakSender<Message>,
    count: watch::Sender<usize>,
    history: History,
}

impl Driver {
    async fn run(mut self, mut messages: mpsc::Receiver<Message>, shutdown: CancellationToken) {
        let mut ticks = tokio::time::interval(TICK.min(self.config.heartbeat / 2));
        loop {
            // Messages before ticks: a heartbeat that waits must not be taken for silence.
            tokio::select! {
                biased;
                () = shutdown.cancelled() => break,
                message = messages.recv() => match message {
                    Some(message) => self.handle(message),
                    None => break,
                },
                _ = ticks.tick() => self.tick(),
            }
            if let Some(drained) = self.drained.take_if(|_| self.state.is_idle()) {
                let _ = drained.send(());
            }
            self.count.send_if_modified(|n| {
                let now = self.state.workers();
                std::mem::replace(n, now) != now
            });
        }
        for job in self.jobs.into_values() {
            // The one who asked may be gone as well.
            let _ = job.reply.send(Err(Error::Interrupted));
        }
    }

    fn tick(&mut self) {
        let far = self.jobs.values().flat_map(RunningJob::progress);
        for (worker, task, came, left) in far.collect::<Vec<_>>() {
            self.apply(
                Event::Progress {
                    worker,
                    task,
                    came,
                    left,
                },
                None,
            );
        }
        self.apply(Event::Tick, None);
        // A client that no longer waits has cancelled its job.
        let gone = |(&id, job): (&u64, &RunningJob)| job.reply.is_closed().then_some(id);
        for job in self.jobs.iter().filter_map(gone).collect::<Vec<_>>() {
            info!(job, "cancelled");
            self.apply(Event::Cancelled { job }, None);
            self.end(job, JobState::Cancelled, None);
        }
    }

    fn handle(&mut self, message: Message) {
        match message {
            Message::Register {
                worker,
                incarnation,
                address,
                reply,
            } => {
                let welcome = !self.state.distrusts(&worker, incarnation);
                if welcome {
                    info!(worker, incarnation, address, "registered");
                    self.addresses.insert(worker.clone(), address);
                    self.apply(
                        Event::Registered {
                            worker,
                            incarnation,
                        },
                        None,
                    );
                }
                // A worker that hangs up meanwhile will register again.
                let _ = reply.send(welcome);
            }
            Message::Heartbeat {
                worker,
                incarnation,
                reply,
            } => {
                let known = self.state.knows(&worker, incarnation);
                if known {
                    self.apply(Event::Heartbeat { worker }, None);
                }
                let going = known.then(|| Going {
                    jobs: self.state.jobs().collect(),
                    next_job: self.next_job,
                });
                let _ = reply.send(going);
            }
            Message::Look { since, reply } => {
                let now = self.begin.elapsed();
                let seen = snapshot(&self.state, &self.jobs, &self.addresses, &self.history, now);
                let happened = self.history.since(since).cloned().collect();
                // Whoever wanted to see it may have gone.
                let _ = reply.send((seen, happened));
            }
            Message::Leave {
                worker,
                incarnation,
                reply,
            } => {
                if self.state.knows(&worker, incarnation) {
                    info!(worker, "left");
                    self.apply(Event::Left { worker }, None);
                }
                let _ = reply.send(());
            }
            Message::Drain { reply } => {
                info!("draining");
                self.drained = Some(reply);
                self.apply(Event::Drain, None);
            }
            Message::Run {
                plan,
                workers,
                resumed,
                progress,
                span,
                reply,
            } => {
                // A job that is kept has its number already; such jobs begin in their order.
                let number = resumed.as_ref().map(|r| r.journal.job);
                let job = number.unwrap_or(self.next_job);
                self.next_job = self.next_job.max(job) + 1;
                let running = RunningJob::new(plan, workers, resumed, progress, span, reply);
                let (extents, halos) = (running.extents.len() as u32, running.halos());
                let done = running.kept.keys().copied().collect();
                let positions = running.plan.trajectory.positions;
                running.span.record("job", job);
                info!(job, extents, positions, "job");
                running.tell_progress();
                self.jobs.insert(job, running);
                let submitted = Event::Submitted {
                    job,
                    extents,
                    halos,
                    done,
                };
                self.apply(submitted, None);
            }
            Message::Over {
                worker,
                task,
                outcome,
            } => self.over(worker, task, outcome),
            Message::Placed {
                worker,
                task,
                outcome,
            } => self.placed(worker, task, outcome),
        }
    }

    /// Rows are placed, or not.
    fn placed(&mut self, worker: String, task: TaskId, outcome: Result<Placed, Fault>) {
        let Some(job) = self.jobs.get_mut(&task.job) else {
            return;
        };
        job.calls.remove(&task);
        match outcome {
            Ok(placed) => {
                info!(%task, worker, rows = placed.rows, "placed");
                *job.placed.entry(task.extent).or_default() += placed;
                self.apply(Event::Placed { worker, task }, None);
            }
            Err(fault) => {
                warn!(%task, worker, ?fault, "not placed");
                job.lose(&worker, task, &fault, 0);
                let step = Step::Place;
                let failed = Event::Failed {
                    worker,
                    task,
                    step,
                    fault,
                };
                self.apply(failed, None);
            }
        }
    }

    /// A call is over, well or not.
    fn over(&mut self, worker: String, task: TaskId, outcome: Result<ExtentRecord, Undelivered>) {
        let Some(job) = self.jobs.get_mut(&task.job) else {
            return;
        };
        let overtaken = job.kept.contains_key(&task.extent);
        let left = job.left(task.extent);
        let came = job.calls.remove(&task).map(|call| call.came());
        let inserted = job.inserted.load(Ordering::Relaxed);
        if let Err(error) = job.plan.check_inserted(inserted) {
            self.apply(Event::Cancelled { job: task.job }, None);
            self.fail(task.job, Error::Plan(error));
            return;
        }
        match outcome {
            Ok(record) => {
                info!(%task, worker, left, "delivered");
                if let Some(came) = came {
                    let worker = worker.clone();
                    let progress = Event::Progress {
                        worker,
                        task,
                        came,
                        left,
                    };
                    self.apply(progress, None);
                }
                self.apply(Event::Delivered { worker, task, left }, Some(record));
            }
            Err(_) if overtaken => info!(%task, worker, "overtaken"),
            Err(Undelivered {
                fault,
                positions_received,
            }) => {
                warn!(%task, worker, ?fault, positions_received, "not delivered");
                job.lose(&worker, task, &fault, positions_received);
                let step = Step::Digitize;
                let failed = Event::Failed {
                    worker,
                    task,
                    step,
                    fault,
                };
                self.apply(failed, None);
            }
        }
    }

    fn apply(&mut self, event: Event, mut record: Option<ExtentRecord>) {
        self.history.happened(&event);
        let commands = apply(&mut self.state, self.begin.elapsed(), event);
        self.history.decided(&commands);
        for command in commands {
            match command {
                Command::Place { worker, task } => self.place(worker, task),
                Command::Start {
                    worker,
                    task,
                    rows,
                    helps,
                } => self.start(worker, task, rows, helps),
                Command::Abort { task, reason } => {
                    info!(%task, reason, "aborted");
                    let job = self.jobs.get_mut(&task.job);
                    if let Some(call) = job.and_then(|j| j.calls.remove(&task)) {
                        // A call that is over by now needs no telling.
                        let _ = call.cut_off.send(reason);
                    }
                }
                Command::Keep { task } => {
                    if let (Some(job), Some(record)) = (self.jobs.get_mut(&task.job), record.take())
                    {
                        job.keep(task.extent, record);
                    }
                }
                Command::Complete { job } => {
                    if let Some(job) = self.end(job, JobState::Done, None) {
                        job.complete();
                    }
                }
                Command::Fail { job, error } => self.fail(job, error),
            }
        }
    }

    /// Tells whoever waits for a job that it came to nothing.
    fn fail(&mut self, job: u64, error: Error) {
        warn!(job, %error, "failed");
        if let Some(job) = self.end(job, JobState::Failed, Some(error.to_string())) {
            let _ = job.reply.send(Err(error));
        }
    }

    /// Takes a job out that is over, and remembers what became of it.
    fn end(&mut self, job: u64, state: JobState, reason: Option<String>) -> Option<RunningJob> {
        let running = self.jobs.remove(&job)?;
        self.history
            .end(snapshot::ended(job, &running, state, reason));
        Some(running)
    }

    /// Brings an extent's own rows to a worker, in the background.
    fn place(&mut self, worker: String, task: TaskId) {
        let (Some(job), Some(address)) =
            (self.jobs.get_mut(&task.job), self.addresses.get(&worker))
        else {
            return;
        };
        let cut_off = job.call(task, &worker, address);
        let placing = job.placing(task, address, self.incarnation, self.config.tls.clone());
        let rows = placing.rows.len();
        info!(%task, worker, rows, "placing");
        let span =
            info_span!(parent: &job.span, "place", otel.kind = "client", %task, worker, rows);
        self.report_when_over(async move {
            Message::Placed {
                worker,
                task,
                outcome: trace::within(span, place(placing, cut_off)).await,
            }
        });
    }

    /// Brings a task to a worker, in the background.
    fn start(&mut self, worker: String, task: TaskId, rows: Vec<Held>, helps: Option<String>) {
        let (Some(job), Some(address)) =
            (self.jobs.get_mut(&task.job), self.addresses.get(&worker))
        else {
            return;
        };
        let cut_off = job.call(task, &worker, address);
        let located = |held: Held| {
            let address = self.addresses.get(&held.worker).cloned();
            (held, address.unwrap_or_default())
        };
        let holders = rows.into_iter().map(located).collect();
        let tls = self.config.tls.clone();
        info!(%task, worker, helps, "started");
        let span =
            info_span!(parent: &job.span, "extent", otel.kind = "client", %task, worker, helps);
        let attempt = job.attempt(task, &worker, address, holders, helps, tls);
        self.report_when_over(async move {
            Message::Over {
                worker,
                task,
                outcome: trace::within(span, dispatch(attempt, cut_off)).await,
            }
        });
    }

    /// Has the driver told what comes of a call.
    fn report_when_over(&self, message: impl Future<Output = Message> + Send + 'static) {
        let inbox = self.inbox.clone();
        tokio::spawn(async move {
            let message = message.await;
            if let Some(inbox) = inbox.upgrade() {
                // The driver may have stopped: then nobody waits for this.
                let _ = inbox.send(message).await;
            }
        });
    }
}
