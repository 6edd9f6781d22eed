//! From a job to its results: read, computed by whoever the command names, verified, examined and written.
//!
//! What is wrong with a job is said before anything is made. Nothing here knows who computes.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use horma_core::{Designed, Job, Part, Phase, Record, Shaped, ToolPath, place};
use horma_formats::job::{self, JobFile, Overrides};
use horma_formats::output;
use horma_formats::part::{self, Assembled, Source};
use horma_formats::report::{PathStatistics, Report, RoughStatistics};
use horma_master::{Outcome, Progress};
use horma_proto::{VERSION, trace};
use tokio::runtime::Runtime;
use tokio_util::sync::CancellationToken;
use tracing::info_span;

use crate::args::How;
use crate::error::{Error, Result};
use crate::examine::{Subject, examine};
use crate::machined::FOR_REPORT;
use crate::progress::{Audience, Display, Event};
use crate::results::{self, Made};
use crate::serve::{NOTICE, runtime};
use crate::{lasts, passes, system};

/// A job and where its results go.
pub(crate) struct Asked<'a> {
    pub file: &'a Path,
    pub how: &'a How,
    pub output: &'a Path,
}

/// What there is to compute, who hears of it, and what stops it.
pub(crate) struct Task {
    pub part: Arc<Part>,
    /// For each pass.
    pub jobs: Vec<Job>,
    pub display: Display,
    pub stop: CancellationToken,
}

/// What computing a job gave.
#[derive(Default)]
pub(crate) struct Computed {
    /// For each pass.
    pub outcomes: Vec<Outcome>,
    /// The part's designed surface, if that was made here on the way.
    pub designed: Option<Designed>,
}

impl From<Vec<Outcome>> for Computed {
    fn from(outcomes: Vec<Outcome>) -> Self {
        Self {
            outcomes,
            designed: None,
        }
    }
}

/// A job with its part in place.
pub(crate) struct Prepared {
    pub part: Arc<Part>,
    pub file: JobFile,
    /// The job as it is said, for the report: what is made of its last is not made of that again.
    pub job: serde_json::Value,
    /// Where the part comes from.
    pub sources: Vec<Source>,
    /// What there is to warn of.
    pub warnings: Vec<String>,
    /// The last in it, if the job speaks of one.
    pub shaped: Option<Shaped>,
}

/// Reads a job and its part, and puts the part in place.
pub(crate) fn read(file: &Path, overrides: &Overrides) -> Result<Prepared> {
    let mut file = job::read(file, overrides)?;
    let Assembled {
        part,
        sources,
        warnings,
    } = part::read_all(&file.files, &file.reading)?;
    let part = place(part, file.axis)?;
    let job = file.echo();
    let (part, shaped) = lasts::shaped(part, &mut file)?;
    Ok(Prepared {
        part,
        file,
        job,
        sources,
        warnings: warnings.iter().map(ToString::to_string).collect(),
        shaped,
    })
}

/// Reads a job, has it computed, and writes its results; stops when it is interrupted, as does what
/// computes, and by `stop`.
pub(crate) fn perform(
    asked: &Asked,
    workers: Option<u32>,
    threads: Option<usize>,
    stop: &CancellationToken,
    compute: impl AsyncFnOnce(Task, &JobFile) -> Result<Computed>,
) -> Result<()> {
    let runtime = runtime()?;
    stop_when_interrupted(&runtime, stop);
    let audience = asked.how.audience();
    let display = Display::new(audience);
    let performed = runtime.block_on(async {
        let overrides = asked.how.overrides(workers);
        carry_out(asked, &overrides, threads, &display, stop, compute).await
    });
    // Before anything else is said, and also if nothing good came of it.
    display.finish();
    runtime.shutdown_timeout(NOTICE);
    let report = performed.inspect_err(|error| display.failed(error))?;
    let directory = asked.output;
    display.event(&Event::Done { directory });
    if audience == Audience::People {
        results::summarize(directory, &report);
    }
    Ok(())
}

/// Cancels `stop` when the user interrupts this process.
pub(crate) fn stop_when_interrupted(runtime: &Runtime, stop: &CancellationToken) {
    let stop = stop.clone();
    runtime.spawn(async move {
        system::interrupted().await;
        stop.cancel();
    });
}

