//! `status` and `cancel`: the jobs of a master elsewhere.

use std::time::Duration;

use horma_proto::clock::unix_ms;
use horma_proto::wire::{JobStatus, Stage, StatusRequest};

use crate::args;
use crate::client::{Remote, short};
use crate::error::Result;
use crate::serve::runtime;
use crate::{say, submit};

/// Prints how far jobs are.
pub(crate) fn status(args: &args::Status) -> Result<()> {
    let remote = Remote::of(&args.remote)?;
    let jobs = runtime()?.block_on(remote.call(async |mut client, _| {
        let mut jobs: Vec<JobStatus> = Vec::new();
        loop {
            let (job, after) = (args.id, jobs.last().map_or(0, |last| last.job));
            let reply = client.status(short(StatusRequest { job, after })).await?;
            let reply = reply.into_inner();
            let more = reply.more && !reply.jobs.is_empty();
            jobs.extend(reply.jobs);
            if !more {
                return Ok(jobs);
            }
        }
    }))?;
    if args.json {
        let jobs: Vec<_> = jobs.iter().map(json).collect();
        say(&format!("{:#}", serde_json::Value::from(jobs)));
    } else {
        say(&table(&jobs, unix_ms()));
    }
    Ok(())
}

/// Ends a job.
pub(crate) fn cancel(args: &args::Cancel) -> Result<()> {
    let remote = Remote::of(&args.remote)?;
    runtime()?.block_on(submit::cancel(&remote, args.id))
}

fn json(job: &JobStatus) -> serde_json::Value {
    let progress = job.progress.as_ref();
    serde_json::json!({
        "id": job.job,
        "name": job.name,
        "stage": stage(job),
        "submitted_ms": job.submitted_ms,
        "ended_ms": (job.ended_ms > 0).then_some(job.ended_ms),
        "phase": progress.map(|p| &p.phase),
        "done": progress.map(|p| p.done),
        "total": progress.map(|p| p.total),
        "reason": (!job.reason.is_empty()).then_some(&job.reason),
    })
}

/// A line for each job, the newest last.
fn table(jobs: &[JobStatus], now_ms: u64) -> String {
    if jobs.is_empty() {
        return "no jobs".to_owned();
    }
    let line = |job: &JobStatus| {
        let age = Duration::from_millis(now_ms.saturating_sub(job.submitted_ms));
        let (id, stage, age, far) = (job.job, stage(job), age.as_secs(), far(job));
        format!("{id:>6}  {stage:<9}  {age:>7} s  {far:<24}  {}", job.name)
    };
    let head = format!(
        "{:>6}  {:<9}  {:>9}  {:<24}  name",
        "id", "stage", "age", ""
    );
    std::iter::once(head)
        .chain(jobs.iter().map(line))
        .collect::<Vec<_>>()
        .join("\n")
}

/// How far a job is, or why it is no farther.
fn far(job: &JobStatus) -> String {
    match &job.progress {
        Some(p) if p.total > 0 => {
            let percent = 100 * u128::from(p.done) / u128::from(p.total);
            format!("{} {percent} %", p.phase)
        }
        Some(p) => p.phase.clone(),
        None => job.reason.clone(),
    }
}

fn stage(job: &JobStatus) -> &'static str {
    match job.stage() {
        Stage::Unspecified => "unknown",
        Stage::Queued => "queued",
        Stage::Running => "running",
        Stage::Done => "done",
        Stage::Fetched => "fetched",
        Stage::Dropped => "dropped",
        Stage::Failed => "failed",
        Stage::Cancelled => "cancelled",
    }
}
