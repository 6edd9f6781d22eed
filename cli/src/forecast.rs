//! `run --dry-run`: what a job would be, before it is one. Nothing is written.
//!
//! All but the time is what the run itself decides, by the same code; the time is extrapolated from a few
//! positions that are digitized here.

use std::fmt;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use horma_core::{
    BodyRecord, Digitizer, Distribution, Extent, Handout, Method, Outline, Plan, Simd,
};
use horma_formats::job::JobFile;
use serde::Serialize;

use crate::args;
use crate::error::Result;
use crate::pipeline::{Prepared, read};
use crate::progress::{Audience, Display, Event};
use crate::run::check_divisible;
use crate::{say, system};

/// Runs of positions that are tried, spread over the job, and the length of each.
const RUNS: u64 = 32;
const RUN: u64 = 32;

/// Steps from one run to the next that is tried; it shares no factor with their number, so that they are
/// spread however many there is time for.
const STRIDE: u64 = 13;

/// Trying ends after this.
const ENOUGH: Duration = Duration::from_secs(1);

/// What a job would be.
#[derive(Debug, Serialize)]
pub(crate) struct Forecast {
    files: Vec<PathBuf>,
    warnings: Vec<String>,
    bodies: Vec<BodyRecord>,
    memory: Memory,
    /// 0: in this process.
    workers: u32,
    distribution: &'static str,
    threads: usize,
    /// Reading the part off its surfaces, as it took just now, s.
    discretize: f64,
    /// In the order in which they are computed.
    passes: Vec<Pass>,
}

/// Bytes.
#[derive(Debug, Serialize)]
struct Memory {
    /// By the pass that needs most.
    needed: u64,
    available: u64,
}

/// One computation of heights: for the finishing pass, or for what a roughing aims at.
#[derive(Debug, Serialize)]
struct Pass {
    name: &'static str,
    positions: u64,
    points_per_revolution: u32,
    /// First and last travel, mm.
    travel: [f64; 2],
    extents: Vec<Share>,
    seconds: Seconds,
}

/// What a worker would get.
#[derive(Debug, Serialize)]
struct Share {
    first: u64,
    positions: u64,
    /// mm
    travel: [f64; 2],
    rows: usize,
    /// Of these, how many are also another's.
    halo: usize,
    points: u64,
}

/// How long it takes, s.
#[derive(Debug, Serialize)]
struct Seconds {
    /// As it took just now, in one process.
    build: f64,
    /// On all threads; nothing if it cannot be told from a few positions.
    digitize: Option<f64>,
    /// Positions that were tried for it.
    tried: u64,
}

/// The passes of a job; one without a roughing has the last one.
const PASSES: [&str; 2] = ["rough", "finish"];

/// Tells what a run would do.
pub(crate) fn tell(args: &args::Run) -> Result<()> {
    let audience = args.job.how.audience();
    let display = Display::new(audience);
    let forecast = forecast(args, &display);
    display.finish();
    let forecast = forecast.inspect_err(|error| display.failed(error))?;
    display.event(&Event::Plan { plan: &forecast });
    if audience != Audience::Programs {
        say(forecast.to_string().trim_end());
    }
    Ok(())
}

fn forecast(args: &args::Run, display: &Display) -> Result<Forecast> {
    display.tell("read", 0, 0);
    let Prepared {
        part,
        file,
        warnings,
        ..
    } = read(&args.job.file, &args.job.how.overrides(args.workers))?;
    let targets = file.targets()?;
    let JobFile { job, cluster, .. } = &file;
    let available = system::memory();
    let distribution = match cluster.workers {
        0 => Distribution::Overlap,
        _ => {
            check_divisible(&file)?;
            cluster.sharing.distribution
        }
    };
    let mut needed = 0;
    for job in &targets {
        needed = Handout::predict(&part, job, distribution, available, true)?.max(needed);
    }
    display.tell("discretize", 0, 0);
    let begin = Instant::now();
    let mut model = Plan::new(&part, *job, available)?.model;
    let discretize = begin.elapsed().as_secs_f64();

    let threads = match (cluster.workers, args.threads.map(usize::from)) {
        (0, threads) => threads.unwrap_or_else(system::cores),
        (workers, threads) => (workers as usize * threads.unwrap_or(1)).min(system::cores()),
    };
    let simd = args.simd.unwrap_or_else(Simd::best);
    let parts = cluster.workers * cluster.sharing.extents_per_worker;
    let names = &PASSES[PASSES.len() - targets.len()..];
    let mut passes = Vec::new();
    for (name, job) in names.iter().zip(targets) {
        let plan = Plan::over(model, job, available)?;
        passes.push(pass(name, &plan, parts, threads, simd, display)?);
        model = plan.model;
    }
    Ok(Forecast {
        files: file.files.clone(),
        warnings,
        bodies: model.bodies,
        memory: Memory { needed, available },
        workers: cluster.workers,
        distribution: distribution.name(),
        threads,
        discretize,
        passes,
    })
}

