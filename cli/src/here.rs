//! A run in this process.

use std::time::Instant;

use horma_core::{
    Counters, Designed, Digitizer, Heuristic, Job, Local, Method, Part, Phase, Plan, Record, Simd,
    ToolPath, stitch,
};
use horma_master::Outcome;
use tokio_util::sync::CancellationToken;
use tracing::Span;

use crate::error::{Error, Result};
use crate::pipeline::{Computed, Task, unless};
use crate::progress::Display;
use crate::{machined, system};

/// Digitizes a part for one job after the other, beside the runtime, until `stop`.
pub(crate) async fn run_all(task: Task, threads: usize, simd: Simd) -> Result<Computed> {
    let Task {
        part,
        jobs,
        display,
        stop,
    } = task;
    let (stopped, span) = (stop.clone(), Span::current());
    let all = move || {
        let mut computed = Computed::default();
        let _within = span.entered();
        for job in jobs {
            let (outcome, designed) = run(&part, job, threads, simd, &display, &stopped)?;
            computed.outcomes.push(outcome);
            computed.designed = designed;
        }
        Ok(computed)
    };
    let all = tokio::task::spawn_blocking(all);
    unless(stop, async { all.await.unwrap_or(Err(Error::Interrupted)) }).await
}

/// Digitizes a part on `threads` threads of this process, until `stop`. The designed surface comes along if
/// that was digitized.
pub(crate) fn run(
    part: &Part,
    job: Job,
    threads: usize,
    simd: Simd,
    display: &Display,
    stop: &CancellationToken,
) -> Result<(Outcome, Option<Designed>)> {
    system::pool(threads)?.install(|| plan_and_digitize(part, job, simd, display, stop))
}

/// The same on the current thread pool.
fn plan_and_digitize(
    part: &Part,
    job: Job,
    simd: Simd,
    display: &Display,
    stop: &CancellationToken,
) -> Result<(Outcome, Option<Designed>)> {
    let mut phases = Vec::new();
    let mut timed = |name: &'static str, begin: Instant| {
        phases.push(Phase {
            name: name.to_owned(),
            seconds: begin.elapsed().as_secs_f64(),
        });
    };
    display.tell("discretize", 0, 0);
    let begin = Instant::now();
    let plan = Plan::new(part, job, system::memory())?;
    timed("discretize", begin);

    let (path, counters, designed, window) = match job.method {
        Method::Local(local) if local.needs_whole_path() => {
            display.tell("find the window", 0, 0);
            let begin = Instant::now();
            let rows = &plan.model.rows;
            let heuristic = Heuristic::new(&job, local, rows, &plan.trajectory, simd);
            let window = local.window.unwrap_or_else(|| heuristic.smallest_window());
            timed("find the window", begin);
            let (path, counters, designed) = if local.fallback {
                let window = Some(window);
                let method = Method::Local(Local { window, ..local });
                let job = Job { method, ..job };
                digitize(&plan, &job, simd, display, stop, &mut timed)?
            } else {
                display.tell("digitize", 0, 0);
                let begin = Instant::now();
                let (touches, counters) = heuristic.run(window);
                timed("digitize", begin);
                let trajectory = plan.trajectory;
                let path = ToolPath {
                    trajectory,
                    touches,
                    between: Vec::new(),
                };
                (path, counters, None)
            };
            (path, counters, designed, Some(window))
        }
        method => {
            let found = digitize(&plan, &job, simd, display, stop, &mut timed)?;
            let (path, counters, designed) = found;
            let window = match method {
                Method::Local(local) => local.window,
                Method::Exact | Method::Brute => None,
            };
            (path, counters, designed, window)
        }
    };
    let record = Record {
        phases,
        bodies: plan.model.bodies,
        counters,
        window,
        ..Record::default()
    };
    Ok(((path, record), designed))
}

/// Digitizes all positions and stitches what the threads found. The designed surface comes along if that was
/// digitized.
fn digitize(
    plan: &Plan,
    job: &Job,
    simd: Simd,
    display: &Display,
    stop: &CancellationToken,
    timed: &mut impl FnMut(&'static str, Instant),
) -> Result<(ToolPath, Counters, Option<Designed>)> {
    display.tell("build", 0, 0);
    let begin = Instant::now();
    let digitizer = Digitizer::new(job, &plan.model.rows, simd);
    timed("build", begin);

    let total = plan.trajectory.positions;
    display.tell("digitize", 0, total);
    let begin = Instant::now();
    let mut parts = Vec::new();
    let (mut inserted, mut fits) = (0, Ok(()));
    let counters = digitizer.run_chunks(&plan.trajectory, 0..total, |run, _| {
        display.tell("digitize", run.end(), total);
        inserted += run.between.len() as u64;
        fits = plan.check_inserted(inserted);
        parts.push(run);
        fits.is_ok() && !stop.is_cancelled()
    });
    timed("digitize", begin);
    if stop.is_cancelled() {
        return Err(Error::Interrupted);
    }
    fits?;

    display.tell("stitch", 0, 0);
    let begin = Instant::now();
    let path = stitch(plan.trajectory, parts)?;
    timed("stitch", begin);
    let designed = machined::at_hand(job, digitizer, &plan.model);
    Ok((path, counters, designed))
}
