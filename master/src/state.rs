//! The master's brain: who is there, who does what, and what to do next.
//!
//! `apply` is a plain function from state and event to commands. It knows no network, no clock and
//! no data: time comes with the call, and positions stay with the driver. What must always hold is
//! checked by the tests below over any order of events.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use horma_proto::TaskId;

use crate::error::Error;

/// Attempts at one extent after which it is the extent, not the workers, if all of them had a try.
const MAX_ATTEMPTS: u32 = 8;

/// What the master knows.
#[derive(Debug, Default)]
pub(crate) struct State {
    lease: Duration,
    patience: Duration,
    workers: BTreeMap<String, Worker>,
    jobs: BTreeMap<u64, Vec<Extent>>,
    /// Since when there has been nobody, and how the last one was lost.
    deserted: Option<Duration>,
    last_loss: Option<String>,
    /// Workers that answered wrongly; they are not trusted again until they start anew.
    distrusted: BTreeMap<String, u64>,
}

#[derive(Debug)]
struct Worker {
    incarnation: u64,
    seen: Duration,
    task: Option<TaskId>,
}

#[derive(Debug, Clone, Default)]
struct Extent {
    status: Status,
    /// How often it has been tried.
    attempts: u32,
    /// Who tried it in vain: others come first.
    failed_by: BTreeSet<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Status {
    #[default]
    Waiting,
    Running,
    Done,
}

/// What happens to a master.
#[derive(Debug, Clone)]
pub(crate) enum Event {
    /// A worker registered, perhaps again.
    Registered { worker: String, incarnation: u64 },
    /// A worker said that it is alive.
    Heartbeat { worker: String },
    /// Time went by.
    Tick,
    /// A job was split into so many extents.
    Submitted { job: u64, extents: u32 },
    /// Nobody wants the job any more.
    Cancelled { job: u64 },
    /// A worker delivered all of a task.
    Delivered { worker: String, task: TaskId },
    /// A worker did not deliver a task.
    Failed {
        worker: String,
        task: TaskId,
        fault: Fault,
    },
}

/// Why a task was not delivered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The worker is gone, or cannot be reached.
    Lost(String),
    /// The worker's answer cannot be right.
    Wrong(String),
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost(reason) => write!(f, "lost: {reason}"),
            Self::Wrong(reason) => write!(f, "wrong: {reason}"),
        }
    }
}

/// What the driver is to do.
#[derive(Debug, Clone)]
pub(crate) enum Command {
    /// Bring this task to this worker.
    Start { worker: String, task: TaskId },
    /// Nobody waits for this task any more.
    Abort { task: TaskId, reason: String },
    /// The delivered positions are the extent's: keep them.
    Keep { task: TaskId },
    /// All extents of the job are kept.
    Complete { job: u64 },
    /// The job cannot be done.
    Fail { job: u64, error: Error },
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

    /// Number of workers.
    pub fn workers(&self) -> usize {
        self.workers.len()
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
        Event::Tick => expire(state, now, &mut commands),
        Event::Submitted { job, extents } => {
            state
                .jobs
                .insert(job, vec![Extent::default(); extents as usize]);
            complete(state, job, &mut commands);
        }
        Event::Cancelled { job } => {
            if state.jobs.remove(&job).is_some() {
                release(state, job, "the job was cancelled", &mut commands);
            }
        }
        Event::Delivered { worker, task } => {
            if free(state, &worker, task) {
                set(state, task, Status::Done);
                commands.push(Command::Keep { task });
                complete(state, task.job, &mut commands);
            }
        }
        Event::Failed {
            worker,
            task,
            fault,
        } => {
            if free(state, &worker, task) {
                lose(state, &worker, task, fault, &mut commands);
            }
        }
    }
    desert(state, now, &mut commands);
    assign(state, &mut commands);
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
    };
    if let Some(Worker {
        task: Some(task), ..
    }) = state.workers.insert(name.to_owned(), worker)
    {
        let reason = format!("worker {name} started anew");
        retry(state, name, task, reason.clone(), commands);
        commands.push(Command::Abort { task, reason });
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
        if let Some(Worker {
            task: Some(task), ..
        }) = state.workers.remove(&name)
        {
            retry(state, &name, task, reason.clone(), commands);
            commands.push(Command::Abort { task, reason });
        }
    }
}