/// What a plan would be in so many `parts`, by a few of its positions that are tried.
fn pass(
    name: &'static str,
    plan: &Plan,
    parts: u32,
    threads: usize,
    simd: Simd,
    display: &Display,
) -> Result<Pass> {
    display.tell("build", 0, 0);
    let begin = Instant::now();
    let build = || Digitizer::new(&plan.job, &plan.model.rows, simd);
    let digitizer = system::pool(threads)?.install(build);
    let build = begin.elapsed().as_secs_f64();
    let total = plan.trajectory.positions;
    let (digitize, tried) = match plan.job.method {
        Method::Local(local) if local.needs_whole_path() => (None, 0),
        Method::Exact | Method::Brute | Method::Local(_) => {
            display.tell("try", 0, 0);
            let (each, tried) = system::pool(1)?.install(|| attempt(&digitizer, plan));
            (Some(each * total as f64 / threads as f64), tried)
        }
    };
    let extents = if parts == 0 {
        Vec::new()
    } else {
        plan.split(parts)
    };
    Ok(Pass {
        name,
        positions: total,
        points_per_revolution: plan.trajectory.points_per_revolution,
        travel: travel(plan, 0, total),
        extents: extents.iter().map(|e| share(plan, e)).collect(),
        seconds: Seconds {
            build,
            digitize,
            tried,
        },
    })
}

/// Digitizes a few positions on this thread: seconds for each, and how many they were.
fn attempt(digitizer: &Digitizer, plan: &Plan) -> (f64, u64) {
    let total = plan.trajectory.positions;
    let begin = Instant::now();
    let mut tried = 0;
    for run in 0..RUNS {
        let first = (u128::from(total) * u128::from(run * STRIDE % RUNS) / u128::from(RUNS)) as u64;
        let positions = first..total.min(first + RUN);
        tried += positions.end - positions.start;
        digitizer.run_chunks(&plan.trajectory, positions, |_, _| true);
        if begin.elapsed() > ENOUGH {
            break;
        }
    }
    (begin.elapsed().as_secs_f64() / tried.max(1) as f64, tried)
}

fn travel(plan: &Plan, first: u64, count: u64) -> [f64; 2] {
    let travel = plan.trajectory.travel_of(first, count);
    [travel.low, travel.high]
}

fn share(plan: &Plan, extent: &Extent) -> Share {
    let outline = |row: &u32| -> &Outline { &plan.model.outlines[*row as usize] };
    Share {
        first: extent.first,
        positions: extent.count,
        travel: travel(plan, extent.first, extent.count),
        rows: extent.rows.len(),
        halo: extent.rows.len() - extent.own.len(),
        points: extent.rows.iter().map(|row| outline(row).points).sum(),
    }
}

impl fmt::Display for Forecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        for body in &self.bodies {
            let grid = match body.columns {
                Some(columns) => format!("{} rows of {columns} points", body.rows),
                None => format!("a mesh of {} points in {} slabs", body.points, body.rows),
            };
            let deviation = body.deviation;
            let deviation = deviation.map_or(String::new(), |d| {
                format!(", within {d:.4} mm of the surface")
            });
            let [low, high] = body.x;
            writeln!(
                f,
                "{}: {grid}, {} facets, x {low:.3} to {high:.3} mm{deviation}",
                body.name, body.facets
            )?;
        }
        let mb = |bytes: u64| bytes as f64 / 1e6;
        writeln!(
            f,
            "memory: {:.1} MB of {:.0} MB to be had",
            mb(self.memory.needed),
            mb(self.memory.available)
        )?;
        let (threads, discretize) = (self.threads, self.discretize);
        writeln!(f, "time: discretize {discretize:.2} s")?;
        for pass in &self.passes {
            let [from, to] = pass.travel;
            writeln!(
                f,
                "{}: {} positions, {} a revolution, travel {from:.3} to {to:.3} mm",
                pass.name, pass.positions, pass.points_per_revolution
            )?;
            let Seconds {
                build,
                digitize,
                tried,
            } = &pass.seconds;
            write!(f, "time: build {build:.2} s, digitize ")?;
            match digitize {
                Some(seconds) => writeln!(
                    f,
                    "about {seconds:.2} s on {threads} threads (by {tried} positions that were tried)"
                )?,
                None => writeln!(f, "unknown: this method goes over the whole path first")?,
            }
            if self.workers > 0 {
                self.write_extents(f, &pass.extents)?;
            }
        }
        writeln!(
            f,
            "verification, measuring and writing come on top; nothing was written"
        )
    }
}

impl Forecast {
    /// What each worker would get.
    fn write_extents(&self, f: &mut fmt::Formatter<'_>, extents: &[Share]) -> fmt::Result {
        writeln!(
            f,
            "{} workers, distribution {}, {} extents:",
            self.workers,
            self.distribution,
            extents.len()
        )?;
        writeln!(
            f,
            "extent   positions  travel, mm               rows   of these halo      points"
        )?;
        for (i, e) in extents.iter().enumerate() {
            let travel = format!("{:.3} to {:.3}", e.travel[0], e.travel[1]);
            writeln!(
                f,
                "{i:>6} {:>11}  {travel:<22} {:>6} {:>15} {:>11}",
                e.positions, e.rows, e.halo, e.points
            )?;
        }
        Ok(())
    }
}
