//! `run`, `submit` and `fetch`: a job's path made here, by local workers, or by a master elsewhere. They differ
//! only in who computes.

use std::path::Path;

use horma_core::{Method, Simd};
use horma_formats::csv;
use horma_formats::job::{self, JobFile};
use horma_formats::output::{self, Staging};
use horma_formats::report::{self, PathStatistics, Report};
use horma_proto::{VERSION, trace};
use tokio_util::sync::CancellationToken;
use tracing::{Instrument, info_span};

use crate::args;
use crate::client::Remote;
use crate::cluster::Workers;
use crate::error::{Error, Result};
use crate::pipeline::{Asked, Prepared, Task, perform, progress, read, unless};
use crate::progress::{Audience, Display, Event};
use crate::serve::runtime;
use crate::{cluster, forecast, here, say, sizes, submit, system, watch};

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
        async |task, file| {
            let threads = args.threads.map(usize::from);
            let simd = args.simd.unwrap_or_else(Simd::best);
            let (workers, sharing) = (file.cluster.workers, file.cluster.sharing);
            if workers == 0 {
                let threads = threads.unwrap_or_else(system::cores);
                let run = here::run_all(task, threads, simd);
                return run.instrument(info_span!("digitize")).await;
            }
            let progress = progress(task.display);
            let workers = Workers {
                number: workers,
                threads: threads.unwrap_or(1),
                simd,
                otlp: args.traces.otlp.as_ref().map(|to| &*to.url),
            };
            let run = cluster::run(task.part, task.jobs, sharing, workers, progress);
            // Dropping it stops the workers.
            Ok(unless(task.stop, run).await?.into())
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
        async |task, file| {
            let Task {
                part,
                jobs,
                display,
                stop,
            } = task;
            display.tell("send", 0, 0);
            let name = name_of(&args.job.file);
            check_divisible(file)?;
            for job in jobs {
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
            perform(&asked, None, None, &stop, async |task, _| {
                let progress = progress(task.display);
                let fetched = unless(task.stop, submit::fetch(&remote, id, wait, &progress)).await;
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
