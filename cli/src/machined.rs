//! The machined surface of a path: computed, written, pictured and measured.

use horma_core::{Machined, Outline, Rays, Simd, Spot, discretize};
use horma_formats::output::{self, Staging};
use horma_formats::{map, ply};
use serde::Serialize;

use crate::args;
use crate::error::Result;
use crate::{say, system, verify};

/// What is told of a machined surface; lengths in mm.
#[derive(Debug, Serialize)]
struct Figures {
    /// Rays from the spindle, and those of them that meet both surfaces.
    rays: usize,
    compared: usize,
    /// Where the cutter went deepest into the designed surface, if it did.
    deepest_gouge: Option<Spot>,
    /// Where most is left.
    largest_excess: Option<Spot>,
    /// Share of the compared rays with no more than the tolerance between the two, if the job has one.
    within_tolerance: Option<f64>,
}

/// Makes the machined surface of a path from a file.
pub(crate) fn machined(args: &args::Machined) -> Result<()> {
    let (part, file, positions) = verify::read(&args.path, &args.job, &args.made)?;
    output::prepare_dir_of(&args.output, output::of_machined)?;
    let threads = args.threads.map_or_else(system::cores, usize::from);
    let surface = system::pool(threads)?.install(|| {
        let model = discretize(&part, file.job.discretization)?;
        let rays = Rays::over(Outline::span(&model.outlines), args.spacing, args.columns)?;
        let cutter = &file.job.cutter;
        horma_core::machined(&model.rows, cutter, &positions, rays, Simd::best())
    })?;
    let tolerance = verify::tolerance(&file);
    let figures = figures(&surface, tolerance);
    let staging = Staging::begin_of(&args.output, output::of_machined)?;
    ply::save(&staging.file(output::MACHINED_MESH), &surface)?;
    map::save(&staging.file(output::MACHINED_MAP), &surface)?;
    staging.publish()?;
    if args.json {
        say(&serde_json::to_string_pretty(&figures).unwrap_or_default());
    } else {
        say(&describe(&figures, tolerance));
        for name in [output::MACHINED_MESH, output::MACHINED_MAP] {
            say(&args.output.join(name).display().to_string());
        }
    }
    Ok(())
}

fn figures(surface: &Machined, tolerance: Option<f64>) -> Figures {
    let compared = || surface.deviation.iter().flatten();
    let within = |tolerance: f64| {
        let within = compared().filter(|d| d.abs() <= tolerance).count();
        within as f64 / compared().count().max(1) as f64
    };
    Figures {
        rays: surface.rays.len(),
        compared: compared().count(),
        deepest_gouge: surface.deepest().filter(|spot| spot.deviation < 0.0),
        largest_excess: surface.highest().filter(|spot| spot.deviation > 0.0),
        within_tolerance: tolerance.map(within),
    }
}

fn describe(figures: &Figures, tolerance: Option<f64>) -> String {
    let spot = |name: &str, spot: &Option<Spot>| match spot {
        None => format!("{name}: none"),
        Some(s) => format!(
            "{name}: {:.4} mm at x {:.3}, {:.1}°",
            s.deviation.abs(),
            s.x,
            s.angle
        ),
    };
    let within = figures.within_tolerance.zip(tolerance);
    let within = within.map_or(String::new(), |(share, tolerance)| {
        format!(
            "\nwithin {tolerance} mm of the designed surface: {:.1} %",
            100.0 * share
        )
    });
    format!(
        "{} rays from the spindle, {} of them meet both surfaces\n{}\n{}{within}",
        figures.rays,
        figures.compared,
        spot("deepest gouge", &figures.deepest_gouge),
        spot("largest excess", &figures.largest_excess),
    )
}
