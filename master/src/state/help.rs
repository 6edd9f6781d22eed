//! Helping: when nothing waits for an idle worker, it takes what would be done last.
//!
//! That is an extent whose rows are held by someone who is late with another one, or else an extent at
//! which someone late is. Its rows come from the master with the task, whatever the distribution: who
//! holds them may be the one that is stuck. Two are at an extent at most.

use std::collections::BTreeMap;
use std::time::Duration;

use super::assign::task;
use super::{Command, Extent, State, Status, Step};

/// Something to help with.
struct Case {
    job: u64,
    extent: usize,
    reason: String,
    /// What nobody is at comes first, then what takes longest, in seconds.
    rank: (bool, f64),
}

/// Gives idle workers what others are late with.
pub(super) fn help(state: &mut State, now: Duration, commands: &mut Vec<Command>) {
    let idle = state.workers.iter().filter(|(_, w)| w.task.is_none());
    let idle: Vec<String> = idle.map(|(name, _)| name.clone()).collect();
    for name in idle {
        let Some(case) = latest(state, now, &name) else {
            continue;
        };
        let (Some(extents), Some(worker)) =
            (state.jobs.get_mut(&case.job), state.workers.get_mut(&name))
        else {
            continue;
        };
        let extent = &mut extents[case.extent];
        extent.attempts += 1;
        extent.only_placed = false;
        extent.status = Status::Running;
        let task = task(case.job, case.extent as u32, extent);
        worker.take(now, task, Step::Digitize);
        commands.push(Command::Start {
            worker: name,
            task,
            rows: Vec::new(),
            helps: Some(case.reason),
        });
    }
}

