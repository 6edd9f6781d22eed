//! The desk: the jobs of clients, from their submission until nobody is going to ask for their result.
//!
//! It takes jobs in, has them run in the order in which they came, several at once as far as memory
//! goes, and keeps results. What it knows it has from the store, and every change is in the store
//! before anybody hears of it. It knows nothing of workers or extents.

mod rules;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use horma_core::Handout;
use horma_proto::Error as Refusal;
use horma_proto::clock::since_1970;
use horma_proto::metrics::JOBS_ENDED;
use horma_proto::trace;
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore, SemaphorePermit, watch};
use tokio::task::spawn_blocking;
use tokio_util::sync::CancellationToken;
use tonic::Status;
use tracing::{error, info, info_span, warn};

use self::rules::{Expired, Work, expired, next};
use crate::error::{Error, Result};
use crate::journal::Journal;
use crate::store::{Entry, Gone, Stage, Store};
use crate::submission::{self, Submission};
use crate::{Limits, Master, Progress, blocking, result};

/// What a client is told.
type Answer<T> = std::result::Result<T, Refusal>;

/// How often is looked for results that are too old.
const EXPIRY: Duration = Duration::from_secs(10);

/// Parts that come in at once; others wait.
const PARTS: usize = 4;

pub(crate) struct Desk {
    store: Arc<Store>,
    master: Master,
    pub limits: Limits,
    /// One for each open call of a client.
    calls: Arc<Semaphore>,
    /// One for each part that is coming in.
    parts: Semaphore,
    jobs: Mutex<BTreeMap<u64, Known>>,
    /// One for each job that is not over.
    places: Arc<Semaphore>,
    /// Told when something may begin, or has to go.
    changed: Notify,
    shutdown: CancellationToken,
}

/// A job that is known.
struct Known {
    view: watch::Sender<View>,
    work: Work,
    stop: CancellationToken,
    /// Its place among the jobs that are not over.
    place: Option<OwnedSemaphorePermit>,
}

/// What there is to be seen of a job.
#[derive(Debug, Clone)]
pub(crate) struct View {
    pub entry: Entry,
    /// Phase, how much of it is done, and of how much.
    pub progress: (&'static str, u64, u64),
}

impl Desk {
    /// A desk with what is in the store.
    pub fn open(
        store: Store,
        master: Master,
        limits: Limits,
        shutdown: CancellationToken,
    ) -> Result<Arc<Self>> {
        let places = Arc::new(Semaphore::new(limits.queue));
        let known = |(job, entry): (u64, Entry)| {
            // There may be more than there are places: the limit was another one then.
            let place = entry.stage.is_open().then(|| places.clone());
            let place = place.and_then(|places| places.try_acquire_owned().ok());
            (job, Known::new(entry, place))
        };
        let jobs: BTreeMap<u64, Known> = store.jobs()?.into_iter().map(known).collect();
        let open = |known: &&Known| known.view.borrow().entry.stage.is_open();
        info!(
            jobs = jobs.len(),
            open = jobs.values().filter(open).count(),
            "store"
        );
        Ok(Arc::new(Self {
            store: Arc::new(store),
            master,
            calls: Arc::new(Semaphore::new(limits.calls)),
            parts: Semaphore::new(PARTS),
            limits,
            jobs: Mutex::new(jobs),
            places,
            changed: Notify::new(),
            shutdown,
        }))
    }

    /// Has jobs run and results dropped, until the shutdown.
    pub async fn serve(self: Arc<Self>) {
        let mut ticks = tokio::time::interval(EXPIRY);
        loop {
            tokio::select! {
                () = self.shutdown.cancelled() => return,
                () = self.master.draining.cancelled() => return,
                () = self.changed.notified() => {}
                _ = ticks.tick() => {}
            }
            self.expire().await;
            if let Some(job) = self.begin_next() {
                tokio::spawn(self.clone().work(job));
            }
        }
    }

    /// A client's call, for as long as this is held.
    pub fn call(&self) -> Answer<OwnedSemaphorePermit> {
        let call = self.calls.clone().try_acquire_owned();
        call.map_err(|_| {
            let limit = self.limits.calls;
            Refusal::Limit(format!(
                "{limit} calls of clients are open, as many as this master takes (--max-calls); try again later"
            ))
        })
    }

