//! From a path to the program of a machine: where its axes are, how long each move takes, and the files.

use std::path::Path;

use horma_core::{ToolPath, course, steady, timing};
use horma_formats::job::JobFile;
use horma_formats::post::{self, Heading, Placed};
use horma_formats::report::ProgramStatistics;
use horma_formats::{apt, output};

use crate::error::Result;

/// Writes the program of `path` into `dir`.
pub(crate) fn write(
    dir: &Path,
    path: &ToolPath,
    file: &JobFile,
    heading: &Heading,
) -> Result<ProgramStatistics> {
    let program = &file.program;
    let course = course(path).ok_or(horma_formats::Error::NoContact {
        positions: path.trajectory.positions,
    })?;
    let placed = Placed::new(&course, &file.job.cutter, program)?;
    placed.check_range(&file.machine.ranges)?;
    let limits = file.machine.limits(program);
    let timing = timing(&placed.stations, &limits);
    let files = post::save(dir, &placed, &timing.durations, program, heading)?;
    if program.apt {
        apt::save(
            &dir.join(output::APT),
            &placed.stations,
            &timing.durations,
            &file.job.cutter,
            (program.feed, program.clearance),
            heading,
        )?;
    }
    let steady = steady(&course, &limits);
    Ok(ProgramStatistics::of(
        program,
        files,
        &placed.stations,
        &timing,
        steady,
    ))
}

/// What the user wants to know at once.
pub(crate) fn describe(program: &ProgramStatistics) -> String {
    let bounds = program.bounds.iter().filter(|(_, share)| *share >= 0.01);
    let bounds: Vec<String> = bounds
        .map(|(name, share)| format!("{name} {:.0} %", 100.0 * share))
        .collect();
    let steady = program.steady.map_or(String::new(), |s| {
        format!(
            ", {:.1} s at a steady {:.2} turns a minute",
            s.seconds, s.turns
        )
    });
    format!(
        "cutting takes {:.1} s{steady}; moves bound by {}",
        program.seconds,
        bounds.join(", ")
    )
}
