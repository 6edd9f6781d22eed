//! `run` and `submit`: from a job file to its results. They differ only in who computes.

use std::panic::resume_unwind;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use horma_core::{Counters, Method, Part, Phase, Position, Simd, ToolPath, Verification, place};
use horma_formats::job::{self, JobFile};
use horma_formats::output::Staging;
use horma_formats::report::{self, PathStatistics, Report};
use horma_formats::{csv, gcode, output, part, preview};
use horma_master::{Outcome, Progress};
use horma_proto::VERSION;
use tokio_util::sync::CancellationToken;

use crate::args;
use crate::error::{Error, Result};
use crate::progress::Display;
use crate::serve::{NOTICE, runtime};
use crate::{cluster, here, say, submit, system, tls, verify};

/// Computes a job in this process or on local workers.
pub(crate) fn run(args: &args::Run) -> Result<()> {
    perform(
        &args.job,
        args.workers,
        args.threads.map(usize::from),
        async |part, file, display, stop| {
            let threads = args.threads.map(usize::from);
            let simd = args.simd.unwrap_or_else(Simd::best);
            let (workers, job) = (file.cluster.workers, file.job);
            let sharing = file.cluster.sharing;
            if workers == 0 {
                let threads = threads.unwrap_or_else(system::cores);
                let run = move || here::run(&part, job, threads, simd, &display, &stop);
                let run = tokio::task::spawn_blocking(run);
                return run.await.unwrap_or(Err(Error::Interrupted));
            }
            let progress = progress(display);
            let threads = threads.unwrap_or(1);
            cluster::run(part, job, sharing, workers, threads, simd, progress).await
        },
    )
}

/// Has a job computed by a master elsewhere.
pub(crate) fn submit(args: &args::Submit) -> Result<()> {
    let tls = tls::load(&args.tls)?;
    perform(&args.job, None, None, async |part, file, display, _| {
        if let Method::Local(local) = file.job.method
            && local.needs_whole_path()
        {
            return Err(Error::OneProcess);
        }
        let sharing = file.cluster.sharing;
        let (job, progress) = (file.job, progress(display));
        submit::run(part, job, sharing, &args.master, tls.as_ref(), progress).await
    })
}

/// Reads a job, has it computed, and writes its results; stops when it is interrupted.
fn perform(
    args: &args::Job,
    workers: Option<u32>,
    threads: Option<usize>,
    compute: impl AsyncFnOnce(Part, &JobFile, Display, CancellationToken) -> Result<Outcome>,
) -> Result<()> {
    let runtime = runtime()?;
    let stop = CancellationToken::new();
    let stopping = stop.clone();
    runtime.spawn(async move {
        system::interrupted().await;
        stopping.cancel();
    });
    let display = Display::new(args.quiet);
    let performed = runtime.block_on(async {
        let file = job::read(&args.file, &args.overrides(workers))?;
        output::prepare_dir(&args.output)?;
        display.tell("read", 0, 0);
        let begin = Instant::now();
        let (part, warnings) = part::read_all(&file.files)?;
        let part = place(part, file.axis)?;
        let read = phase("read", begin);
        let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        for warning in &warnings {
            display.note(&format!("warning: {warning}"));
        }
        let (path, mut record) = tokio::select! {
            biased;
            // Dropping the computation stops whatever it started.
            () = stop.cancelled() => return Err(Error::Interrupted),
            outcome = compute(part.clone(), &file, display.clone(), stop.clone()) => outcome?,
        };
        record.phases.insert(0, read);
        let verification = if args.no_verify {
            None
        } else {
            display.tell("verify", 0, 0);
            let begin = Instant::now();
            let threads = threads.unwrap_or_else(system::cores);
            let found = tokio::select! {
                biased;
                () = stop.cancelled() => return Err(Error::Interrupted),
                found = verified(part.clone(), file.clone(), path.positions(), threads) => found?,
            };
            record.phases.push(phase("verify", begin));
            Some(found)
        };
        let report = Report {
            version: VERSION.to_owned(),
            job: file.echo(),
            warnings,
            path: PathStatistics::of(&path, &record.counters),
            verification,
            record,
        };
        write(args, &file, &part, &path, report, &display, &stop)
    });
    // Before anything else is said, and also if nothing good came of it.
    display.finish();
    runtime.shutdown_timeout(NOTICE);
    let report = performed?;
    if !args.quiet {
        summarize(&args.output, &report);
    }
    Ok(())
}