    /// Waits until a part may come in: each is in memory until it is in the store.
    pub async fn part(&self) -> Answer<SemaphorePermit<'_>> {
        let part = self.parts.acquire().await;
        part.map_err(|_| Refusal::ShuttingDown("the master"))
    }

    /// The job that was submitted with this key.
    pub fn find(&self, key: u128) -> Option<u64> {
        let jobs = self.lock();
        let mut jobs = jobs.iter();
        let found = jobs.find(|(_, known)| known.view.borrow().entry.key == key);
        found.map(|(&job, _)| job)
    }

    /// A place for one more job.
    pub fn place(&self) -> Answer<OwnedSemaphorePermit> {
        if self.master.draining.is_cancelled() {
            return Err(Refusal::ShuttingDown("the master"));
        }
        let place = self.places.clone().try_acquire_owned();
        place.map_err(|_| {
            let limit = self.limits.queue;
            Refusal::Limit(format!(
                "{limit} jobs are queued or running, as many as this master takes (--max-jobs); try again when one is done"
            ))
        })
    }

    /// Takes a job in, on its place, to be done for the current span; returns its number.
    pub async fn submit(
        self: &Arc<Self>,
        submission: Submission,
        place: OwnedSemaphorePermit,
    ) -> Answer<u64> {
        let (desk, trace) = (self.clone(), trace::current());
        let taking = spawn_blocking(move || desk.take_in(submission, trace, place));
        let stopping = |_| Refusal::ShuttingDown("the master");
        taking.await.map_err(stopping)?
    }

    fn take_in(
        &self,
        submission: Submission,
        trace: Option<String>,
        place: OwnedSemaphorePermit,
    ) -> Answer<u64> {
        let Submission {
            key,
            name,
            job,
            sharing,
            part,
            pieces,
        } = submission;
        let (memory, here) = self.master.memory();
        let memory = Handout::predict(&part, &job, sharing.distribution, memory, here)?;
        drop(part);
        let entry = Entry {
            key,
            name,
            submitted: since_1970(),
            memory,
            trace,
            stage: Stage::Queued,
        };
        let (job, new) = self.store.submit(&entry, &pieces).map_err(Refusal::from)?;
        if new {
            info!(job, name = entry.name, memory, "submitted");
            self.lock().insert(job, Known::new(entry, Some(place)));
            self.changed.notify_one();
        }
        Ok(job)
    }

    /// The first jobs with greater numbers than `after`, at most so many.
    pub fn status(&self, after: u64, most: usize) -> Vec<(u64, View)> {
        let jobs = self.lock();
        let rest = jobs.range(after.saturating_add(1)..).take(most);
        rest.map(|(&job, known)| (job, known.view.borrow().clone()))
            .collect()
    }

    /// Jobs that are not over, in their order.
    pub fn open_jobs(&self) -> Vec<(u64, Entry)> {
        let jobs = self.lock();
        let entry = |(&job, known): (&u64, &Known)| {
            let view = known.view.borrow();
            let open = view.entry.stage.is_open();
            open.then(|| (job, view.entry.clone()))
        };
        jobs.iter().filter_map(entry).collect()
    }

    /// A job as it goes on.
    pub fn watch(&self, job: u64) -> Answer<watch::Receiver<View>> {
        let jobs = self.lock();
        let known = jobs.get(&job).ok_or_else(|| unknown(job))?;
        Ok(known.view.subscribe())
    }

    /// Ends a job, unless it is over.
    pub async fn cancel(self: &Arc<Self>, job: u64) -> Answer<()> {
        drop(self.watch(job)?);
        let end = move |store: &Store| store.end(job, Stage::Cancelled { at: since_1970() });
        self.change(job, end).await.map_err(Refusal::from)
    }

    /// A piece of a result.
    pub async fn result(&self, job: u64, piece: u32) -> Result<Option<Bytes>> {
        let store = self.store.clone();
        blocking(move || store.result(job, piece)).await
    }

    /// Drops a result that the client has.
    pub async fn discard(self: &Arc<Self>, job: u64) -> Answer<()> {
        drop(self.watch(job)?);
        let discard = move |store: &Store| store.drop_result(job, Gone::Fetched);
        self.change(job, discard).await.map_err(Refusal::from)
    }

