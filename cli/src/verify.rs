//! Verification: a path held against the designed surface, on its own or at the end of a run.

use std::path::Path;
use std::sync::Arc;

use horma_core::{
    Clearances, Deviation, Discretization, Gouge, Job, Part, Position, Verification,
    verify_everywhere,
};
use horma_formats::csv;
use horma_formats::job::JobFile;

use crate::args;
use crate::error::{Error, Result};
use crate::{pipeline, say, system};

/// Verifies a path from a file.
pub(crate) fn verify(args: &args::Verify) -> Result<()> {
    let (part, file, positions) = read(&args.path, &args.job, &args.made)?;
    let threads = args.threads.map_or_else(system::cores, usize::from);
    let (verification, _) = check(&part, &file.job, &positions, args.spacing, threads)?;
    if args.json {
        say(&serde_json::to_string_pretty(&verification).unwrap_or_default());
    } else {
        say(&describe(&verification));
    }
    let tolerance = args.tolerance.or(tolerance(&file));
    let path_tolerance = file.job.motion.path_tolerance;
    tolerance.map_or(Ok(()), |t| hold(&verification, t, path_tolerance))
}

/// The positions of a path from a file, and its job with the part in place.
pub(crate) fn read(
    path: &Path,
    job: &Path,
    made: &args::Made,
) -> Result<(Arc<Part>, JobFile, Vec<Position>)> {
    let positions = csv::read(path)?.iter().map(csv::Row::position).collect();
    let pipeline::Prepared { part, file, .. } = pipeline::read(job, &made.overrides())?;
    Ok((part, file, positions))
}

/// Verifies positions on `threads` threads; also tells where what was found.
pub(crate) fn check(
    part: &Part,
    job: &Job,
    positions: &[Position],
    spacing: Option<f64>,
    threads: usize,
) -> Result<(Verification, Clearances)> {
    let (cutter, step) = (&job.cutter, Some(job.motion.step));
    Ok(system::pool(threads)?
        .install(|| verify_everywhere(part, cutter, step, positions, spacing))?)
}

/// How deep a path may gouge, if the job says so.
pub(crate) fn tolerance(file: &JobFile) -> Option<f64> {
    match file.job.discretization {
        Discretization::Tolerance(tolerance) => Some(tolerance),
        Discretization::Grid { .. } => None,
    }
}

/// Refuses a path that gouges deeper than `tolerance` at a position or, if it has a path tolerance,
/// deeper than both together on a straight move; mm.
pub(crate) fn hold(
    verification: &Verification,
    tolerance: f64,
    path_tolerance: Option<f64>,
) -> Result<()> {
    let found = verification.normal;
    let deeper = |gouge: Option<Gouge>, limit: f64| gouge.filter(|g| g.depth > limit);
    if let Some(gouge) = deeper(found.gouge, tolerance) {
        return Err(Error::Gouge {
            depth: gouge.depth,
            tolerance,
            point: gouge.point,
            position: gouge.position,
            x: gouge.x,
            angle: gouge.angle,
        });
    }
    let limit = path_tolerance.map_or(f64::INFINITY, |p| tolerance + p);
    if let Some(gouge) = deeper(found.motion_gouge, limit) {
        return Err(Error::MotionGouge {
            depth: gouge.depth,
            limit,
            point: gouge.point,
            position: gouge.position,
            x: gouge.x,
            angle: gouge.angle,
        });
    }
    Ok(())
}

/// What was found, in words.
pub(crate) fn describe(verification: &Verification) -> String {
    let depth = |gouge: &Option<Gouge>| match gouge {
        None => "none".to_owned(),
        Some(g) => format!("{:.4} mm at x {:.3}, {:.1}°", g.depth, g.x, g.angle),
    };
    let deviation = |name: &str, d: &Deviation| {
        let excess = match d.excess {
            None => "nothing reached".to_owned(),
            Some(e) => format!("{:.4} / {:.4} / {:.4} mm", e.median, e.p99, e.max),
        };
        format!(
            "{name}: deepest gouge {}; on the straight moves between positions {}; excess {excess} (median / 99 % / largest)",
            depth(&d.gouge),
            depth(&d.motion_gouge),
        )
    };
    let scallop = match (
        verification.scallop.measured,
        verification.scallop.predicted,
    ) {
        (Some(measured), Some(predicted)) => {
            format!("scallop: {measured:.4} mm, {predicted:.4} predicted")
        }
        (Some(measured), None) => format!("scallop: {measured:.4} mm"),
        (None, _) => "scallop: nothing to measure".to_owned(),
    };
    format!(
        "{} samples of the designed surface, {:.2} mm apart; {:.1} % never reached\n{}\n{}\n{scallop}",
        verification.samples,
        verification.spacing,
        100.0 * verification.never_reached,
        deviation("normal to the surface", &verification.normal),
        deviation("along the attack axis", &verification.attack),
    )
}