/// Takes the task off the worker, if it is the worker's current one: all else is stale.
fn free(state: &mut State, worker: &str, task: TaskId) -> bool {
    match state.workers.get_mut(worker) {
        Some(worker) if worker.task == Some(task) => {
            worker.task = None;
            true
        }
        _ => false,
    }
}

/// A worker failed a task: it leaves, and the extent waits for another. One that is merely cut off
/// comes back by registering again.
fn lose(state: &mut State, name: &str, task: TaskId, fault: Fault, commands: &mut Vec<Command>) {
    let Some(worker) = state.workers.remove(name) else {
        return;
    };
    let reason = match fault {
        Fault::Lost(reason) => format!("worker {name} was lost ({reason})"),
        Fault::Wrong(reason) => {
            state.distrusted.insert(name.to_owned(), worker.incarnation);
            format!("worker {name} answered wrongly ({reason})")
        }
    };
    state.last_loss = Some(reason.clone());
    retry(state, name, task, reason, commands);
}

/// Puts an extent back, unless everybody has tried it, and that too often.
fn retry(state: &mut State, worker: &str, task: TaskId, last: String, commands: &mut Vec<Command>) {
    set(state, task, Status::Waiting);
    let Some(extents) = state.jobs.get_mut(&task.job) else {
        return;
    };
    let failed_by = &mut extents[task.extent as usize].failed_by;
    failed_by.insert(worker.to_owned());
    let someone_else = state.workers.keys().any(|w| !failed_by.contains(w));
    if task.attempt >= MAX_ATTEMPTS && !someone_else {
        let error = Error::TooManyAttempts {
            extent: task.extent,
            attempts: task.attempt,
            last,
        };
        fail(state, task.job, error, commands);
    }
}

fn set(state: &mut State, task: TaskId, to: Status) {
    if let Some(extents) = state.jobs.get_mut(&task.job) {
        extents[task.extent as usize].status = to;
    }
}

fn fail(state: &mut State, job: u64, error: Error, commands: &mut Vec<Command>) {
    if state.jobs.remove(&job).is_some() {
        release(state, job, "the job failed", commands);
        commands.push(Command::Fail { job, error });
    }
}

/// Takes every task of a job that is over off its worker.
fn release(state: &mut State, job: u64, reason: &str, commands: &mut Vec<Command>) {
    for worker in state.workers.values_mut() {
        if let Some(task) = worker.task.take_if(|t| t.job == job) {
            let reason = reason.to_owned();
            commands.push(Command::Abort { task, reason });
        }
    }
}

fn complete(state: &mut State, job: u64, commands: &mut Vec<Command>) {
    let done = |extents: &Vec<Extent>| extents.iter().all(|e| e.status == Status::Done);
    if state.jobs.get(&job).is_some_and(done) {
        state.jobs.remove(&job);
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

/// Gives the extents that wait to idle workers: oldest job first, lowest extent first, and to one that
/// has failed an extent only if every member has.
fn assign(state: &mut State, commands: &mut Vec<Command>) {
    let members: Vec<String> = state.workers.keys().cloned().collect();
    let mut idle: BTreeSet<&String> = members
        .iter()
        .filter(|name| state.workers[*name].task.is_none())
        .collect();
    for (&job, extents) in &mut state.jobs {
        for (number, extent) in (0u32..).zip(extents) {
            if idle.is_empty() {
                return;
            }
            if extent.status != Status::Waiting {
                continue;
            }
            let tried = |name: &String| extent.failed_by.contains(name);
            let untried = idle.iter().copied().find(|name| !tried(name));
            let anyone = || idle.first().copied().filter(|_| members.iter().all(tried));
            let Some(name) = untried.or_else(anyone) else {
                continue;
            };
            idle.remove(name);
            extent.attempts += 1;
            extent.status = Status::Running;
            let task = TaskId {
                job,
                extent: number,
                attempt: extent.attempts,
            };
            if let Some(worker) = state.workers.get_mut(name) {
                worker.task = Some(task);
            }
            let worker = name.clone();
            commands.push(Command::Start { worker, task });
        }
    }
}

#[cfg(test)]
mod tests;
