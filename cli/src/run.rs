//! `run` and `submit`: from a job file to its results. They differ only in who computes.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use horma_core::{Designed, Job, Method, Part, Phase, Record, Shaped, Simd, ToolPath, place};
use horma_formats::csv;
use horma_formats::job::{self, JobFile, Overrides};
use horma_formats::output::{self, Staging};
use horma_formats::part::{self, Assembled, Source};
use horma_formats::report::{self, PathStatistics, Report, RoughStatistics};
use horma_master::{Outcome, Progress};
use horma_proto::{VERSION, trace};
use tokio::runtime::Runtime;
use tokio_util::sync::CancellationToken;
use tracing::{Instrument, info_span};

use crate::args::{self, How};
use crate::client::Remote;
use crate::cluster::Workers;
use crate::error::{Error, Result};
use crate::examine::{Subject, examine};
use crate::machined::FOR_REPORT;
use crate::progress::{Audience, Display, Event};
use crate::results::{self, Made};
use crate::serve::{NOTICE, runtime};
use crate::{cluster, forecast, here, lasts, passes, say, sizes, submit, system, watch};

/// A job and where its results go.
pub(crate) struct Asked<'a> {
    pub file: &'a Path,
    pub how: &'a How,
    pub output: &'a Path,
}

/// Computes a job in this process or on local workers, once or with every change of it; or tells only what
/// would be done.
pub(crate) fn run(args: &args::Run) -> Result<()> {
    let Some(output) = args.output.as_deref().filter(|_| !args.dry_run) else {
        return forecast::tell(args);
    };
    let once = |stop: &CancellationToken| match args.sizes.asked() {
        true => sizes::run(args, output, stop),
        false => one(args, output, stop),
    };
    if !args.watch {
        return once(&CancellationToken::new());
    }
    let how = &args.job.how;
    let (overrides, display) = (how.overrides(args.workers), Display::new(how.audience()));
    watch::watch(&args.job.file, &overrides, &display, once)
}

/// Computes a job until `stop`.
fn one(args: &args::Run, output: &Path, stop: &CancellationToken) -> Result<()> {
    perform(
        &asked(&args.job, output),
        args.workers,
        args.threads.map(usize::from),
        stop,
        async |part, file, targets, display, stop| {
            let threads = args.threads.map(usize::from);
            let simd = args.simd.unwrap_or_else(Simd::best);
            let (workers, sharing) = (file.cluster.workers, file.cluster.sharing);
            if workers == 0 {
                let threads = threads.unwrap_or_else(system::cores);
                let run = here::run_all(part, targets, threads, simd, display, stop);
                return run.instrument(info_span!("digitize")).await;
            }
            let progress = progress(display);
            let workers = Workers {
                number: workers,
                threads: threads.unwrap_or(1),
                simd,
                otlp: args.traces.otlp.as_ref().map(|to| &*to.url),
            };
            let run = cluster::run(part, targets, sharing, workers, progress);
            // Dropping it stops the workers.
            Ok(unless(stop, run).await?.into())
        },
    )
}

/// Has a job computed by a master elsewhere, and waits for it unless it is told not to.
pub(crate) fn submit(args: &args::Submit) -> Result<()> {
    let remote = Remote::of(&args.remote)?;
    let Some(output) = &args.output else {
        return detach(&args.job, &remote);
    };
    let mut sent = Vec::new();
    perform(
        &asked(&args.job, output),
        None,
        None,
        &CancellationToken::new(),
        async |part, file, targets, display, stop| {
            display.tell("send", 0, 0);
            let name = name_of(&args.job.file);
            check_divisible(file)?;
            for job in targets {
                let sending = submit::send(&remote, &part, job, file.cluster.sharing, &name);
                let sending = trace::within(info_span!("send", otel.kind = "client"), sending);
                sent.push(unless(stop.clone(), sending).await?);
            }
            let progress = progress(display);
            let mut outcomes = Vec::new();
            for &id in &sent {
                let fetching = submit::fetch(&remote, id, true, &progress);
                let fetching = trace::within(info_span!("wait and fetch"), fetching);
                let fetched = unless(stop.clone(), fetching).await;
                if let Err(Error::Interrupted) = fetched {
                    for &id in &sent {
                        // If that does not reach the master, the job is merely done in vain.
                        let _ = submit::cancel(&remote, id).await;
                    }
                }
                outcomes.push(fetched?);
            }
            Ok(outcomes.into())
        },
    )?;
    leave(&remote, &sent)
}

fn asked<'a>(job: &'a args::Job, output: &'a Path) -> Asked<'a> {
    let args::Job { file, how } = job;
    Asked { file, how, output }
}

