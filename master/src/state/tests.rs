//! What must hold after any order of events, and what each kind of event does.

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
        &Command::Start { ref worker, task } => Some((worker.as_str(), task.extent, task.attempt)),
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
