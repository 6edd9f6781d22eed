//! From a path to the program of a machine: where its axes are, how long each move takes, and the files.

use std::path::Path;

use horma_core::{Station, ToolPath, course, peaks, steady, timing};
use horma_formats::job::JobFile;
use horma_formats::post::{self, Heading, Pass, Placed};
use horma_formats::report::{PassStatistics, ProgramStatistics, Ran};
use horma_formats::{apt, output};

use crate::error::Result;
use crate::passes::Passes;

/// Writes the program of all passes into `dir`.
pub(crate) fn write(
    dir: &Path,
    passes: &Passes,
    file: &JobFile,
    heading: &Heading,
) -> Result<ProgramStatistics> {
    let program = &file.program;
    let planned = planned(passes, file)?;
    let all = planned.iter().map(|p| Pass {
        title: &p.name,
        course: &p.course,
        feed: p.feed,
    });
    let all: Vec<Pass> = all.collect();
    let placed = Placed::new(&all, file.clear(), &file.job.cutter, program)?;
    placed.check_range(&file.machine.ranges)?;
    let ran = planned
        .iter()
        .zip(placed.passes())
        .map(|(planned, placed)| {
            let limits = file.machine.limits(program, planned.feed, planned.turns);
            let timing = timing(placed.course, &limits);
            Ran {
                figures: PassStatistics {
                    name: planned.name.clone(),
                    path: planned.path.clone(),
                    positions: placed.course.len() as u64,
                    length: placed.course.windows(2).map(|w| w[0].cut(&w[1])).sum(),
                    seconds: timing.durations.iter().sum(),
                    deepest_cut: planned.deepest,
                },
                peaks: peaks(placed.course, &timing.durations),
                steady: steady(&planned.course, &limits),
                timing,
            }
        });
    let ran: Vec<Ran> = ran.collect();
    let durations: Vec<Vec<f64>> = ran.iter().map(|r| r.timing.durations.clone()).collect();
    let files = post::save(dir, &placed, &durations, program, heading)?;
    if program.apt {
        let apt = dir.join(output::APT);
        apt::save(&apt, &placed, &durations, &file.job.cutter, heading)?;
    }
    Ok(ProgramStatistics::of(program, files, ran))
}

/// A pass that is going to be placed.
struct Planned {
    name: String,
    /// The file of its path.
    path: String,
    course: Vec<Station>,
    /// mm/min
    feed: f64,
    /// Most turns of the part a minute.
    turns: Option<f64>,
    /// The most that it takes, mm.
    deepest: Option<f64>,
}

fn planned(passes: &Passes, file: &JobFile) -> Result<Vec<Planned>> {
    let course_of = |path: &ToolPath| {
        let positions = path.trajectory.positions;
        course(path).ok_or(horma_formats::Error::NoContact { positions })
    };
    let mut all = Vec::new();
    if let Some(roughing) = &file.roughing {
        for (number, layer) in (1..).zip(&passes.layers) {
            all.push(Planned {
                name: format!("rough {number}"),
                path: output::rough_name(number),
                course: course_of(&layer.path)?,
                feed: roughing.feed,
                turns: roughing.turns,
                deepest: Some(layer.deepest),
            });
        }
    }
    all.push(Planned {
        name: "finish".to_owned(),
        path: output::PATH.to_owned(),
        course: course_of(&passes.finish)?,
        feed: file.program.feed,
        turns: None,
        deepest: passes.deepest,
    });
    Ok(all)
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
    let passes = match &program.passes[..] {
        [_] => String::new(),
        passes => {
            let passes = passes
                .iter()
                .map(|p| format!("{} {:.1} s", p.name, p.seconds));
            let passes: Vec<String> = passes.collect();
            format!(" ({})", passes.join(", "))
        }
    };
    format!(
        "cutting takes {:.1} s{passes}{steady}; moves bound by {}",
        program.seconds,
        bounds.join(", ")
    )
}
