//! The machined surface of a path: made for a run's report, and of any path by a command of its own.

use std::time::Instant;

use horma_core::{
    Coordinates, Counters, Designed, Digitizer, Discretization, Job, Machined, Model, Part,
    Position, Rays, Record, Simd, Waypoint, discretize,
};
use horma_formats::also::{self, Also, Sources};
use horma_formats::job::{JobFile, Overrides};
use horma_formats::output::{self, Staging};
use horma_formats::report::{self, MachinedStatistics, PathStatistics, Report};
use horma_formats::view::Findings;
use horma_formats::{csv, map, preview, view};
use horma_proto::VERSION;

use crate::args;
use crate::error::Result;
use crate::examine::{Subject, examine};
use crate::{pipeline, say, system, verify};

/// How far rays are apart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spacing {
    /// Along the spindle, mm.
    pub along: f64,
    /// Rays around it.
    pub columns: u32,
    /// Whether they may be farther apart along a part that is too long for them.
    pub or_farther: bool,
}

/// What does for a report.
pub(crate) const FOR_REPORT: Spacing = Spacing {
    along: 0.5,
    columns: 360,
    or_farther: true,
};

/// Most rays that nobody asked for.
const MOST: f64 = 1.0e6;

/// Chordal tolerance of the designed surface that a machined one is measured against, mm.
const FINE: f64 = 0.01;

/// How the designed surface of a job is discretized: it is compared with, so its facets have to be fine,
/// whatever the path was made of.
fn fine(job: &Job) -> Discretization {
    Discretization::Tolerance(match job.discretization {
        Discretization::Tolerance(tolerance) => tolerance.min(FINE),
        Discretization::Grid { .. } => FINE,
    })
}

/// The designed surface that was made for a job itself, if it is the one that [`surface`] would make.
pub(crate) fn at_hand(job: &Job, digitizer: Digitizer, model: &Model) -> Option<Designed> {
    let same = job.discretization == fine(job) && job.coordinates == Coordinates::Double;
    Designed::of(digitizer, model).filter(|_| same)
}

/// What a path leaves of a part, whose designed surface may be at hand.
pub(crate) fn surface(
    part: &Part,
    designed: Option<Designed>,
    file: &JobFile,
    positions: &[Position],
    spacing: Spacing,
    threads: usize,
) -> Result<Machined> {
    system::pool(threads)?.install(|| {
        let designed = match designed {
            Some(designed) => designed,
            None => {
                let model = discretize(part, fine(&file.job))?;
                Designed::new(&model, Simd::best())
            }
        };
        let span = designed.along;
        let mut along = spacing.along;
        if spacing.or_farther {
            along = along.max((span.high - span.low) * f64::from(spacing.columns) / MOST);
        }
        let rays = Rays::over(span, along, spacing.columns)?;
        let cutter = &file.job.cutter;
        let made = horma_core::machined(&designed, cutter, positions, rays, Simd::best());
        Ok(made?)
    })
}

/// Makes the machined surface of a path from a file, and tells all that is found of that path.
pub(crate) fn machined(args: &args::Machined) -> Result<()> {
    let begin = Instant::now();
    let rows = csv::read(&args.path)?;
    let overrides = Overrides {
        also: args.also.overrides(),
        ..args.made.overrides()
    };
    let prepared = pipeline::read(&args.job, &overrides)?;
    let (part, file) = (&prepared.part, &prepared.file);
    output::prepare_dir_of(&args.output, output::of_machined)?;
    let read = pipeline::phase("read", begin);
    let positions: Vec<Position> = rows.iter().map(csv::Row::position).collect();
    let subject = Subject {
        part,
        designed: None,
        file,
        shaped: prepared.shaped.as_ref(),
        positions: &positions,
    };
    let rays = Some(Spacing {
        along: args.spacing,
        columns: args.columns,
        or_farther: false,
    });
    let threads = args.threads.map_or_else(system::cores, usize::from);
    let mut phases = vec![read];
    let begin = Instant::now();
    let verified = if args.no_verify {
        None
    } else {
        Some(verify::check(part, &file.job, &positions, None, threads)?)
    };
    if verified.is_some() {
        phases.push(pipeline::phase("verify", begin));
    }
    let (verification, clearances) = verified.unzip();
    let found = examine(subject, rays, threads, &|_| {})?;
    phases.extend(found.phases);

    let begin = Instant::now();
    let cutter = &file.job.cutter;
    let rim = cutter.max_radius();
    let waypoints: Vec<Waypoint> = rows.iter().map(|row| row.waypoint(rim)).collect();
    let staging = Staging::begin_of(&args.output, output::of_machined)?;
    let sheets = preview::sheets(part);
    let sources = Sources {
        path: &waypoints,
        part: &sheets,
        machined: found.surface.as_ref(),
    };
    let asked = file.also.iter().filter(|a| **a != Also::MachinedPly);
    let also: Vec<Also> = [Also::MachinedPly].iter().chain(asked).copied().collect();
    for file in &also {
        also::save(*file, staging.dir(), &sources)?;
    }
    if let Some(surface) = &found.surface {
        map::save(&staging.file(output::MACHINED_MAP), surface)?;
    }
    let findings = Findings {
        clearances: clearances.as_ref(),
        machined: found.surface.as_ref(),
    };
    let seen = view::view(&sheets, cutter, &waypoints, None, findings);
    phases.push(pipeline::phase("write", begin));
    let report = Report {
        version: VERSION.to_owned(),
        job: prepared.job,
        files: prepared.sources,
        warnings: prepared.warnings,
        path: PathStatistics::of(waypoints.iter().copied(), &Counters::default()),
        verification,
        machined: found.machined,
        program: None,
        keep_outs: Vec::new(),
        roughing: None,
        last: found.last,
        record: Record {
            phases,
            ..Record::default()
        },
    };
    report::save(&staging.file(output::REPORT), &report)?;
    view::save(&staging.file(output::VIEW), &seen, &report)?;
    staging.publish()?;
    if args.json {
        say(&serde_json::to_string_pretty(&report.machined).unwrap_or_default());
        return Ok(());
    }
    let verification = report.verification.as_ref().map(verify::describe);
    let machined = report.machined.as_ref();
    let machined = machined.map(MachinedStatistics::describe);
    for told in [verification, machined].into_iter().flatten() {
        say(&told);
    }
    let always = [output::MACHINED_MAP, output::REPORT, output::VIEW];
    for name in always.into_iter().chain(also.iter().map(|a| a.name())) {
        say(&args.output.join(name).display().to_string());
    }
    Ok(())
}
