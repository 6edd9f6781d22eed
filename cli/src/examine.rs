//! What is to be told of a path, a run's or one from elsewhere, once it is verified: what it leaves of the part, and
//! what its last then measures.

use std::time::Instant;

use horma_core::{Designed, Machined, Part, Phase, Position, Shaped};
use horma_formats::job::JobFile;
use horma_formats::lasts::Lasts;
use horma_formats::report::MachinedStatistics;

use crate::error::Result;
use crate::machined::Spacing;
use crate::pipeline::phase;
use crate::{lasts, machined, verify};

/// A path and what it is about.
pub(crate) struct Subject<'a> {
    pub part: &'a Part,
    /// Its surface, if that is at hand.
    pub designed: Option<Designed>,
    pub file: &'a JobFile,
    pub shaped: Option<&'a Shaped>,
    pub positions: &'a [Position],
}

/// What was found.
pub(crate) struct Examined {
    pub surface: Option<Machined>,
    pub machined: Option<MachinedStatistics>,
    pub last: Option<Lasts>,
    pub phases: Vec<Phase>,
}

/// Looks at a path, on `threads` threads; tells which phase it is at. Without rays nothing is told of the surface that
/// it leaves.
pub(crate) fn examine(
    subject: Subject,
    rays: Option<Spacing>,
    threads: usize,
    tell: &dyn Fn(&'static str),
) -> Result<Examined> {
    let Subject {
        part,
        designed,
        file,
        shaped,
        positions,
    } = subject;
    let mut phases = Vec::new();
    let tolerance = verify::tolerance(file);
    let surface = match rays {
        None => None,
        Some(rays) => {
            tell("machine");
            let begin = Instant::now();
            let made = machined::surface(part, designed, file, positions, rays, threads)?;
            phases.push(phase("machine", begin));
            Some(made)
        }
    };
    let last = match shaped {
        None => None,
        Some(shaped) => {
            tell("measure");
            let begin = Instant::now();
            let measured = lasts::figures(file, shaped, surface.as_ref())?;
            phases.push(phase("measure", begin));
            measured
        }
    };
    let machined = surface.as_ref();
    let machined = machined.map(|s| MachinedStatistics::of(s, tolerance));
    Ok(Examined {
        surface,
        machined,
        last,
        phases,
    })
}
