//! What is lost, and who answers for it: tasks with their workers, and rows with those that held them.

use horma_proto::TaskId;

use super::{Command, Fault, MAX_ATTEMPTS, Rows, State, Step, Worker, extent, fail, runs, stopped};
use crate::error::Error;

/// A worker failed a task: it leaves, and the extent waits for another. One that is merely cut off
/// comes back by registering again. For lost rows of others, the one that held them answers.
pub(super) fn lose(
    state: &mut State,
    name: &str,
    (task, step): (TaskId, Step),
    fault: Fault,
    commands: &mut Vec<Command>,
) {
    let wrong = matches!(fault, Fault::Wrong(_));
    let reason = match fault {
        Fault::Lost(reason) => format!("worker {name} was lost ({reason})"),
        Fault::Wrong(reason) => format!("worker {name} answered wrongly ({reason})"),
        Fault::Different { attempt } => {
            let attempts = (attempt, task.attempt);
            let extent = task.extent;
            return fail(
                state,
                task.job,
                Error::Different { extent, attempts },
                commands,
            );
        }
        Fault::Halo { source, reason } => {
            stopped(state, task);
            return lose_rows(state, name, source, &reason, commands);
        }
    };
    let Some(worker) = state.workers.remove(name) else {
        return;
    };
    if wrong {
        state.distrusted.insert(name.to_owned(), worker.incarnation);
    }
    state.last_loss = Some(reason.clone());
    forget(state, name);
    retry(state, name, task, step, reason, commands);
}

/// Rows could not be had from their holder, who stays a member: it may be the way from one worker to
/// another that is broken. Others are to hold them, and what the holder made of them so far is given
/// up: two that cannot reach each other would otherwise swap their rows for ever. Whoever asked for
/// rows that have found another holder since just asks again.
fn lose_rows(
    state: &mut State,
    asker: &str,
    source: TaskId,
    reason: &str,
    commands: &mut Vec<Command>,
) {
    let Some(extent) = extent(state, source) else {
        return;
    };
    let Some(held) = extent.held().filter(|held| held.id == source) else {
        return;
    };
    let holder = held.worker.clone();
    let reason = format!("worker {holder} did not give its rows to worker {asker} ({reason})");
    extent.rows = Rows::Nowhere;
    let running = state.workers.get_mut(&holder).and_then(|worker| {
        let same = |(t, _): &mut (TaskId, Step)| (t.job, t.extent) == (source.job, source.extent);
        worker.task.take_if(same)
    });
    if let Some((task, _)) = running {
        stopped(state, task);
        let reason = reason.clone();
        commands.push(Command::Abort { task, reason });
    }
    retry(state, &holder, source, Step::Place, reason, commands);
}

/// Puts an extent back, unless everybody has tried it, and that too often, and nobody is at it.
fn retry(
    state: &mut State,
    worker: &str,
    task: TaskId,
    step: Step,
    last: String,
    commands: &mut Vec<Command>,
) {
    if step == Step::Digitize {
        stopped(state, task);
    }
    let runs = runs(state, task);
    let Some(extents) = state.jobs.get_mut(&task.job) else {
        return;
    };
    let extent = &mut extents[task.extent as usize];
    if step == Step::Place {
        extent.rows = Rows::Nowhere;
    }
    extent.failures += 1;
    extent.failed_by.insert(worker.to_owned());
    let attempts = extent.failures;
    let someone_else = state.workers.keys().any(|w| !extent.failed_by.contains(w));
    if attempts >= MAX_ATTEMPTS && !someone_else && !runs {
        let error = Error::TooManyAttempts {
            extent: task.extent,
            attempts,
            last,
        };
        fail(state, task.job, error, commands);
    }
}

/// A worker leaves of its own will: what it had waits for others, and counts as nobody's failure.
pub(super) fn leave(state: &mut State, name: &str, commands: &mut Vec<Command>) {
    let Some(worker) = state.workers.remove(name) else {
        return;
    };
    let reason = format!("worker {name} left");
    state.last_loss = Some(reason.clone());
    forget(state, name);
    let Some((task, step)) = worker.task else {
        return;
    };
    match step {
        Step::Digitize => stopped(state, task),
        Step::Place => {
            if let Some(extent) = extent(state, task) {
                extent.rows = Rows::Nowhere;
            }
        }
    }
    commands.push(Command::Abort { task, reason });
}

/// What a worker had is gone with it: the rows it held, and its task.
pub(super) fn gone(
    state: &mut State,
    name: &str,
    worker: &Worker,
    reason: String,
    commands: &mut Vec<Command>,
) {
    forget(state, name);
    if let Some((task, step)) = worker.task {
        retry(state, name, task, step, reason.clone(), commands);
        commands.push(Command::Abort { task, reason });
    }
}

/// Counts no more on rows that a worker held.
fn forget(state: &mut State, name: &str) {
    for extent in state.jobs.values_mut().flatten() {
        if extent.held().is_some_and(|held| held.worker == name) {
            extent.rows = Rows::Nowhere;
        }
    }
}
