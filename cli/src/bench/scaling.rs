//! `bench scaling`: clusters of this machine's processes against one process, and what that says of
//! larger ones.
//!
//! `runs` measures, `summary` takes medians, `model` fits the papers' model and projects; `tables` and
//! `diagrams` show them. A projection is never mixed with what was measured.

mod diagrams;
mod model;
mod runs;
mod summary;
mod tables;

use std::io::Write;

use horma_core::{Job, Method, Motion};
use horma_formats::job::Overrides;
use horma_formats::output::{self, Staging};
use horma_formats::plot;

use crate::args::{BenchScaling, Search};
use crate::error::{Error, Result};
use crate::progress::{Audience, Display};
use crate::serve::{NOTICE, runtime};
use crate::{say, system};
use runs::{Case, Run};

/// What was measured, and on what.
#[derive(Debug)]
struct Experiment {
    /// What was typed.
    command: String,
    /// Part, cutter, motion and grid in words.
    subject: String,
    /// What brute force does of it, if it is asked for.
    thinned: String,
    /// Rows that any extent needs, the papers' n.
    rows: u64,
    /// Cores that this process may use.
    cores: usize,
    load: f64,
    runs: Vec<Run>,
    network: model::Network,
}

/// Measures, prints the tables and writes the results.
pub(crate) fn scaling(args: &BenchScaling) -> Result<()> {
    let display = Display::new(Audience::unless(args.quiet));
    let measured = measure_and_write(args, &display);
    display.finish();
    say(measured?.trim_end());
    Ok(())
}

fn measure_and_write(args: &BenchScaling, display: &Display) -> Result<String> {
    let overrides = Overrides {
        tolerance: args.tolerance,
        ..args.motion.overrides()
    };
    let (file, name, part) = super::read(args.job.as_deref(), &overrides, display)?;
    output::prepare_dir_of(&args.output, output::of_scaling)?;
    let load = system::load();
    let cases = cases(args, file.job);
    let runtime = runtime()?;
    let runs = runtime.block_on(async {
        tokio::select! {
            () = system::interrupted() => Err(Error::Interrupted),
            runs = runs::all(&part, &cases, args.rounds, display) => runs,
        }
    });
    runtime.shutdown_timeout(NOTICE);
    let runs = runs?;
    let bodies = runs.first().map(|r| r.record.bodies.as_slice());
    let bodies = bodies.unwrap_or_default();
    let points: u64 = bodies.iter().map(|b| b.points).sum();
    let typed: Vec<String> = std::env::args().skip(1).collect();
    let experiment = Experiment {
        command: format!("horma {}", typed.join(" ")),
        subject: format!(
            "{name}, {points} points, {}, step {} mm, {} points a revolution",
            super::figures::described(&file.job.cutter),
            file.job.motion.step,
            file.job.motion.points_per_revolution,
        ),
        thinned: thinned(args, &file.job),
        rows: runs
            .iter()
            .filter_map(|r| r.record.traffic)
            .map(|t| t.rows_needed)
            .max()
            .unwrap_or(0),
        cores: system::cores(),
        load,
        runs,
        network: model::Network {
            gbit: args.network_gbit,
            latency_us: args.latency_us,
        },
    };
    write(args, &experiment)
}

/// Who takes turns: for each method one process, and then each cluster.
fn cases(args: &BenchScaling, job: Job) -> Vec<Case> {
    let mut cases = Vec::new();
    for &search in &args.method {
        let job = searched(args, job, search);
        let case = |cluster| Case {
            search,
            job,
            cluster,
        };
        cases.push(case(None));
        for &workers in &args.workers {
            cases.extend(
                args.distribution
                    .iter()
                    .map(|&way| case(Some((way, workers)))),
            );
        }
    }
    cases
}

fn searched(args: &BenchScaling, job: Job, search: Search) -> Job {
    match search {
        Search::Exact => Job {
            method: Method::Exact,
            ..job
        },
        Search::Brute => Job {
            method: Method::Brute,
            motion: Motion {
                points_per_revolution: thin(args, &job),
                ..job.motion
            },
            ..job
        },
    }
}

fn thin(args: &BenchScaling, job: &Job) -> u32 {
    (job.motion.points_per_revolution / args.thin).max(1)
}

fn thinned(args: &BenchScaling, job: &Job) -> String {
    if args.method.contains(&Search::Brute) {
        format!(" ({} by brute force)", thin(args, job))
    } else {
        String::new()
    }
}

/// Writes everything or nothing; returns the tables.
fn write(args: &BenchScaling, experiment: &Experiment) -> Result<String> {
    let summaries = summary::all(&experiment.runs);
    let fitted = model::fit(experiment.rows, &summaries);
    let projections = model::project(&summaries, &fitted, experiment.network);
    let diagrams = diagrams::all(experiment, &summaries, &fitted, &projections);
    let shown: Vec<(&str, &str)> = diagrams
        .iter()
        .map(|(name, plot)| (name.as_str(), plot.title.as_str()))
        .collect();
    let tables = tables::markdown(experiment, &summaries, &fitted, &projections, &shown);
    let staging = Staging::begin_of(&args.output, output::of_scaling)?;
    let write = |name: &str, text: &str| {
        output::write(&staging.file(name), |out| out.write_all(text.as_bytes()))
    };
    write(output::SCALING_TABLE, &tables)?;
    write(output::SCALING_FIGURES, &tables::csv(&experiment.runs))?;
    for (name, diagram) in &diagrams {
        write(name, &plot::svg(diagram))?;
    }
    staging.publish()?;
    Ok(tables)
}
