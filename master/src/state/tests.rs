//! What must hold after any order of events, and what each kind of event does.

use super::*;
use proptest::prelude::*;
use std::collections::BTreeSet;

pub(super) const LEASE: Duration = Duration::from_secs(10);

fn name(worker: u8) -> String {
    format!("w{worker}")
}

pub(super) fn submitted(job: u64, extents: u32) -> Event {
    Event::Submitted {
        job,
        extents,
        halos: None,
        done: BTreeSet::new(),
    }
}

/// Extents of which each needs the rows of those up to `reach` away.
pub(super) fn neighbours(extents: u32, reach: u32) -> Vec<Vec<u32>> {
    let near = |i: u32| (0..extents).filter(move |&j| i != j && i.abs_diff(j) <= reach);
    (0..extents).map(|i| near(i).collect()).collect()
}

/// What may happen next, as a few small numbers that are made an event of the moment.
#[derive(Debug, Clone)]
enum Happens {
    Register(u8, u64),
    Heartbeat(u8),
    Leave(u8),
    Drain,
    Wait(u64),
    /// So many extents, how far they reach if their rows are placed, and a bit for each that is done.
    Submit(u32, Option<u32>, u8),
    Cancel(u64),
    /// So many of the extent's positions are missing all the same.
    Deliver(usize, u64),
    Progress(usize, u64, u64),
    Fail(usize, u8),
}

fn steps() -> impl Strategy<Value = Vec<Happens>> {
    let step = prop_oneof![
        3 => (0..4u8, 0..3u64).prop_map(|(w, i)| Happens::Register(w, i)),
        2 => (0..4u8).prop_map(Happens::Heartbeat),
        1 => (0..4u8).prop_map(Happens::Leave),
        1 => (0..12u64).prop_map(Happens::Wait),
        2 => (0..6u32, prop::option::of(0..3u32), prop_oneof![Just(0), any::<u8>()])
            .prop_map(|(n, reach, done)| Happens::Submit(n, reach, done)),
        1 => (0..4u64).prop_map(Happens::Cancel),
        6 => (0..8usize, prop_oneof![4 => Just(0), 1 => 1..5u64])
            .prop_map(|(t, left)| Happens::Deliver(t, left)),
        4 => (0..8usize, 0..1000u64, 0..1000u64)
            .prop_map(|(t, came, left)| Happens::Progress(t, came, left)),
        3 => (0..8usize, 0..7u8).prop_map(|(t, how)| Happens::Fail(t, how)),
    ];
    let until_drained = (
        prop::collection::vec(step.clone(), 1..120),
        prop::collection::vec(step, 0..20),
    );
    until_drained.prop_map(|(mut steps, after)| {
        if !after.is_empty() {
            steps.push(Happens::Drain);
        }
        steps.extend(after);
        steps
    })
}

