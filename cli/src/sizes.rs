//! `run --sizes --sides`: one job for several sizes of a last and for both feet, side by side.
//!
//! Every size and side is a run like any other, into a directory of its own; they differ only in what the
//! last is made of before it is digitized. All are written, or none.

use std::path::Path;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::thread;

use horma_core::Simd;
use horma_formats::job::{self, JobFile, Overrides, Side};
use horma_formats::output::{self, Staging};
use horma_formats::sizes::{self, Size, Sizes};
use horma_proto::VERSION;
use tokio_util::sync::CancellationToken;

use crate::args;
use crate::cluster::{self, Local, Workers};
use crate::error::{Error, Result};
use crate::pipeline::{Asked, Task, carry_out, progress, stop_when_interrupted, unless};
use crate::progress::{Audience, Display, Event};
use crate::serve::{NOTICE, runtime};
use crate::{here, say, system};

/// A size and side that is to be made.
struct Wanted {
    name: String,
    size: Option<f64>,
    side: Side,
    overrides: Overrides,
}

/// Runs a job for all sizes and sides.
pub(crate) fn run(args: &args::Run, output: &Path, stop: &CancellationToken) -> Result<()> {
    let audience = args.job.how.audience();
    let display = Display::new(audience);
    let made = make(args, output, &display, stop);
    display.finish();
    made.inspect_err(|error| display.failed(error))?;
    display.event(&Event::Done { directory: output });
    if audience == Audience::People {
        for name in [output::REPORT, output::VIEW] {
            say(&output.join(name).display().to_string());
        }
    }
    Ok(())
}

/// Makes all of them, and the report of all, or nothing.
fn make(
    args: &args::Run,
    output: &Path,
    display: &Display,
    stop: &CancellationToken,
) -> Result<()> {
    let (file, wanted) = wanted(args)?;
    output::prepare_sizes(output)?;
    let runtime = runtime()?;
    stop_when_interrupted(&runtime, stop);
    let staging = Staging::begin_of(output, output::of_sizes)?;
    let cluster = match file.cluster.workers {
        0 => None,
        number => Some(runtime.block_on(unless(
            stop.clone(),
            cluster::start(&Workers {
                number,
                threads: args.threads.map_or(1, usize::from),
                simd: args.simd.unwrap_or_else(Simd::best),
                otlp: args.traces.otlp.as_ref().map(|to| &*to.url),
            }),
        ))?),
    };
    let cores = system::cores();
    let lanes = cores.min(wanted.len()).max(1);
    let threads = args.threads.map_or(cores, usize::from).div_ceil(lanes);
    let queue = Mutex::new(wanted.iter().enumerate());
    let lane = || -> Result<Vec<(usize, Size)>> {
        let mut made = Vec::new();
        loop {
            let next = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((place, wanted)) = next else {
                return Ok(made);
            };
            let one = one(args, wanted, &staging, cluster.as_ref(), threads, stop);
            let size = runtime.block_on(one).inspect_err(|_| stop.cancel());
            let size = size.map_err(|source| match source {
                Error::Interrupted => source,
                _ => Error::OfSize {
                    name: wanted.name.clone(),
                    source: Box::new(source),
                },
            })?;
            display.note(&size.describe());
            made.push((place, size));
        }
    };
    let ended: Vec<_> = thread::scope(|scope| {
        let lanes: Vec<_> = (0..lanes).map(|_| scope.spawn(lane)).collect();
        let ended = lanes.into_iter().map(thread::ScopedJoinHandle::join);
        ended
            .map(|e| e.unwrap_or(Err(Error::Interrupted)))
            .collect()
    });
    runtime.block_on(async { drop(cluster) });
    runtime.shutdown_timeout(NOTICE);
    let made = all(ended)?;
    let report = Sizes {
        version: VERSION.to_owned(),
        job: args
            .job
            .file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        sizes: made,
    };
    sizes::save(staging.dir(), &report)?;
    staging.publish()?;
    Ok(())
}

/// What is asked for, in order of size, and the job that it is asked of.
fn wanted(args: &args::Run) -> Result<(JobFile, Vec<Wanted>)> {
    let overrides = args.job.how.overrides(args.workers);
    let sizes: Vec<Option<f64>> = match &args.sizes.sizes {
        None => vec![None],
        Some(list) => list.0.iter().copied().map(Some).collect(),
    };
    let mut sides: Vec<Option<&String>> = args.sizes.sides.iter().map(Some).collect();
    sides.sort();
    sides.dedup();
    if sides.is_empty() {
        sides.push(None);
    }
    let file = job::read(&args.job.file, &overrides)?;
    let mut wanted = Vec::new();
    for size in sizes {
        for side in &sides {
            let overrides = Overrides {
                size,
                side: side.cloned(),
                ..overrides.clone()
            };
            // What is wrong is said before anything is computed.
            let file = job::read(&args.job.file, &overrides)?;
            let made = file.last.as_ref().map_or(Side::Right, |last| last.side);
            wanted.push(Wanted {
                name: output::size_name(size, side.map(|_| made)),
                size,
                side: made,
                overrides,
            });
        }
    }
    Ok((file, wanted))
}

/// Makes one of them, into its directory.
async fn one(
    args: &args::Run,
    wanted: &Wanted,
    staging: &Staging,
    cluster: Option<&Local>,
    threads: usize,
    stop: &CancellationToken,
) -> Result<Size> {
    let output = staging.file(&wanted.name);
    let asked = Asked {
        file: &args.job.file,
        how: &args.job.how,
        output: &output,
    };
    // Several at once have no place for the progress of each.
    let display = Display::new(Audience::Nobody);
    let simd = args.simd.unwrap_or_else(Simd::best);
    let computing = async |task: Task, file: &JobFile| match cluster {
        Some(local) => {
            let (sharing, progress) = (file.cluster.sharing, progress(task.display));
            let run = local.run_all(task.part, task.jobs, sharing, &progress);
            Ok(unless(task.stop, run).await?.into())
        }
        None => here::run_all(task, threads, simd).await,
    };
    let carrying = carry_out(
        &asked,
        &wanted.overrides,
        Some(threads),
        &display,
        stop,
        computing,
    );
    let report = carrying.await?;
    let (name, side) = (wanted.name.clone(), wanted.side.name());
    Ok(Size::of(name, wanted.size, side, &report))
}

/// All that were made, in order; or what is wrong, before what was only stopped by it.
fn all(ended: Vec<Result<Vec<(usize, Size)>>>) -> Result<Vec<Size>> {
    let mut made = Vec::new();
    let mut stopped = None;
    for lane in ended {
        match lane {
            Ok(sizes) => made.extend(sizes),
            Err(Error::Interrupted) => stopped = Some(Error::Interrupted),
            Err(error) => return Err(error),
        }
    }
    if let Some(stopped) = stopped {
        return Err(stopped);
    }
    made.sort_by_key(|(place, _)| *place);
    Ok(made.into_iter().map(|(_, size)| size).collect())
}
