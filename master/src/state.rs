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
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    const LEASE: Duration = Duration::from_secs(10);

    fn name(worker: u8) -> String {
        format!("w{worker}")
    }

    /// What may happen next, as a few small numbers that are made an event of the moment.
    #[derive(Debug, Clone)]
    enum Step {
        Register(u8, u64),
        Heartbeat(u8),
        Wait(u64),
        Submit(u32),
        Cancel(u64),
        Deliver(usize),
        Fail(usize, bool),
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let step = prop_oneof![
            3 => (0..4u8, 0..3u64).prop_map(|(w, i)| Step::Register(w, i)),
            2 => (0..4u8).prop_map(Step::Heartbeat),
            1 => (0..12u64).prop_map(Step::Wait),
            2 => (0..6u32).prop_map(Step::Submit),
            1 => (0..4u64).prop_map(Step::Cancel),
            6 => (0..8usize).prop_map(Step::Deliver),
            3 => (0..8usize, any::<bool>()).prop_map(|(t, wrong)| Step::Fail(t, wrong)),
        ];
        prop::collection::vec(step, 1..120)
    }

    /// Holds after every event.
    fn check(state: &State) {
        let mut running = BTreeSet::new();
        for worker in state.workers.values() {
            if let Some(task) = worker.task {
                assert!(
                    running.insert((task.job, task.extent)),
                    "two workers, one extent"
                );
                let extent = &state.jobs[&task.job][task.extent as usize];
                let expected = (Status::Running, task.attempt);
                assert_eq!((extent.status, extent.attempts), expected);
            }
        }
        for (&job, extents) in &state.jobs {
            assert!(
                extents.iter().any(|e| e.status != Status::Done),
                "a job is over when it is done"
            );
            for (i, extent) in (0u32..).zip(extents) {
                let is_running = extent.status == Status::Running;
                assert_eq!(
                    is_running,
                    running.contains(&(job, i)),
                    "running means someone runs it"
                );
                let may = |name: &String| {
                    let tried = |n: &String| extent.failed_by.contains(n);
                    !tried(name) || state.workers.keys().all(tried)
                };
                let idle = |(name, w): (&String, &Worker)| w.task.is_none() && may(name);
                let idle = state.workers.iter().any(idle);
                let waits = extent.status == Status::Waiting;
                assert!(!(waits && idle), "nobody idles while an extent waits");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Whatever happens, in whatever order: the state is consistent, an extent is kept at most
        /// once, and a job ends exactly once and only with all of its extents kept.
        #[test]
        fn any_order_of_events_leaves_the_state_consistent(steps in steps()) {
            let mut state = State::new(LEASE, Duration::from_secs(3));
            let mut now = Duration::ZERO;
            let mut jobs: BTreeMap<u64, u32> = BTreeMap::new();
            let mut kept: BTreeSet<(u64, u32)> = BTreeSet::new();
            let mut ended = BTreeSet::new();
            let mut started: Vec<(String, TaskId)> = Vec::new();
            for step in steps {
                let pick = |i: usize| started.len().checked_sub(1 + i).map(|i| started[i].clone());
                let event = match step {
                    Step::Register(w, incarnation) => {
                        Event::Registered { worker: name(w), incarnation }
                    }
                    Step::Heartbeat(w) => Event::Heartbeat { worker: name(w) },
                    Step::Wait(seconds) => {
                        now += Duration::from_secs(seconds);
                        Event::Tick
                    }
                    Step::Submit(extents) => {
                        let job = jobs.len() as u64;
                        jobs.insert(job, extents);
                        Event::Submitted { job, extents }
                    }
                    Step::Cancel(job) => {
                        if state.jobs.contains_key(&job) {
                            ended.insert(job);
                        }
                        Event::Cancelled { job }
                    }
                    // Late and repeated answers are as likely as current ones.
                    Step::Deliver(i) => match pick(i) {
                        Some((worker, task)) => Event::Delivered { worker, task },
                        None => Event::Tick,
                    },
                    Step::Fail(i, wrong) => match pick(i) {
                        Some((worker, task)) => {
                            let why = "of the test".to_owned();
                            let fault = if wrong { Fault::Wrong(why) } else { Fault::Lost(why) };
                            Event::Failed { worker, task, fault }
                        }
                        None => Event::Tick,
                    },
                };
                for command in apply(&mut state, now, event) {
                    match command {
                        Command::Start { worker, task } => {
                            prop_assert!(state.workers.contains_key(&worker) || ended.contains(&task.job));
                            started.push((worker, task));
                        }
                        Command::Keep { task } => {
                            prop_assert!(!ended.contains(&task.job));
                            prop_assert!(kept.insert((task.job, task.extent)), "kept twice");
                        }
                        Command::Complete { job } => {
                            prop_assert!(ended.insert(job), "ended twice");
                            for extent in 0..jobs[&job] {
                                prop_assert!(kept.contains(&(job, extent)));
                            }
                        }
                        Command::Fail { job, error } => {
                            prop_assert!(ended.insert(job), "ended twice");
                            if let Error::TooManyAttempts { attempts, .. } = error {
                                prop_assert!(attempts >= MAX_ATTEMPTS);
                            } else {
                                prop_assert!(state.workers.is_empty(), "someone is left");
                            }
                        }
                        Command::Abort { .. } => {}
                    }
                }
                check(&state);
            }
            let open: BTreeSet<u64> = state.jobs.keys().copied().collect();
            let expected = jobs.keys().copied().filter(|j| !ended.contains(j)).collect();
            prop_assert_eq!(open, expected);
        }
    }

    fn starts(commands: &[Command]) -> Vec<(&str, u32, u32)> {
        let start = |c| match c {
            &Command::Start { ref worker, task } => {
                Some((worker.as_str(), task.extent, task.attempt))
            }
            _ => None,
        };
        commands.iter().filter_map(start).collect()
    }

    #[test]
    fn a_lost_workers_extent_goes_to_another() {
        let mut state = State::new(LEASE, Duration::ZERO);
        let now = Duration::ZERO;
        for worker in ["a", "b"] {
            let worker = worker.to_owned();
            apply(
                &mut state,
                now,
                Event::Registered {
                    worker,
                    incarnation: 1,
                },
            );
        }
        let commands = apply(&mut state, now, Event::Submitted { job: 1, extents: 2 });
        assert_eq!(starts(&commands), [("a", 0, 1), ("b", 1, 1)]);
        let task = |extent, attempt| TaskId {
            job: 1,
            extent,
            attempt,
        };
        let failed = Event::Failed {
            worker: "a".to_owned(),
            task: task(0, 1),
            fault: Fault::Lost("test".to_owned()),
        };
        assert!(
            starts(&apply(&mut state, now, failed)).is_empty(),
            "b is busy"
        );
        let delivered = |extent, attempt| Event::Delivered {
            worker: "b".to_owned(),
            task: task(extent, attempt),
        };
        let commands = apply(&mut state, now, delivered(1, 1));
        assert_eq!(starts(&commands), [("b", 0, 2)]);
        let commands = apply(&mut state, now, delivered(0, 2));
        assert!(matches!(
            commands[..],
            [Command::Keep { .. }, Command::Complete { job: 1 }]
        ));
    }

    #[test]
    fn registering_again_does_not_interrupt_a_task() {
        let mut state = State::new(LEASE, Duration::ZERO);
        let register = || Event::Registered {
            worker: "a".to_owned(),
            incarnation: 1,
        };
        apply(&mut state, Duration::ZERO, register());
        let submitted = Event::Submitted { job: 1, extents: 1 };
        apply(&mut state, Duration::ZERO, submitted);
        let later = Duration::from_secs(9);
        assert!(apply(&mut state, later, register()).is_empty());
        let tick = apply(&mut state, Duration::from_secs(15), Event::Tick);
        assert!(tick.is_empty(), "it was heard of at 9 s: {tick:?}");
    }

    /// A worker that says it is alive and cannot be reached must not use up an extent's attempts
    /// while a good one is merely busy.
    #[test]
    fn a_worker_that_cannot_be_reached_does_not_fail_a_job() {
        let mut state = State::new(LEASE, Duration::ZERO);
        let now = Duration::ZERO;
        for worker in ["bad", "good"] {
            let worker = worker.to_owned();
            let incarnation = 1;
            apply(
                &mut state,
                now,
                Event::Registered {
                    worker,
                    incarnation,
                },
            );
        }
        let submitted = Event::Submitted { job: 1, extents: 2 };
        assert_eq!(
            starts(&apply(&mut state, now, submitted)),
            [("bad", 0, 1), ("good", 1, 1)]
        );
        for _ in 0..2 * MAX_ATTEMPTS {
            let failed = Event::Failed {
                worker: "bad".to_owned(),
                task: TaskId {
                    job: 1,
                    extent: 0,
                    attempt: 1,
                },
                fault: Fault::Lost("no route".to_owned()),
            };
            assert!(apply(&mut state, now, failed).is_empty());
            let worker = "bad".to_owned();
            let incarnation = 1;
            let again = Event::Registered {
                worker,
                incarnation,
            };
            assert!(apply(&mut state, now, again).is_empty());
        }
        let delivered = Event::Delivered {
            worker: "good".to_owned(),
            task: TaskId {
                job: 1,
                extent: 1,
                attempt: 1,
            },
        };
        let commands = apply(&mut state, now, delivered);
        assert_eq!(starts(&commands), [("good", 0, 2)]);
    }

    #[test]
    fn a_job_fails_when_nobody_is_left() {
        let mut state = State::new(LEASE, Duration::from_secs(5));
        let at = Duration::from_secs;
        let worker = || "a".to_owned();
        apply(
            &mut state,
            at(0),
            Event::Registered {
                worker: worker(),
                incarnation: 1,
            },
        );
        apply(&mut state, at(0), Event::Submitted { job: 1, extents: 1 });
        let silent = apply(&mut state, at(11), Event::Tick);
        assert!(matches!(silent[..], [Command::Abort { .. }]));
        assert!(
            apply(&mut state, at(15), Event::Tick).is_empty(),
            "someone may still come"
        );
        let commands = apply(&mut state, at(16), Event::Tick);
        let [Command::Fail { error, .. }] = &commands[..] else {
            panic!("{commands:?}");
        };
        assert!(error.to_string().contains("worker a was silent"), "{error}");
    }

    #[test]
    fn a_worker_that_answered_wrongly_is_not_asked_again() {
        let mut state = State::new(LEASE, Duration::from_secs(60));
        let now = Duration::ZERO;
        let register = |incarnation| Event::Registered {
            worker: "a".to_owned(),
            incarnation,
        };
        apply(&mut state, now, register(1));
        apply(&mut state, now, Event::Submitted { job: 1, extents: 1 });
        let failed = Event::Failed {
            worker: "a".to_owned(),
            task: TaskId {
                job: 1,
                extent: 0,
                attempt: 1,
            },
            fault: Fault::Wrong("test".to_owned()),
        };
        apply(&mut state, now, failed);
        assert!(starts(&apply(&mut state, now, register(1))).is_empty());
        assert_eq!(starts(&apply(&mut state, now, register(2))), [("a", 0, 2)]);
    }
}