    /// Changes a job's stage in the store, and then for all to see.
    async fn change(
        self: &Arc<Self>,
        job: u64,
        how: impl FnOnce(&Store) -> Result<Option<Stage>> + Send + 'static,
    ) -> Result<()> {
        let store = self.store.clone();
        if let Some(stage) = blocking(move || how(&store)).await? {
            self.show(job, stage);
        }
        Ok(())
    }

    /// Shows a stage that the store has.
    fn show(&self, job: u64, stage: Stage) {
        let mut jobs = self.lock();
        let Some(known) = jobs.get_mut(&job) else {
            return;
        };
        if !stage.is_open() {
            known.stop.cancel();
            known.place = None;
        }
        known.view.send_if_modified(|view| {
            // What is over stays so, whoever is late to say that it goes on.
            let over = stage.is_open() && !view.entry.stage.is_open();
            let changed = !over && view.entry.stage != stage;
            if changed {
                info!(job, ?stage, "job");
                count(&stage);
                view.entry.stage = stage;
            }
            changed
        });
        self.changed.notify_one();
    }

    /// The next job that may begin, which is now being planned.
    fn begin_next(&self) -> Option<u64> {
        let mut jobs = self.lock();
        let tell = |(&job, known): (&u64, &Known)| {
            let view = known.view.borrow();
            let entry = &view.entry;
            entry
                .stage
                .is_open()
                .then_some((job, entry.memory, known.work))
        };
        let open: Vec<_> = jobs.iter().filter_map(tell).collect();
        let next = next(&open, self.limits.running, self.master.memory().0)?;
        jobs.get_mut(&next)?.work = Work::Planning;
        Some(next)
    }

    fn set_work(&self, job: u64, work: Work) {
        if let Some(known) = self.lock().get_mut(&job) {
            known.work = work;
        }
        self.changed.notify_one();
    }

    /// Runs a job and keeps what comes of it.
    async fn work(self: Arc<Self>, job: u64) {
        let stop = self.lock().get(&job).map(|known| known.stop.clone());
        let stop = stop.unwrap_or_default();
        let kept = tokio::select! {
            kept = self.perform_and_keep(job) => kept,
            // Whoever stopped it has said why.
            () = stop.cancelled() => Ok(()),
            () = self.shutdown.cancelled() => return,
        };
        if let Err(error) = kept {
            error!(job, %error, "the end of this job is not in the store; the next start does it again");
            self.show(job, failed(error));
        }
        self.set_work(job, Work::Nothing);
    }

    /// Runs a job and puts what comes of it into the store: the result, or why there is none.
    async fn perform_and_keep(self: &Arc<Self>, job: u64) -> Result<()> {
        let name = self.entry(job).map(|entry| (entry.name, entry.trace));
        let (name, trace) = name.unwrap_or_default();
        let span = trace::child_of(trace.as_deref(), info_span!("job", job, name));
        let kept = match trace::within(span, self.perform(job)).await {
            Ok(pieces) => {
                let finish = move |store: &Store| store.finish(job, since_1970(), &pieces);
                self.change(job, finish).await
            }
            Err(error) => Err(error),
        };
        let error = match kept {
            Ok(()) => return Ok(()),
            // It is not over: the next start goes on with it.
            Err(Error::Interrupted) if self.shutdown.is_cancelled() => return Ok(()),
            Err(error) => error,
        };
        warn!(job, %error, "failed");
        let stage = failed(error);
        self.change(job, move |store: &Store| store.end(job, stage))
            .await
    }

    /// Plans a job, has it digitized, and makes pieces of the result.
    async fn perform(&self, job: u64) -> Result<Vec<Bytes>> {
        let store = self.store.clone();
        let read = move || {
            let again = submission::again(store.submission(job)?);
            again.map_err(|e| Error::StoreDamaged(format!("job {job}: {e}")))
        };
        let sent = blocking(read).await?;
        let (progress, memory) = (self.progress(job), self.share(job));
        progress("discretize", 0, 0);
        let planning = self
            .master
            .plan(Arc::new(sent.part), sent.job, sent.sharing, memory);
        let planned = planning.await?;
        let workers = self.master.gather(1).await?;
        // Once it is split it stays so, whoever is there.
        let workers = match self.entry(job).map(|entry| entry.stage) {
            Some(Stage::Running { workers, .. }) => workers,
            _ => workers,
        };
        let journal = Journal {
            store: self.store.clone(),
            job,
        };
        let resumed = journal.resume(planned.plan.clone(), workers).await?;
        self.show(job, resumed.stage.clone());
        let running = self.master.begin(planned, workers, Some(resumed), progress);
        let running = running.await?;
        self.set_work(job, Work::Digitizing);
        let outcome = running.end().await?;
        blocking(move || result::to_pieces(&outcome)).await
    }

