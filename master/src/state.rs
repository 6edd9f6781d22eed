//! The master's brain: who is there, who does what, and what to do next.
//!
//! `apply` is a plain function from state and event to commands. It knows no network, no clock and
//! no data: time comes with the call, and positions stay with the driver. What must always hold is
//! checked by the tests below over any order of events.
//!
//! Rows either travel with the task, or they are placed first: each extent's own rows go to one
//! worker, its holder, which serves them to others and digitizes the extent once all that it needs are
//! placed. Placing comes before digitizing, so nobody waits for rows that nobody is going to have.
//!
//! An extent may be with two workers: an idle one helps a late one, and it is done when both together
//! have brought all of it.

mod assign;
mod event;
mod help;
mod lose;
mod pace;
mod view;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use horma_proto::TaskId;

use self::assign::assign;
pub(crate) use self::event::{Command, Event, Fault};
use self::help::help;
use self::lose::{gone, leave, lose};
use self::pace::Pace;
pub use self::view::ExtentState;
pub(crate) use self::view::Member;
use crate::error::Error;

/// Failures of one extent after which it is the extent, not the workers, if all of them had a try.
const MAX_ATTEMPTS: u32 = 8;

/// What the master knows.
#[derive(Debug, Default)]
pub(crate) struct State {
    lease: Duration,
    patience: Duration,
    workers: BTreeMap<String, Worker>,
    jobs: BTreeMap<u64, Vec<Extent>>,
    /// How many times anybody was given anything, and how many that were when each job had its last turn.
    turn: u64,
    turns: BTreeMap<u64, u64>,
    /// Since when there has been nobody, and how the last one was lost.
    deserted: Option<Duration>,
    last_loss: Option<String>,
    /// Whether the master is about to stop.
    draining: bool,
    /// Workers that answered wrongly; they are not trusted again until they start anew.
    distrusted: BTreeMap<String, u64>,
}

#[derive(Debug)]
struct Worker {
    incarnation: u64,
    seen: Duration,
    task: Option<(TaskId, Step)>,
    pace: Pace,
}

/// What a worker is busy with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// It takes in an extent's rows.
    Place,
    /// It digitizes an extent.
    Digitize,
}

#[derive(Debug, Clone, Default)]
struct Extent {
    status: Status,
    /// The number of the last attempt. Placing rows and the first try over them share one.
    attempts: u32,
    /// Whether the last attempt has only placed rows so far.
    only_placed: bool,
    /// How often it failed.
    failures: u32,
    /// Who tried it in vain: others come first.
    failed_by: BTreeSet<String>,
    /// Where its own rows are.
    rows: Rows,
    /// The other extents whose rows it needs.
    halo: Vec<u32>,
}

#[derive(Debug, Clone, PartialEq, Eq, Default)]
enum Rows {
    /// They travel with every task.
    #[default]
    WithTask,
    Nowhere,
    OnTheWay,
    Held(Held),
}

/// Rows that a worker holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Held {
    /// By which attempt it got them.
    pub id: TaskId,
    pub worker: String,
}

