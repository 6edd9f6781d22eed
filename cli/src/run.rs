//! `run` and `submit`: from a job file to its results. They differ only in who computes.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use horma_core::{Job, Part, Phase, place};
use horma_formats::job::{self, JobFile};
use horma_formats::report::{self, PathStatistics, Report};
use horma_formats::{csv, gcode, output, part, preview};
use horma_master::{Outcome, Progress};
use horma_proto::VERSION;

use crate::args;
use crate::error::{Error, Result};
use crate::progress::Display;
use crate::serve::runtime;
use crate::{cluster, here, say, submit, system};

/// How long threads may take to notice an interrupt before the process ends without them.
const NOTICE: Duration = Duration::from_secs(2);

/// Computes a job in this process or on local workers.
pub(crate) fn run(args: &args::Run) -> Result<()> {
    perform(&args.job, args.workers, |part, file, display| {
        let threads = args.threads.map(usize::from);
        let (workers, job) = (file.cluster.workers, file.job);
        if workers == 0 {
            let threads = threads.unwrap_or_else(system::cores);
            return compute_here(part, job, threads, display);
        }
        let progress = progress(display);
        interruptible(cluster::run(
            part,
            job,
            workers,
            threads.unwrap_or(1),
            progress,
        ))
    })
}

/// Has a job computed by a master elsewhere.
pub(crate) fn submit(args: &args::Submit) -> Result<()> {
    perform(&args.job, None, |part, file, display| {
        let progress = progress(display);
        interruptible(submit::run(part, file.job, &args.master, progress))
    })
}

/// Reads a job, has it computed, and writes its results.
fn perform(
    args: &args::Job,
    workers: Option<u32>,
    compute: impl FnOnce(Part, &JobFile, &Display) -> Result<Outcome>,
) -> Result<()> {
    let file = job::read(&args.file, &args.overrides(workers))?;
    output::prepare_dir(&args.output)?;
    let display = Display::new(args.quiet);

    display.tell("read", 0, 0);
    let begin = Instant::now();
    let (part, warnings) = part::read_all(&file.files)?;
    let part = place(part, file.axis)?;
    let read = phase("read", begin);
    let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    for warning in &warnings {
        display.note(&format!("warning: {warning}"));
    }

    let (path, mut record) = compute(part.clone(), &file, &display)?;
    record.phases.insert(0, read);

    display.tell("write", 0, 0);
    let begin = Instant::now();
    let dir = args.output.as_path();
    let echo = file.echo();
    let heading = [
        ("job", &*args.file.to_string_lossy()),
        ("cutter", &described(&echo["cutter"])),
    ];
    // The program comes first: it alone can find the path of no use.
    gcode::save(&dir.join(output::PROGRAM), &path, file.program, &heading)?;
    csv::save(&dir.join(output::PATH), &path)?;
    preview::save(&dir.join(output::PREVIEW), &part, &path)?;
    record.phases.push(phase("write", begin));
    let report = Report {
        version: VERSION.to_owned(),
        job: echo,
        warnings,
        path: PathStatistics::of(&path),
        record,
    };
    report::save(&dir.join(output::REPORT), &report)?;
    display.finish();
    if !args.quiet {
        summarize(dir, &report);
    }
    Ok(())
}

/// A table of the job in words.
fn described(table: &serde_json::Value) -> String {
    let entries = table.as_object().into_iter().flatten();
    let entries: Vec<String> = entries
        .map(|(key, value)| format!("{key} {value}"))
        .collect();
    entries.join(", ")
}

fn phase(name: &str, begin: Instant) -> Phase {
    Phase {
        name: name.to_owned(),
        seconds: begin.elapsed().as_secs_f64(),
    }
}

fn progress(display: &Display) -> Progress {
    let display = display.clone();
    Arc::new(move |phase, done, total| display.tell(phase, done, total))
}

/// What the user wants to know at once.
fn summarize(dir: &Path, report: &Report) {
    let lost = match report.record.lost.len() {
        0 => String::new(),
        n => format!(
            "\n{n} attempts were lost and made again: see {}",
            output::REPORT
        ),
    };
    let path = &report.path;
    say(&format!(
        "{} positions, {} without contact{lost}\n{}\n{}\n{}\n{}",
        path.positions,
        path.without_contact,
        dir.join(output::PATH).display(),
        dir.join(output::PROGRAM).display(),
        dir.join(output::REPORT).display(),
        dir.join(output::PREVIEW).display(),
    ));
}

fn compute_here(part: Part, job: Job, threads: usize, display: &Display) -> Result<Outcome> {
    let runtime = runtime()?;
    let stop = Arc::new(AtomicBool::new(false));
    let outcome = runtime.block_on(async {
        let (display, stopped) = (display.clone(), stop.clone());
        let mut run =
            tokio::task::spawn_blocking(move || here::run(&part, job, threads, &display, &stopped));
        tokio::select! {
            outcome = &mut run => outcome.unwrap_or(Err(Error::Interrupted)),
            () = system::interrupted() => {
                stop.store(true, Ordering::Relaxed);
                Err(Error::Interrupted)
            }
        }
    });
    runtime.shutdown_timeout(NOTICE);
    outcome
}

/// Runs until it is done or the user interrupts it; dropping it stops whatever it started.
fn interruptible(run: impl Future<Output = Result<Outcome>>) -> Result<Outcome> {
    let runtime = runtime()?;
    let outcome = runtime.block_on(async {
        tokio::select! {
            outcome = run => outcome,
            () = system::interrupted() => Err(Error::Interrupted),
        }
    });
    runtime.shutdown_timeout(NOTICE);
    outcome
}