    /// Tells how far a job is, for as long as it is known.
    fn progress(&self, job: u64) -> Progress {
        let view = self.lock().get(&job).map(|known| known.view.clone());
        Arc::new(move |phase, done, total| {
            if let Some(view) = &view {
                view.send_modify(|view| view.progress = (phase, done, total));
            }
        })
    }

    fn entry(&self, job: u64) -> Option<Entry> {
        let jobs = self.lock();
        jobs.get(&job)
            .map(|known| known.view.borrow().entry.clone())
    }

    /// The memory that the other jobs under way leave to a job.
    fn share(&self, job: u64) -> u64 {
        let jobs = self.lock();
        let others = jobs.iter().filter(|(other, _)| **other != job);
        let taken = others
            .filter(|(_, known)| known.work != Work::Nothing)
            .map(|(_, known)| known.view.borrow().entry.memory)
            .fold(0, u64::saturating_add);
        self.master.memory().0.saturating_sub(taken)
    }

    /// Drops results that are too old or too many, and forgets jobs that ended long ago.
    async fn expire(self: &Arc<Self>) {
        let ended = self.ended();
        let Expired { dropped, forgotten } = expired(ended, &self.limits, since_1970());
        for job in dropped {
            let drop = move |store: &Store| store.drop_result(job, Gone::Dropped);
            if let Err(error) = self.change(job, drop).await {
                warn!(job, %error, "its result is not dropped");
            }
        }
        for job in forgotten {
            let store = self.store.clone();
            let forgetting = spawn_blocking(move || store.forget(job)).await;
            match forgetting {
                Ok(Ok(())) => drop(self.lock().remove(&job)),
                Ok(Err(error)) => warn!(job, %error, "not forgotten"),
                Err(_) => return,
            }
        }
    }

    /// When jobs ended at which nobody is looking, and what their results take.
    fn ended(&self) -> Vec<(Duration, u64, u64)> {
        let jobs = self.lock();
        let unwatched = jobs.iter().filter(|(_, k)| k.view.receiver_count() == 0);
        let ended = unwatched.filter_map(|(&job, known)| {
            let stage = &known.view.borrow().entry.stage;
            let bytes = match stage {
                Stage::Done { bytes, .. } => *bytes,
                _ => 0,
            };
            Some((stage.ended()?, job, bytes))
        });
        ended.collect()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Known>> {
        // Every change is a single assignment: there is no half of one to be seen.
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Known {
    fn new(entry: Entry, place: Option<OwnedSemaphorePermit>) -> Self {
        let progress = ("wait", 0, 0);
        Self {
            view: watch::Sender::new(View { entry, progress }),
            work: Work::Nothing,
            stop: CancellationToken::new(),
            place,
        }
    }
}

/// A job that came to nothing, as its client is going to be told.
fn failed(error: Error) -> Stage {
    let status = Status::from(Refusal::from(error));
    Stage::Failed {
        at: since_1970(),
        code: status.code().into(),
        reason: status.message().to_owned(),
    }
}

/// Tells those who watch that a job is over, and how it ended.
fn count(stage: &Stage) {
    match stage {
        Stage::Queued | Stage::Running { .. } | Stage::Gone { .. } => {}
        Stage::Done { .. } => JOBS_ENDED.add("done", 1),
        Stage::Failed { .. } => JOBS_ENDED.add("failed", 1),
        Stage::Cancelled { .. } => JOBS_ENDED.add("cancelled", 1),
    }
}

fn unknown(job: u64) -> Refusal {
    Refusal::NoSuchJob(format!(
        "there is no job {job} here; `horma status` lists those there are"
    ))
}
