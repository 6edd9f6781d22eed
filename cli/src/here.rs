//! A run in this process.

use std::time::Instant;

use horma_core::{Digitizer, Job, Part, Phase, Plan, Record, Simd, SubTrajectory, stitch};
use horma_master::Outcome;
use tokio_util::sync::CancellationToken;

use crate::error::{Error, Result};
use crate::progress::Display;
use crate::system;

/// Digitizes a part on `threads` threads of this process, until `stop`.
pub(crate) fn run(
    part: &Part,
    job: Job,
    threads: usize,
    simd: Simd,
    display: &Display,
    stop: &CancellationToken,
) -> Result<Outcome> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Threads(e.to_string()))?;
    pool.install(|| pipeline(part, job, simd, display, stop))
}

fn pipeline(
    part: &Part,
    job: Job,
    simd: Simd,
    display: &Display,
    stop: &CancellationToken,
) -> Result<Outcome> {
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

    display.tell("build", 0, 0);
    let begin = Instant::now();
    let digitizer = Digitizer::new(&job, &plan.model.rows, simd);
    timed("build", begin);

    let total = plan.trajectory.positions;
    display.tell("digitize", 0, total);
    let begin = Instant::now();
    let mut parts = Vec::new();
    let mut done = 0;
    let counters = digitizer.run_chunks(&plan.trajectory, 0..total, |first, touches| {
        done += touches.len() as u64;
        display.tell("digitize", done, total);
        parts.push(SubTrajectory { first, touches });
        !stop.is_cancelled()
    });
    timed("digitize", begin);
    if stop.is_cancelled() {
        return Err(Error::Interrupted);
    }

    display.tell("stitch", 0, 0);
    let begin = Instant::now();
    let path = stitch(plan.trajectory, parts)?;
    timed("stitch", begin);
    let record = Record {
        phases,
        bodies: plan.model.bodies,
        counters,
        ..Record::default()
    };
    Ok((path, record))
}