/// Sends a job and prints its number.
fn detach(args: &args::Job, remote: &Remote) -> Result<()> {
    let Prepared { part, file, .. } = read(&args.file, &args.how.overrides(None))?;
    check_divisible(&file)?;
    check_single(&file, "submit --detach")?;
    let (name, sharing) = (name_of(&args.file), file.cluster.sharing);
    let sending = submit::send(remote, &part, file.job, sharing, &name);
    let job = runtime()?.block_on(sending)?;
    match args.how.audience() {
        Audience::Programs => Display::new(Audience::Programs).event(&Event::Submitted { job }),
        Audience::People | Audience::Nobody => say(&job.to_string()),
    }
    Ok(())
}

/// Fetches what has come of a job that was sent before.
pub(crate) fn fetch(args: args::Fetch) -> Result<()> {
    let remote = Remote::of(&args.remote)?;
    let (id, wait, output) = (args.id, args.wait, args.output);
    match args.file {
        Some(file) => {
            check_single(&job::read(&file, &args.how.overrides(None))?, "fetch")?;
            let asked = Asked {
                file: &file,
                how: &args.how,
                output: &output,
            };
            let stop = CancellationToken::new();
            perform(&asked, None, None, &stop, async |_, _, _, display, stop| {
                let progress = progress(display);
                let fetched = unless(stop, submit::fetch(&remote, id, wait, &progress)).await;
                Ok(vec![fetched?].into())
            })?;
        }
        None => fetch_alone(&remote, id, wait, &output, args.how.audience())?,
    }
    if args.keep {
        return Ok(());
    }
    leave(&remote, &[id])
}

/// What is said of a path whose job is not known here.
const UNKNOWN: &str = "this path was fetched without its job file: it keeps out of nothing that the job's [[keep_out]] may name";

/// Fetches a path about whose part and machine nothing is known here.
fn fetch_alone(
    remote: &Remote,
    id: u64,
    wait: bool,
    output: &Path,
    audience: Audience,
) -> Result<()> {
    let runtime = runtime()?;
    output::prepare_dir(output)?;
    let display = Display::new(audience);
    let progress = progress(display.clone());
    let fetched = runtime.block_on(async {
        tokio::select! {
            () = system::interrupted() => Err(Error::Interrupted),
            fetched = submit::fetch(remote, id, wait, &progress) => fetched,
        }
    });
    display.finish();
    let (path, record) = fetched.inspect_err(|error| display.failed(error))?;
    let report = Report {
        version: VERSION.to_owned(),
        job: serde_json::Value::Null,
        files: Vec::new(),
        warnings: vec![UNKNOWN.to_owned()],
        path: PathStatistics::of(path.waypoints(), &record.counters),
        verification: None,
        machined: None,
        program: None,
        keep_outs: Vec::new(),
        roughing: None,
        last: None,
        record,
    };
    let staging = Staging::begin(output)?;
    csv::save(&staging.file(output::PATH), &path)?;
    report::save(&staging.file(output::REPORT), &report)?;
    staging.publish()?;
    display.event(&Event::Done { directory: output });
    if audience == Audience::People {
        say(&output.join(output::PATH).display().to_string());
    }
    Ok(())
}

/// Lets the master drop results that are written.
fn leave(remote: &Remote, jobs: &[u64]) -> Result<()> {
    let runtime = runtime()?;
    for &job in jobs {
        // The result is here; the master drops its own when it is old, if it does not hear of this.
        let _ = runtime.block_on(submit::discard(remote, job));
    }
    Ok(())
}

/// A job whose positions depend on those before them is not for several workers.
pub(crate) fn check_divisible(file: &JobFile) -> Result<()> {
    match file.job.method {
        Method::Local(local) if local.needs_whole_path() => Err(Error::OneProcess),
        _ => Ok(()),
    }
}

/// A job that is two for a master is not for a command that speaks of one.
fn check_single(file: &JobFile, command: &'static str) -> Result<()> {
    match file.roughing {
        Some(_) => Err(Error::OneJob { command }),
        None => Ok(()),
    }
}

/// What a job is called at a master.
fn name_of(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    name.chars().take(64).collect()
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
    pub part: Part,
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
    let (part, shaped) = lasts::shaped(&part, &mut file)?;
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
fn perform(
    asked: &Asked,
    workers: Option<u32>,
    threads: Option<usize>,
    stop: &CancellationToken,
    compute: impl AsyncFnOnce(Part, &JobFile, Vec<Job>, Display, CancellationToken) -> Result<Computed>,
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
    compute: impl AsyncFnOnce(Part, &JobFile, Vec<Job>, Display, CancellationToken) -> Result<Computed>,
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
    let targets = file.targets()?;
    let read = phase("read", begin);
    output::prepare_dir(asked.output)?;
    for warning in &warnings {
        display.warn(warning);
    }
    let computing = compute(part.clone(), &file, targets, display.clone(), stop.clone());
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
        let verifying = passes::verified(&part, &file, &passes, threads);
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

pub(crate) fn phase(name: &str, begin: Instant) -> Phase {
    Phase {
        name: name.to_owned(),
        seconds: begin.elapsed().as_secs_f64(),
    }
}

pub(crate) fn progress(display: Display) -> Progress {
    Arc::new(move |phase, done, total| display.tell(phase, done, total))
}
