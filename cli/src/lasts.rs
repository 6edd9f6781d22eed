//! A last in a job: in its size and for its side, measured as designed and as machined.

use std::path::Path;
use std::sync::Arc;

use horma_core::{Frame, Interval, Last, Machined, Part, Shaped, place, shape};
use horma_formats::csv;
use horma_formats::job::{JobFile, Side};
use horma_formats::lasts::{Lasts, figure};
use horma_formats::part::{self, Reading};

use crate::args;
use crate::error::{Error, Result};
use crate::machined::{self, FOR_REPORT};
use crate::{pipeline, say, system};

/// Puts the last that a job speaks of into the size and onto the side that are asked for; travels that the
/// job gives go with it.
pub(crate) fn shaped(part: Part, file: &mut JobFile) -> Result<(Arc<Part>, Option<Shaped>)> {
    let Some(of) = &file.last else {
        return Ok((Arc::new(part), None));
    };
    let shaped = shape(&part, &of.last, of.graded(), of.mirrored())?;
    let roughing = file.roughing.as_mut().map(|r| &mut r.motion);
    for motion in [&mut file.job.motion].into_iter().chain(roughing) {
        for travel in [&mut motion.from, &mut motion.to] {
            *travel = travel.map(|x| shaped.travel(x));
        }
    }
    let kept = file.keep_outs.iter_mut().map(|k| &mut k.x);
    for x in kept.chain(file.stock.as_mut().map(|s| &mut s.x)) {
        *x = Interval {
            low: shaped.travel(x.low),
            high: shaped.travel(x.high),
        };
    }
    Ok((Arc::new(shaped.part.clone()), Some(shaped)))
}

/// The figures of a job's last, as machined if it is known what is left of it.
pub(crate) fn figures(
    file: &JobFile,
    shaped: &Shaped,
    surface: Option<&Machined>,
) -> Result<Option<Lasts>> {
    let Some(of) = &file.last else {
        return Ok(None);
    };
    let machined = surface.map(|s| of.last.machined(shaped, s, file.job.motion.step));
    Ok(Some(Lasts::of(
        shaped,
        &of.last.frame,
        machined.transpose()?,
    )))
}

/// Measures a last.
pub(crate) fn measure(args: &args::Measure) -> Result<()> {
    let is_job = |file: &Path| file.extension().is_some_and(|e| e == "toml");
    let lasts = match &*args.files {
        [job] if is_job(job) => of_job(args, job)?,
        files => {
            if args.path.is_some() || args.made.size.is_some() || args.made.side.is_some() {
                return Err(Error::MeasureNeedsJob);
            }
            let part = part::read_all(files, &Reading::default())?.part;
            let last = Last {
                bodies: Vec::new(),
                frame: Frame::new(true, [0.0, 0.0, 1.0], true)?,
                choices: Vec::new(),
            };
            let shaped = shape(
                &place(part, horma_core::Axis::default())?,
                &last,
                None,
                false,
            )?;
            draw(args, &last, &shaped)?;
            Lasts::of(&shaped, &last.frame, None)
        }
    };
    say(&if args.json {
        serde_json::to_string_pretty(&lasts).unwrap_or_default()
    } else {
        lasts.describe()
    });
    Ok(())
}

fn of_job(args: &args::Measure, job: &Path) -> Result<Lasts> {
    let mut overrides = args.made.overrides();
    // A job that does not speak of a last is taken to be one, as it is in its files.
    if overrides.side.is_none() && horma_formats::job::read(job, &overrides)?.last.is_none() {
        overrides.side = Some(Side::Right.name().to_owned());
    }
    let pipeline::Prepared {
        part, file, shaped, ..
    } = pipeline::read(job, &overrides)?;
    let surface = match &args.path {
        None => None,
        Some(path) => {
            let positions: Vec<_> = csv::read(path)?.iter().map(csv::Row::position).collect();
            let threads = args.threads.map_or_else(system::cores, usize::from);
            let made = machined::surface(&part, None, &file, &positions, FOR_REPORT, threads)?;
            Some(made)
        }
    };
    if let (Some(of), Some(shaped)) = (&file.last, &shaped) {
        draw(args, &of.last, shaped)?;
    }
    let found = match &shaped {
        Some(shaped) => figures(&file, shaped, surface.as_ref())?,
        None => None,
    };
    found.ok_or(Error::MeasureNeedsJob)
}

fn draw(args: &args::Measure, last: &Last, shaped: &Shaped) -> Result<()> {
    if let Some(file) = &args.figure {
        figure::save(file, &last.sections(shaped)?)?;
    }
    Ok(())
}