/// Holds after every event.
fn check(state: &State) {
    let mut running: BTreeMap<(u64, u32), BTreeSet<u32>> = BTreeMap::new();
    let mut placing = BTreeSet::new();
    for worker in state.workers.values() {
        if let Some((task, step)) = worker.task {
            let extent = &state.jobs[&task.job][task.extent as usize];
            assert!((1..=extent.attempts).contains(&task.attempt));
            match step {
                Step::Place => {
                    assert_eq!(extent.rows, Rows::OnTheWay);
                    assert!(placing.insert((task.job, task.extent)), "two take its rows");
                }
                Step::Digitize => {
                    assert_eq!(extent.status, Status::Running);
                    let at = running.entry((task.job, task.extent)).or_default();
                    assert!(at.insert(task.attempt), "two workers, one attempt");
                    assert!(at.len() <= 2, "three workers, one extent");
                }
            }
        }
    }
    for (&job, extents) in &state.jobs {
        assert!(
            extents.iter().any(|e| e.status != Status::Done),
            "a job is over when it is done"
        );
        for (i, extent) in (0u32..).zip(extents) {
            let is = |status| extent.status == status;
            assert_eq!(
                is(Status::Running),
                running.contains_key(&(job, i)),
                "running means someone runs it"
            );
            assert_eq!(
                extent.rows == Rows::OnTheWay,
                placing.contains(&(job, i)),
                "on the way means someone takes it"
            );
            if let Some(held) = extent.held() {
                assert!(state.workers.contains_key(&held.worker), "held by a member");
                assert!((held.id.job, held.id.extent) == (job, i) && held.id.attempt > 0);
            }
            let may = |name: &String| {
                let tried = |n: &String| extent.failed_by.contains(n);
                !tried(name) || state.workers.keys().all(tried)
            };
            let idle = |(name, w): (&String, &Worker)| w.task.is_none() && may(name);
            let idle = state.workers.iter().any(idle);
            let waits = match &extent.rows {
                Rows::WithTask => is(Status::Waiting),
                Rows::Nowhere => assign::wanted(extents)[i as usize],
                Rows::OnTheWay => false,
                Rows::Held(own) => {
                    let ready =
                        is(Status::Waiting) && assign::needed(extents, i as usize, own).is_some();
                    assert!(
                        !ready || state.draining || state.workers[&own.worker].task.is_some(),
                        "its holder idles while an extent waits"
                    );
                    false
                }
            };
            // Rows may be meant for a faster one that is about to take others.
            let meant = extent.rows == Rows::Nowhere && placing.iter().any(|(j, _)| *j == job);
            assert!(
                !(waits && idle) || meant || state.draining,
                "nobody idles while an extent waits"
            );
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
        let mut started: Vec<(String, TaskId, Step, Vec<Held>)> = Vec::new();
        for step in steps {
            let pick = |i: usize| started.len().checked_sub(1 + i).map(|i| started[i].clone());
            let event = match step {
                Happens::Register(w, incarnation) => {
                    Event::Registered { worker: name(w), incarnation }
                }
                Happens::Heartbeat(w) => Event::Heartbeat { worker: name(w) },
                Happens::Leave(w) => Event::Left { worker: name(w) },
                Happens::Drain => Event::Drain,
                Happens::Wait(seconds) => {
                    now += Duration::from_secs(seconds);
                    Event::Tick
                }
                Happens::Submit(extents, reach, done) => {
                    let job = jobs.len() as u64;
                    jobs.insert(job, extents);
                    let halos = reach.map(|reach| neighbours(extents, reach));
                    let done: BTreeSet<u32> = (0..extents).filter(|e| done >> e & 1 == 1).collect();
                    kept.extend(done.iter().map(|&extent| (job, extent)));
                    Event::Submitted { job, extents, halos, done }
                }
                Happens::Cancel(job) => {
                    if state.jobs.contains_key(&job) {
                        ended.insert(job);
                    }
                    Event::Cancelled { job }
                }
                // Late and repeated answers are as likely as current ones.
                Happens::Deliver(i, left) => match pick(i) {
                    Some((worker, task, Step::Place, _)) => Event::Placed { worker, task },
                    Some((worker, task, Step::Digitize, _)) => {
                        Event::Delivered { worker, task, left }
                    }
                    None => Event::Tick,
                },
                Happens::Progress(i, came, left) => match pick(i) {
                    Some((worker, task, ..)) => Event::Progress { worker, task, came, left },
                    None => Event::Tick,
                },
                Happens::Fail(i, how) => match pick(i) {
                    Some((worker, task, step, rows)) => {
                        let reason = "of the test".to_owned();
                        let fault = match (how, rows.last()) {
                            (0, _) => Fault::Wrong(reason),
                            (6, _) => Fault::Different { attempt: 1 },
                            (1..4, Some(held)) => Fault::Halo { source: held.id, reason },
                            _ => Fault::Lost(reason),
                        };
                        Event::Failed { worker, task, step, fault }
                    }
                    None => Event::Tick,
                },
            };
            let draining = state.draining || matches!(event, Event::Drain);
            for command in apply(&mut state, now, event) {
                match command {
                    Command::Place { worker, task } => {
                        prop_assert!(!draining, "nothing begins any more");
                        prop_assert!(state.workers.contains_key(&worker) || ended.contains(&task.job));
                        started.push((worker, task, Step::Place, Vec::new()));
                    }
                    Command::Start { .. } if draining => {
                        prop_assert!(false, "nothing begins any more");
                    }
                    Command::Start { worker, task, rows, helps } => {
                        prop_assert!(helps.is_none() || rows.is_empty());
                        prop_assert!(state.workers.contains_key(&worker) || ended.contains(&task.job));
                        if let Some(own) = rows.first() {
                            prop_assert_eq!(&own.worker, &worker);
                            prop_assert_eq!(own.id.extent, task.extent);
                        }
                        started.push((worker, task, Step::Digitize, rows));
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
                        match error {
                            Error::TooManyAttempts { attempts, .. } => {
                                prop_assert!(attempts >= MAX_ATTEMPTS);
                            }
                            Error::Different { .. } => {}
                            _ => prop_assert!(state.workers.is_empty(), "someone is left"),
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
        &Command::Start {
            ref worker, task, ..
        } => Some((worker.as_str(), task.extent, task.attempt)),
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
    let commands = apply(&mut state, now, submitted(1, 2));
    assert_eq!(starts(&commands), [("a", 0, 1), ("b", 1, 1)]);
    let task = |extent, attempt| TaskId {
        job: 1,
        extent,
        attempt,
    };
    let failed = Event::Failed {
        worker: "a".to_owned(),
        task: task(0, 1),
        step: Step::Digitize,
        fault: Fault::Lost("test".to_owned()),
    };
    assert!(
        starts(&apply(&mut state, now, failed)).is_empty(),
        "b is busy"
    );
    let delivered = |extent, attempt| Event::Delivered {
        worker: "b".to_owned(),
        task: task(extent, attempt),
        left: 0,
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
    let submitted = submitted(1, 1);
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
    let submitted = submitted(1, 2);
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
            step: Step::Digitize,
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
        left: 0,
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
    apply(&mut state, at(0), submitted(1, 1));
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
    apply(&mut state, now, submitted(1, 1));
    let failed = Event::Failed {
        worker: "a".to_owned(),
        task: TaskId {
            job: 1,
            extent: 0,
            attempt: 1,
        },
        step: Step::Digitize,
        fault: Fault::Wrong("test".to_owned()),
    };
    apply(&mut state, now, failed);
    assert!(starts(&apply(&mut state, now, register(1))).is_empty());
    assert_eq!(starts(&apply(&mut state, now, register(2))), [("a", 0, 2)]);
}

/// The state with workers that are there, and a way to tell it what happens.
pub(super) fn with_workers(names: &[&str]) -> State {
    let mut state = State::new(LEASE, Duration::ZERO);
    for &name in names {
        let worker = name.to_owned();
        let incarnation = 1;
        let registered = Event::Registered {
            worker,
            incarnation,
        };
        apply(&mut state, Duration::ZERO, registered);
    }
    state
}

/// What is to be done at once, in short.
fn told(state: &mut State, event: Event) -> Vec<String> {
    told_at(0, state, event)
}

/// What is to be done after so many seconds, in short.
pub(super) fn told_at(seconds: u64, state: &mut State, event: Event) -> Vec<String> {
    let commands = apply(state, Duration::from_secs(seconds), event);
    let tell = |command| match command {
        Command::Place { worker, task } => {
            format!("place {}.{} on {worker}", task.extent, task.attempt)
        }
        Command::Start {
            worker,
            task,
            rows,
            helps,
        } => {
            let helps = helps.map_or(String::new(), |why| format!("; {why}"));
            let rows = rows.iter();
            let rows = rows.map(|h| format!("{}.{}@{}", h.id.extent, h.id.attempt, h.worker));
            let rows = rows.collect::<Vec<_>>().join(" ");
            format!(
                "start {}.{} on {worker}: {rows}{helps}",
                task.extent, task.attempt
            )
        }
        Command::Abort { task, .. } => format!("abort {}.{}", task.extent, task.attempt),
        Command::Keep { task } => format!("keep {}.{}", task.extent, task.attempt),
        Command::Complete { .. } => "complete".to_owned(),
        Command::Fail { error, .. } => format!("fail: {error}"),
    };
    commands.into_iter().map(tell).collect()
}

pub(super) fn task(extent: u32, attempt: u32) -> TaskId {
    let job = 1;
    TaskId {
        job,
        extent,
        attempt,
    }
}

pub(super) fn halo_job(extents: u32) -> Event {
    Event::Submitted {
        job: 1,
        extents,
        halos: Some(neighbours(extents, 1)),
        done: BTreeSet::new(),
    }
}

/// Who is started by an event, for which job.
fn started(state: &mut State, event: Event) -> Vec<(u64, u32)> {
    let commands = apply(state, Duration::ZERO, event);
    let starts = commands.iter().filter_map(|command| match command {
        Command::Start { task, .. } => Some((task.job, task.extent)),
        _ => None,
    });
    starts.collect()
}

fn arrives(worker: &str) -> Event {
    Event::Registered {
        worker: worker.to_owned(),
        incarnation: 1,
    }
}

#[test]
fn a_small_job_is_not_stuck_behind_a_big_one() {
    let mut state = State::new(LEASE, LEASE);
    assert_eq!(started(&mut state, arrives("a")), []);
    assert_eq!(started(&mut state, submitted(1, 100)), [(1, 0)]);
    assert_eq!(started(&mut state, submitted(2, 2)), []);
    // Whoever comes goes where fewest are, and to the older one if that is both.
    let next = ["b", "c", "d", "e"].map(|worker| started(&mut state, arrives(worker)));
    assert_eq!(next, [[(2, 0)], [(1, 1)], [(2, 1)], [(1, 2)]]);
    // So does whoever is through.
    started(&mut state, submitted(3, 5));
    let task = TaskId {
        job: 1,
        extent: 0,
        attempt: 1,
    };
    let through = Event::Delivered {
        worker: "a".to_owned(),
        task,
        left: 0,
    };
    assert_eq!(started(&mut state, through), [(3, 0)]);
}

#[test]
fn jobs_take_turns_at_the_only_worker() {
    let mut state = State::new(LEASE, LEASE);
    started(&mut state, arrives("a"));
    let mut turns = started(&mut state, submitted(1, 4));
    started(&mut state, submitted(2, 2));
    while let Some(&(job, extent)) = turns.last() {
        let task = TaskId {
            job,
            extent,
            attempt: 1,
        };
        let through = Event::Delivered {
            worker: "a".to_owned(),
            task,
            left: 0,
        };
        let next = started(&mut state, through);
        if next.is_empty() {
            break;
        }
        turns.extend(next);
    }
    assert_eq!(turns, [(1, 0), (1, 1), (2, 0), (1, 2), (2, 1), (1, 3)]);
}

#[test]
fn what_a_worker_leaves_is_for_others_and_nobodys_failure() {
    let mut state = State::new(LEASE, LEASE);
    started(&mut state, arrives("a"));
    started(&mut state, submitted(1, 1));
    let left = apply(
        &mut state,
        Duration::ZERO,
        Event::Left {
            worker: "a".to_owned(),
        },
    );
    assert!(matches!(&left[..], [Command::Abort { .. }]), "{left:?}");
    assert_eq!(state.jobs[&1][0].failures, 0);
    assert_eq!(started(&mut state, arrives("b")), [(1, 0)]);
}

#[test]
fn what_runs_may_end_when_the_master_is_about_to_stop() {
    let mut state = State::new(LEASE, LEASE);
    started(&mut state, arrives("a"));
    started(&mut state, submitted(1, 2));
    started(&mut state, Event::Drain);
    assert!(!state.is_idle());
    assert_eq!(started(&mut state, arrives("b")), []);
    let task = task(0, 1);
    let through = Event::Delivered {
        worker: "a".to_owned(),
        task,
        left: 0,
    };
    assert_eq!(started(&mut state, through), []);
    assert!(state.is_idle());
    assert_eq!(state.jobs[&1][0].status, Status::Done);
}

/// An extent that was done before is neither placed nor digitized again, unless others need its rows.
#[test]
fn a_resumed_job_repeats_only_what_is_needed() {
    let mut state = State::new(LEASE, LEASE);
    for worker in ["a", "b", "c", "d", "e"] {
        apply(&mut state, Duration::ZERO, arrives(worker));
    }
    let resumed = Event::Submitted {
        job: 1,
        extents: 5,
        halos: Some(neighbours(5, 1)),
        done: BTreeSet::from([0, 1, 4]),
    };
    let commands = apply(&mut state, Duration::ZERO, resumed);
    let placed = commands.iter().map(|command| match command {
        Command::Place { task, .. } => task.extent,
        other => panic!("{other:?}"),
    });
    assert_eq!(placed.collect::<Vec<_>>(), [1, 2, 3, 4]);
    let all = Event::Submitted {
        job: 2,
        extents: 2,
        halos: None,
        done: BTreeSet::from([0, 1]),
    };
    let commands = apply(&mut state, Duration::ZERO, all);
    assert!(matches!(commands[..], [Command::Complete { job: 2 }]));
}

pub(super) fn placed(worker: &str, extent: u32, attempt: u32) -> Event {
    let worker = worker.to_owned();
    let task = task(extent, attempt);
    Event::Placed { worker, task }
}

pub(super) fn delivered(worker: &str, extent: u32, attempt: u32) -> Event {
    let worker = worker.to_owned();
    let task = task(extent, attempt);
    let left = 0;
    Event::Delivered { worker, task, left }
}

fn halo_lost(worker: &str, extent: u32, attempt: u32, source: TaskId) -> Event {
    Event::Failed {
        worker: worker.to_owned(),
        task: task(extent, attempt),
        step: Step::Digitize,
        fault: Fault::Halo {
            source,
            reason: "test".to_owned(),
        },
    }
}

#[test]
fn an_extent_starts_once_all_that_it_needs_is_placed() {
    let mut state = with_workers(&["a", "b"]);
    let begin = told(&mut state, halo_job(3));
    assert_eq!(begin, ["place 0.1 on a", "place 1.1 on b"]);
    // Fewer workers than extents: one holds two, and nothing starts before they are placed.
    let more = told(&mut state, placed("a", 0, 1));
    assert_eq!(more, ["place 2.1 on a"]);
    assert!(told(&mut state, placed("b", 1, 1)).is_empty());
    assert_eq!(
        told(&mut state, placed("a", 2, 1)),
        [
            "start 0.1 on a: 0.1@a 1.1@b",
            "start 1.1 on b: 1.1@b 0.1@a 2.1@a"
        ]
    );
    assert_eq!(
        told(&mut state, delivered("a", 0, 1)),
        ["keep 0.1", "start 2.1 on a: 2.1@a 1.1@b"]
    );
    assert_eq!(told(&mut state, delivered("b", 1, 1)), ["keep 1.1"]);
    let end = told(&mut state, delivered("a", 2, 1));
    assert_eq!(end, ["keep 2.1", "complete"]);
}

#[test]
fn rows_that_cannot_be_had_are_placed_elsewhere_and_their_holder_stays() {
    let mut state = with_workers(&["a", "b", "c"]);
    told(&mut state, halo_job(2));
    told(&mut state, placed("a", 0, 1));
    told(&mut state, placed("b", 1, 1));
    // The holder was digitizing the extent itself: that goes to the new one with the rows.
    assert_eq!(
        told(&mut state, halo_lost("b", 1, 1, task(0, 1))),
        ["abort 0.1", "place 0.2 on c"]
    );
    assert!(state.knows("a", 1) && state.knows("b", 1));
    assert_eq!(
        told(&mut state, placed("c", 0, 2)),
        ["start 0.2 on c: 0.2@c 1.1@b", "start 1.2 on b: 1.1@b 0.2@c"]
    );
    // Who asked for rows that have moved on since asks again, and nobody is to blame.
    assert_eq!(
        told(&mut state, halo_lost("b", 1, 2, task(0, 1))),
        ["start 1.3 on b: 1.1@b 0.2@c"]
    );
}

#[test]
fn rows_of_a_done_extent_are_placed_again_if_others_need_them() {
    let mut state = with_workers(&["a", "b", "c"]);
    told(&mut state, halo_job(3));
    for (worker, extent) in [("a", 0), ("b", 1), ("c", 2)] {
        told(&mut state, placed(worker, extent, 1));
    }
    assert_eq!(told(&mut state, delivered("a", 0, 1)), ["keep 0.1"]);
    assert_eq!(told(&mut state, delivered("c", 2, 1)), ["keep 2.1"]);
    let started_anew = Event::Registered {
        worker: "a".to_owned(),
        incarnation: 2,
    };
    assert_eq!(told(&mut state, started_anew), ["place 0.2 on a"]);
    // It got the rows in time after all: nobody is left busy with a job that is over.
    let end = told(&mut state, delivered("b", 1, 1));
    assert_eq!(end, ["keep 1.1", "abort 0.2", "complete"]);
    assert!(state.workers.values().all(|w| w.task.is_none()));
}

/// Two workers that reach the master but not each other: one of them does it all.
#[test]
fn a_pair_that_is_cut_off_from_each_other_ends_its_job() {
    let mut state = with_workers(&["a", "b"]);
    told(&mut state, halo_job(2));
    told(&mut state, placed("a", 0, 1));
    told(&mut state, placed("b", 1, 1));
    assert_eq!(
        told(&mut state, halo_lost("a", 0, 1, task(1, 1))),
        ["abort 1.1", "place 1.2 on a"]
    );
    let stale = told(&mut state, halo_lost("b", 1, 1, task(0, 1)));
    assert!(stale.is_empty(), "{stale:?}");
    assert_eq!(
        told(&mut state, placed("a", 1, 2)),
        ["start 0.2 on a: 0.1@a 1.2@a"]
    );
    assert_eq!(
        told(&mut state, delivered("a", 0, 2)),
        ["keep 0.2", "start 1.2 on a: 1.2@a 0.1@a"]
    );
    let end = told(&mut state, delivered("a", 1, 2));
    assert_eq!(end, ["keep 1.2", "complete"]);
}

/// Rows that nobody can serve to anybody fail the job, and say so.
#[test]
fn rows_that_are_lost_too_often_fail_the_job() {
    let mut state = with_workers(&["a", "b"]);
    told(&mut state, halo_job(2));
    told(&mut state, placed("a", 0, 1));
    told(&mut state, placed("b", 1, 1));
    let (mut done, mut told_last) = (false, Vec::new());
    for _ in 0..100 {
        // Whoever runs an extent loses the other's rows; whoever is to hold rows takes them.
        let busy = state
            .workers
            .iter()
            .find_map(|(name, w)| Some((name.clone(), w.task?)));
        let Some((name, (id, step))) = busy else {
            done = true;
            break;
        };
        told_last = match step {
            Step::Place => told(&mut state, placed(&name, id.extent, id.attempt)),
            Step::Digitize => {
                let other = state.jobs[&1][1 - id.extent as usize].held();
                let source = other.map_or(task(1 - id.extent, 1), |held| held.id);
                told(&mut state, halo_lost(&name, id.extent, id.attempt, source))
            }
        };
    }
    assert!(done, "{told_last:?}");
    assert!(
        told_last.iter().any(|c| c.contains("fail: extent")),
        "{told_last:?}"
    );
}
