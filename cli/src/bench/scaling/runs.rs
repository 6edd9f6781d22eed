//! The runs: real processes, each case in its turn, every path held against one process's.

use std::sync::Arc;
use std::time::Instant;

use horma_core::{Distribution, Job, Part, Record, Sharing, Simd, ToolPath};
use horma_formats::job::DEFAULT_EXTENTS_PER_WORKER;
use tokio_util::sync::CancellationToken;

use super::super::check;
use crate::args::Search;
use crate::cluster::{self, Workers};
use crate::error::{Error, Result};
use crate::progress::{Audience, Display};
use crate::{here, system};

/// What is run in every round.
#[derive(Debug, Clone, Copy)]
pub(super) struct Case {
    pub search: Search,
    pub job: Job,
    /// Nothing for one thread of this process.
    pub cluster: Option<(Distribution, u32)>,
}

impl Case {
    pub fn named(&self) -> String {
        match self.cluster {
            None => format!("{}, one process", self.search),
            Some((way, workers)) => format!("{}, {way}, workers: {workers}", self.search),
        }
    }
}

/// One run.
#[derive(Debug)]
pub(super) struct Run {
    pub case: Case,
    pub round: u32,
    /// Of the path, without those that were inserted.
    pub positions: u64,
    /// From the start of the processes to the path, s.
    pub wall: f64,
    /// Of which the workers were started and had registered, s.
    pub start: f64,
    /// CPU time of the master, or of the one process, s.
    pub own_cpu: f64,
    /// CPU time of each worker, s.
    pub worker_cpu: Vec<f64>,
    pub record: Record,
}

impl Run {
    /// CPU time of a worker on average, s.
    pub fn mean_cpu(&self) -> f64 {
        let workers = self.worker_cpu.len().max(1);
        self.all_cpu() / workers as f64
    }

    /// CPU time of the busiest worker, s.
    pub fn most_cpu(&self) -> f64 {
        self.worker_cpu.iter().copied().fold(0.0, f64::max)
    }

    /// CPU time of all workers, s.
    pub fn all_cpu(&self) -> f64 {
        // That of nobody is 0, where the library's sum has −0.
        self.worker_cpu.iter().fold(0.0, |sum, cpu| sum + cpu)
    }
}

/// Runs all cases in turn, as many rounds as asked for.
pub(super) async fn all(
    part: &Arc<Part>,
    cases: &[Case],
    rounds: u32,
    display: &Display,
) -> Result<Vec<Run>> {
    let mut runs = Vec::new();
    let mut reference: Option<ToolPath> = None;
    for round in 1..=rounds {
        for case in cases {
            let (run, path) = match case.cluster {
                None => alone(part.clone(), case, round).await?,
                Some((way, workers)) => spread(part.clone(), case, way, workers, round).await?,
            };
            display.note(&format!(
                "round {round} of {rounds}: {}: {:.2} s",
                case.named(),
                run.wall
            ));
            runs.push(run);
            match &reference {
                Some(one) if case.cluster.is_some() => same(&path, one, &case.named())?,
                _ => reference = Some(path),
            }
        }
    }
    Ok(runs)
}

fn same(path: &ToolPath, one: &ToolPath, what: &str) -> Result<()> {
    const ONE: &str = "one process";
    check::same(&path.touches, &one.touches, what, ONE)?;
    if path == one {
        return Ok(());
    }
    Err(Error::Differs {
        what: what.to_owned(),
        than: ONE,
        position: path.touches.len(),
    })
}

async fn alone(part: Arc<Part>, case: &Case, round: u32) -> Result<(Run, ToolPath)> {
    let (begin, job) = (Instant::now(), case.job);
    let before = own_cpu();
    let run = move || {
        let (quiet, stop) = (Display::new(Audience::Nobody), CancellationToken::new());
        here::run(&part, job, 1, Simd::best(), &quiet, &stop)
    };
    let ran = tokio::task::spawn_blocking(run).await;
    let ((path, record), _) = ran.unwrap_or(Err(Error::Interrupted))?;
    let run = Run {
        case: *case,
        round,
        positions: path.touches.len() as u64,
        wall: begin.elapsed().as_secs_f64(),
        start: 0.0,
        own_cpu: own_cpu() - before,
        worker_cpu: Vec::new(),
        record,
    };
    Ok((run, path))
}

async fn spread(
    part: Arc<Part>,
    case: &Case,
    way: Distribution,
    workers: u32,
    round: u32,
) -> Result<(Run, ToolPath)> {
    let begin = Instant::now();
    let workers = Workers {
        number: workers,
        threads: 1,
        simd: Simd::best(),
        otlp: None,
    };
    let local = cluster::start(&workers).await?;
    let start = begin.elapsed().as_secs_f64();
    // To start processes is no master's work.
    let before = own_cpu();
    let sharing = Sharing {
        distribution: way,
        extents_per_worker: DEFAULT_EXTENTS_PER_WORKER,
    };
    let silent = Arc::new(|_, _, _| {});
    let running = local.master.run(part, case.job, sharing, 1, silent);
    let (path, record) = running.await?;
    let run = Run {
        case: *case,
        round,
        positions: path.touches.len() as u64,
        wall: begin.elapsed().as_secs_f64(),
        start,
        own_cpu: own_cpu() - before,
        worker_cpu: system::cpu_seconds(&local.workers),
        record,
    };
    Ok((run, path))
}

fn own_cpu() -> f64 {
    system::cpu_seconds(&[std::process::id()]).iter().sum()
}