/// Verifies a path beside the runtime, and refuses one that gouges deeper than the job's tolerance.
async fn verified(
    part: Part,
    file: JobFile,
    positions: Vec<Position>,
    threads: usize,
) -> Result<Verification> {
    let checking = tokio::task::spawn_blocking(move || {
        let found = verify::check(&part, &file, &positions, None, threads)?;
        if let Some(tolerance) = verify::tolerance(&file) {
            verify::hold(&found, tolerance, file.job.motion.path_tolerance)?;
        }
        Ok(found)
    });
    checking.await.unwrap_or(Err(Error::Interrupted))
}

/// Writes all results, or none.
fn write(
    args: &args::Job,
    file: &JobFile,
    part: &Part,
    path: &ToolPath,
    mut report: Report,
    display: &Display,
    stop: &CancellationToken,
) -> Result<Report> {
    display.tell("write", 0, 0);
    let begin = Instant::now();
    let going_on = || {
        if stop.is_cancelled() {
            Err(Error::Interrupted)
        } else {
            Ok(())
        }
    };
    let staging = Staging::begin(&args.output)?;
    let heading = [
        ("job", &*args.file.to_string_lossy()),
        ("cutter", &described(&report.job["cutter"])),
    ];
    // The picture takes about as long as the rest.
    let drawn = thread::scope(|scope| {
        let drawing = scope.spawn(|| preview::save(&staging.file(output::PREVIEW), part, path));
        gcode::save(&staging.file(output::PROGRAM), path, file.program, &heading)?;
        going_on()?;
        csv::save(&staging.file(output::PATH), path)?;
        Ok::<_, Error>(drawing.join().unwrap_or_else(|panic| resume_unwind(panic)))
    })?;
    going_on()?;
    // Nobody turns a picture: a path without one is as good.
    if let Err(error) = drawn {
        let warning = format!("there is no picture: {error}");
        display.note(&format!("warning: {warning}"));
        report.warnings.push(warning);
    }
    report.record.phases.push(phase("write", begin));
    report::save(&staging.file(output::REPORT), &report)?;
    staging.publish()?;
    Ok(report)
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

fn progress(display: Display) -> Progress {
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
    let window = report.record.window.map_or(String::new(), |window| {
        let Counters {
            lost, largest_loss, ..
        } = report.record.counters;
        format!(
            "\nwindows of {} rows and {} columns lost the winner {lost} times, by {largest_loss:.4} mm at most",
            window.delta_u, window.delta_v
        )
    });
    let verification = report.verification.as_ref();
    let verification = verification.map_or(String::new(), |v| format!("\n{}", verify::describe(v)));
    let path = &report.path;
    let inserted = match path.inserted {
        0 => String::new(),
        n => format!(", {n} of them inserted"),
    };
    let beyond = match path.beyond_tolerance {
        0 => String::new(),
        n => format!(
            "\n{n} straight moves stray farther than the path tolerance: there the height jumps"
        ),
    };
    say(&format!(
        "{} positions{inserted}, {} without contact{beyond}{lost}{window}{verification}\n{}\n{}\n{}\n{}",
        path.positions,
        path.without_contact,
        dir.join(output::PATH).display(),
        dir.join(output::PROGRAM).display(),
        dir.join(output::REPORT).display(),
        dir.join(output::PREVIEW).display(),
    ));
}