/// What would be done last, of all that this worker has not failed.
fn latest(state: &State, now: Duration, name: &String) -> Option<Case> {
    let mut at: BTreeMap<(u64, u32), Vec<&String>> = BTreeMap::new();
    for (name, worker) in &state.workers {
        if let Some((task, Step::Digitize)) = worker.task {
            at.entry((task.job, task.extent)).or_default().push(name);
        }
    }
    let late = |worker: &String| state.workers[worker].pace.late(now);
    let case = |job: u64, i: usize, extent: &Extent| {
        if extent.failed_by.contains(name) {
            return None;
        }
        let (reason, rank) = match (extent.status, at.get(&(job, i as u32)).map(Vec::as_slice)) {
            (Status::Running, Some(&[worker])) => {
                (format!("worker {worker} is late"), (false, late(worker)?))
            }
            (Status::Waiting, _) => {
                let holder = &extent.held()?.worker;
                let digitizes = |(_, step)| step == Step::Digitize;
                state.workers[holder].task.filter(|&t| digitizes(t))?;
                let reason = format!("worker {holder}, which holds its rows, is late with others");
                (reason, (true, late(holder)?))
            }
            _ => return None,
        };
        Some(Case {
            job,
            extent: i,
            reason,
            rank,
        })
    };
    let all = state.jobs.iter().flat_map(|(&job, extents)| {
        let extents = extents.iter().enumerate();
        extents.filter_map(move |(i, extent)| case(job, i, extent))
    });
    // Of equals the first.
    all.reduce(|best, next| if next.rank > best.rank { next } else { best })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::tests::{
        delivered, halo_job, neighbours, placed, submitted, task, told_at, with_workers,
    };
    use super::super::{Event, Fault};
    use super::*;

    fn progress(worker: &str, extent: u32, attempt: u32, came: u64, left: u64) -> Event {
        Event::Progress {
            worker: worker.to_owned(),
            task: task(extent, attempt),
            came,
            left,
        }
    }

    fn failed(worker: &str, extent: u32, attempt: u32, fault: Fault) -> Event {
        Event::Failed {
            worker: worker.to_owned(),
            task: task(extent, attempt),
            step: Step::Digitize,
            fault,
        }
    }

    const NOTHING: [&str; 0] = [];

    /// Two extents at two workers, of which b is through after 4 s, and a has done so much.
    fn one_is_through(came: u64, left: u64) -> (State, Vec<String>) {
        let mut state = with_workers(&["a", "b"]);
        told_at(0, &mut state, submitted(1, 2));
        told_at(2, &mut state, progress("a", 0, 1, came, left));
        let told = told_at(4, &mut state, delivered("b", 1, 1));
        (state, told)
    }

    #[test]
    fn who_is_through_helps_who_is_late() {
        let (mut state, told) = one_is_through(100, 900);
        assert_eq!(told, ["keep 1.1", "start 0.2 on b: ; worker a is late"]);
        assert_eq!(told_at(5, &mut state, Event::Tick), NOTHING);
        // Whoever brings the last position: the other one is free.
        let end = told_at(6, &mut state, delivered("b", 0, 2));
        assert_eq!(end, ["keep 0.2", "abort 0.1", "complete"]);
        assert!(state.workers.values().all(|w| w.task.is_none()));
        let (mut state, _) = one_is_through(100, 900);
        let end = told_at(6, &mut state, delivered("a", 0, 1));
        assert_eq!(end, ["keep 0.1", "abort 0.2", "complete"]);
    }

    #[test]
    fn who_is_nearly_through_is_left_alone() {
        let (mut state, told) = one_is_through(900, 100);
        assert_eq!(told, ["keep 1.1"]);
        // But not for ever: it has stopped.
        assert_eq!(
            told_at(9, &mut state, Event::Tick),
            NOTHING,
            "2 s to get ready"
        );
        let late = told_at(40, &mut state, progress("a", 0, 1, 900, 100));
        assert_eq!(late, ["start 0.2 on b: ; worker a is late"]);
    }

    #[test]
    fn who_sends_nothing_at_all_is_late_after_a_while() {
        let mut state = with_workers(&["a", "b"]);
        told_at(0, &mut state, submitted(1, 1));
        assert_eq!(told_at(9, &mut state, Event::Tick), NOTHING);
        let heard = |worker: &str| Event::Heartbeat {
            worker: worker.to_owned(),
        };
        told_at(9, &mut state, heard("a"));
        let late = told_at(10, &mut state, heard("b"));
        assert_eq!(late, ["start 0.2 on b: ; worker a is late"]);
    }

    #[test]
    fn a_third_one_is_not_needed() {
        let mut state = with_workers(&["a", "b", "c"]);
        told_at(0, &mut state, submitted(1, 1));
        let told = told_at(2, &mut state, progress("a", 0, 1, 10, 900));
        assert_eq!(told, ["start 0.2 on b: ; worker a is late"]);
        assert_eq!(told_at(9, &mut state, Event::Tick), NOTHING);
    }

    /// Of two that are at an extent one may fail, and the other one goes on.
    #[test]
    fn an_extent_does_not_wait_while_somebody_is_at_it() {
        let (mut state, _) = one_is_through(100, 900);
        let lost = Fault::Lost("test".to_owned());
        assert_eq!(told_at(5, &mut state, failed("a", 0, 1, lost)), NOTHING);
        // What it had brought may be missing after all, and then somebody has to bring that.
        let short = Event::Delivered {
            worker: "b".to_owned(),
            task: task(0, 2),
            left: 7,
        };
        assert_eq!(told_at(6, &mut state, short), ["start 0.3 on b: "]);
        let end = told_at(7, &mut state, delivered("b", 0, 3));
        assert_eq!(end, ["keep 0.3", "complete"]);
    }

    #[test]
    fn two_that_differ_fail_the_job() {
        let (mut state, _) = one_is_through(100, 900);
        let different = Fault::Different { attempt: 1 };
        assert_eq!(
            told_at(5, &mut state, failed("b", 0, 2, different)),
            [
                "abort 0.1",
                "fail: attempts 1 and 2 at extent 0 brought different positions"
            ]
        );
    }

    /// Rows that wait for their holder go to an idle worker, from the master; who needs them still gets
    /// them from the holder.
    #[test]
    fn what_a_late_holder_has_in_store_is_taken_from_it() {
        let mut state = with_workers(&["a", "b"]);
        told_at(0, &mut state, halo_job(4));
        for (worker, extent) in [("a", 0), ("b", 1), ("a", 2), ("b", 3)] {
            told_at(0, &mut state, placed(worker, extent, 1));
        }
        told_at(2, &mut state, progress("a", 0, 1, 10, 900));
        told_at(2, &mut state, delivered("b", 1, 1));
        let told = told_at(3, &mut state, delivered("b", 3, 1));
        let why = "worker a, which holds its rows, is late with others";
        assert_eq!(told, ["keep 3.1", &format!("start 2.2 on b: ; {why}")]);
        let told = told_at(4, &mut state, delivered("b", 2, 2));
        assert_eq!(told, ["keep 2.2", "start 0.2 on b: ; worker a is late"]);
    }

    /// A worker that was about three times as fast holds three times as many rows.
    #[test]
    fn the_faster_one_holds_more() {
        let mut state = with_workers(&["a", "b"]);
        told_at(0, &mut state, submitted(7, 2));
        for (worker, extent, came) in [("a", 0, 100), ("b", 1, 290)] {
            let mut task = task(extent, 1);
            task.job = 7;
            let worker = worker.to_owned();
            let left = 0;
            let came = Event::Progress {
                worker: worker.clone(),
                task,
                came,
                left,
            };
            told_at(10, &mut state, came);
            told_at(10, &mut state, Event::Delivered { worker, task, left });
        }
        // Each needs all others, so nobody digitizes before all are placed.
        let halos = Some(neighbours(8, 8));
        let (job, extents) = (1, 8);
        let wide = Event::Submitted {
            job,
            extents,
            halos,
            done: BTreeSet::new(),
        };
        told_at(10, &mut state, wide);
        for _ in 0..8 {
            let placing = |w: &super::super::Worker| w.task.filter(|(_, s)| *s == Step::Place);
            let next = state
                .workers
                .iter()
                .find_map(|(n, w)| Some((n.clone(), placing(w)?)));
            let (worker, (task, _)) = next.expect("somebody takes rows");
            told_at(10, &mut state, Event::Placed { worker, task });
        }
        let held = |name: &str| {
            let held = state.jobs[&1].iter().filter_map(Extent::held);
            held.filter(|held| held.worker == name).count()
        };
        assert_eq!((held("a"), held("b")), (2, 6));
    }
}