/// Reads a job, has it computed, and writes its results; what is wrong with the job is said before
/// there is a directory for them.
pub(crate) async fn carry_out(
    asked: &Asked<'_>,
    overrides: &Overrides,
    threads: Option<usize>,
    display: &Display,
    stop: &CancellationToken,
    compute: impl AsyncFnOnce(Task, &JobFile) -> Result<Computed>,
) -> Result<Report> {
    display.tell("read", 0, 0);
    let begin = Instant::now();
    let reading = || read(asked.file, overrides);
    let prepared = info_span!("read").in_scope(reading)?;
    let Prepared {
        part,
        file,
        job,
        sources,
        mut warnings,
        shaped,
    } = prepared;
    let jobs = file.targets()?;
    let read = phase("read", begin);
    output::prepare_dir(asked.output)?;
    for warning in &warnings {
        display.warn(warning);
    }
    let task = Task {
        part: part.clone(),
        jobs,
        display: display.clone(),
        stop: stop.clone(),
    };
    let computing = compute(task, &file);
    let needed = !asked.how.no_verify || file.also.iter().any(|a| a.needs_surface());
    let computed = computing.await?;
    let designed = computed.designed.filter(|_| needed);
    let (digitized, mut record) = of_finish(computed.outcomes);
    record.phases.insert(0, read);
    let threads = threads.unwrap_or_else(system::cores);
    let begin = Instant::now();
    let made = {
        let file = file.clone();
        let making = tokio::task::spawn_blocking(move || passes::passes(&file, digitized));
        let making = async { making.await.unwrap_or(Err(Error::Interrupted)) };
        unless(stop.clone(), making).await?
    };
    if file.roughing.is_some() {
        record.phases.push(phase("layers", begin));
    }
    let mut passes = made;
    for warning in passes.warnings(&file) {
        display.warn(&warning);
        warnings.push(warning);
    }
    let mut left = None;
    let verified = if asked.how.no_verify {
        None
    } else {
        display.tell("verify", 0, 0);
        let begin = Instant::now();
        let verifying = passes::verified(part.clone(), &file, &passes, threads);
        let verifying = trace::within(info_span!("verify"), verifying);
        let found = unless(stop.clone(), verifying).await?;
        record.phases.push(phase("verify", begin));
        if let Some((remains, deepest)) = found.roughing {
            left = remains;
            passes.deepest = deepest;
        }
        Some(found.finish)
    };
    let examining = {
        let (part, file, display) = (part.clone(), file.clone(), display.clone());
        let positions = passes.finish.positions();
        move || {
            let subject = Subject {
                part: &part,
                designed,
                file: &file,
                shaped: shaped.as_ref(),
                positions: &positions,
            };
            let rays = needed.then_some(FOR_REPORT);
            let tell = |phase| display.tell(phase, 0, 0);
            examine(subject, rays, threads, &tell)
        }
    };
    let examining = tokio::task::spawn_blocking(examining);
    let examining = async { examining.await.unwrap_or(Err(Error::Interrupted)) };
    let found = unless(stop.clone(), examining).await?;
    record.phases.extend(found.phases);
    let (verification, clearances) = verified.unzip();
    let report = Report {
        version: VERSION.to_owned(),
        job,
        files: sources,
        warnings,
        path: PathStatistics::of(passes.finish.waypoints(), &record.counters),
        verification,
        machined: found.machined,
        program: None,
        keep_outs: passes.raised.clone(),
        roughing: file.roughing.map(|_| RoughStatistics {
            layers: passes.layers.len() as u64,
            left,
        }),
        last: found.last,
        record,
    };
    let made = Made {
        part,
        file,
        passes,
        clearances,
        surface: found.surface,
    };
    let writing = || results::write(asked, &made, report, display, stop);
    info_span!("write").in_scope(writing)
}

/// What was digitized for each pass, and the record of the finishing pass with the phases of all of them.
fn of_finish(outcomes: Vec<Outcome>) -> (Vec<ToolPath>, Record) {
    let (mut paths, mut phases, mut last) = (Vec::new(), Vec::new(), Record::default());
    for (path, record) in outcomes {
        let before = std::mem::replace(&mut last, record).phases;
        phases.extend(before.into_iter().map(|phase| Phase {
            name: format!("rough: {}", phase.name),
            ..phase
        }));
        paths.push(path);
    }
    phases.append(&mut last.phases);
    last.phases = phases;
    (paths, last)
}

/// What comes of `work`, unless it is to stop.
pub(crate) async fn unless<T>(
    stop: CancellationToken,
    work: impl Future<Output = Result<T>>,
) -> Result<T> {
    tokio::select! {
        biased;
        () = stop.cancelled() => Err(Error::Interrupted),
        done = work => done,
    }
}

pub(crate) fn phase(name: &str, begin: Instant) -> Phase {
    Phase {
        name: name.to_owned(),
        seconds: begin.elapsed().as_secs_f64(),
    }
}

pub(crate) fn progress(display: Display) -> Progress {
    Arc::new(move |phase, done, total| display.tell(phase, done, total))
}