impl Extent {
    fn held(&self) -> Option<&Held> {
        match &self.rows {
            Rows::Held(held) => Some(held),
            Rows::WithTask | Rows::Nowhere | Rows::OnTheWay => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Status {
    #[default]
    Waiting,
    Running,
    Done,
}

impl State {
    pub fn new(lease: Duration, patience: Duration) -> Self {
        Self {
            lease,
            patience,
            ..Self::default()
        }
    }

    /// Whether this start of this worker is a member.
    pub fn knows(&self, worker: &str, incarnation: u64) -> bool {
        self.workers
            .get(worker)
            .is_some_and(|w| w.incarnation == incarnation)
    }

    /// Whether this start of this worker has answered wrongly before.
    pub fn distrusts(&self, worker: &str, incarnation: u64) -> bool {
        self.distrusted.get(worker) == Some(&incarnation)
    }

    /// Whether everybody is through with what was begun.
    pub fn is_idle(&self) -> bool {
        self.workers.values().all(|w| w.task.is_none())
    }

    /// Number of workers.
    pub fn workers(&self) -> usize {
        self.workers.len()
    }

    /// The jobs that are going on.
    pub fn jobs(&self) -> impl Iterator<Item = u64> {
        self.jobs.keys().copied()
    }
}

/// Takes an event in; says what to do. `now` never runs backwards.
pub(crate) fn apply(state: &mut State, now: Duration, event: Event) -> Vec<Command> {
    let mut commands = Vec::new();
    match event {
        Event::Registered {
            worker,
            incarnation,
        } => {
            register(state, now, &worker, incarnation, &mut commands);
        }
        Event::Heartbeat { worker } => {
            if let Some(worker) = state.workers.get_mut(&worker) {
                worker.seen = now;
            }
        }
        Event::Left { worker } => leave(state, &worker, &mut commands),
        Event::Drain => state.draining = true,
        Event::Tick => expire(state, now, &mut commands),
        Event::Submitted {
            job,
            extents,
            halos,
            done,
        } => {
            let mut extents = match halos {
                None => vec![Extent::default(); extents as usize],
                Some(halos) => halos.into_iter().map(Extent::to_be_placed).collect(),
            };
            for number in done {
                extents[number as usize].status = Status::Done;
            }
            state.jobs.insert(job, extents);
            state.turns.insert(job, state.turn);
            complete(state, job, &mut commands);
        }
        Event::Cancelled { job } => {
            if state.jobs.remove(&job).is_some() {
                release(state, job, "the job was cancelled", &mut commands);
            }
        }
        Event::Placed { worker, task } => {
            if free(state, &worker, task, Step::Place)
                && let Some(extent) = extent(state, task)
            {
                extent.rows = Rows::Held(Held { id: task, worker });
            }
        }
        Event::Progress {
            worker,
            task,
            came,
            left,
        } => {
            if let Some(worker) = state.workers.get_mut(&worker)
                && worker.task == Some((task, Step::Digitize))
            {
                worker.pace.note(now, came, left);
            }
        }
        Event::Delivered { worker, task, left } => {
            if free(state, &worker, task, Step::Digitize) {
                deliver(state, &worker, task, left, &mut commands);
            }
        }
        Event::Failed {
            worker,
            task,
            step,
            fault,
        } => {
            if free(state, &worker, task, step) {
                lose(state, &worker, (task, step), fault, &mut commands);
            }
        }
    }
    desert(state, now, &mut commands);
    if !state.draining {
        assign(state, now, &mut commands);
        help(state, now, &mut commands);
    }
    commands
}

/// A worker that started anew has forgotten its task; one that only registers again has not.
fn register(
    state: &mut State,
    now: Duration,
    name: &str,
    incarnation: u64,
    commands: &mut Vec<Command>,
) {
    if state.distrusts(name, incarnation) {
        return;
    }
    if let Some(worker) = state.workers.get_mut(name)
        && worker.incarnation == incarnation
    {
        worker.seen = now;
        return;
    }
    let worker = Worker {
        incarnation,
        seen: now,
        task: None,
        pace: Pace::default(),
    };
    if let Some(before) = state.workers.insert(name.to_owned(), worker) {
        let reason = format!("worker {name} started anew");
        gone(state, name, &before, reason, commands);
    }
}

/// Drops workers that have been silent for longer than their lease.
fn expire(state: &mut State, now: Duration, commands: &mut Vec<Command>) {
    let lease = state.lease;
    let late = |w: &Worker| now.saturating_sub(w.seen) > lease;
    let silent: Vec<String> = state
        .workers
        .iter()
        .filter(|(_, w)| late(w))
        .map(|(name, _)| name.clone())
        .collect();
    for name in silent {
        let reason = format!(
            "worker {name} was silent for more than {} s",
            lease.as_secs()
        );
        state.last_loss = Some(reason.clone());
        if let Some(worker) = state.workers.remove(&name) {
            gone(state, &name, &worker, reason, commands);
        }
    }
}

/// Takes the task off the worker, if it is the worker's current one: all else is stale.
fn free(state: &mut State, worker: &str, task: TaskId, step: Step) -> bool {
    match state.workers.get_mut(worker) {
        Some(worker) if worker.task == Some((task, step)) => {
            worker.task = None;
            true
        }
        _ => false,
    }
}

fn extent(state: &mut State, task: TaskId) -> Option<&mut Extent> {
    let extents = state.jobs.get_mut(&task.job)?;
    extents.get_mut(task.extent as usize)
}

/// Whether someone digitizes this extent.
fn runs(state: &State, task: TaskId) -> bool {
    let mut tasks = state.workers.values().filter_map(|w| w.task);
    tasks.any(|(t, step)| digitizes(task, t, step))
}

/// Whether somebody at this step of a task digitizes the extent of another.
fn digitizes(of: TaskId, task: TaskId, step: Step) -> bool {
    (task.job, task.extent, step) == (of.job, of.extent, Step::Digitize)
}

/// An extent that somebody stopped at waits, unless another one is still at it.
fn stopped(state: &mut State, task: TaskId) {
    let runs = runs(state, task);
    if let Some(extent) = extent(state, task)
        && extent.status != Status::Done
    {
        extent.status = if runs {
            Status::Running
        } else {
            Status::Waiting
        };
    }
}

/// A worker is through with a task: if nothing is missing, so is everybody who was at the extent.
fn deliver(state: &mut State, worker: &str, task: TaskId, left: u64, commands: &mut Vec<Command>) {
    if left > 0 {
        return stopped(state, task);
    }
    if let Some(extent) = extent(state, task) {
        extent.status = Status::Done;
    }
    commands.push(Command::Keep { task });
    let reason = format!("worker {worker} completed it");
    let same = |t, step| digitizes(task, t, step);
    take_off(state, same, &reason, commands);
    complete(state, task.job, commands);
}

fn fail(state: &mut State, job: u64, error: Error, commands: &mut Vec<Command>) {
    if state.jobs.remove(&job).is_some() {
        release(state, job, "the job failed", commands);
        commands.push(Command::Fail { job, error });
    }
}

/// Takes every task of a job that is over off its worker.
fn release(state: &mut State, job: u64, reason: &str, commands: &mut Vec<Command>) {
    take_off(state, |t, _| t.job == job, reason, commands);
}

/// Takes tasks off their workers.
fn take_off(
    state: &mut State,
    which: impl Fn(TaskId, Step) -> bool,
    reason: &str,
    commands: &mut Vec<Command>,
) {
    for worker in state.workers.values_mut() {
        if let Some((task, _)) = worker.task.take_if(|(task, step)| which(*task, *step)) {
            let reason = reason.to_owned();
            commands.push(Command::Abort { task, reason });
        }
    }
}

fn complete(state: &mut State, job: u64, commands: &mut Vec<Command>) {
    let done = |extents: &Vec<Extent>| extents.iter().all(|e| e.status == Status::Done);
    if state.jobs.get(&job).is_some_and(done) {
        state.jobs.remove(&job);
        // Someone may be about to hold rows that nobody asks for any more.
        release(state, job, "the job is done", commands);
        commands.push(Command::Complete { job });
    }
}

/// Fails every job once nobody has been left for longer than the master's patience.
fn desert(state: &mut State, now: Duration, commands: &mut Vec<Command>) {
    if !state.workers.is_empty() || state.jobs.is_empty() {
        state.deserted = None;
        return;
    }
    let since = *state.deserted.get_or_insert(now);
    if now.saturating_sub(since) < state.patience {
        return;
    }
    let last = state.last_loss.clone();
    let error = match last {
        Some(last) => Error::AllLost { last },
        None => Error::NoWorkers {
            seconds: state.patience.as_secs(),
        },
    };
    for job in state.jobs.keys().copied().collect::<Vec<_>>() {
        fail(state, job, error.clone(), commands);
    }
}

#[cfg(test)]
mod tests;
