//! `bench kernel`: what the searches cost on this machine, as ratios measured in one run; and `bench
//! scaling`, in a module of its own.
//!
//! One part is digitized in many ways, and figures come out: as a table, as numbers and as a diagram.
//! Nothing is tuned here and no path is written.

mod check;
mod figures;
mod measure;
mod plot;
mod table;
mod turns;

mod scaling;

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use horma_core::{Motion, Part, place};
use horma_formats::job::{self, JobFile, Overrides};
use horma_formats::output::{self, Staging};
use horma_formats::{plot as diagram, sample};

use crate::args::BenchKernel;
use crate::error::Result;
use crate::progress::{Audience, Display};
use crate::{pipeline, say};
use measure::Subject;
pub(crate) use scaling::scaling;
use turns::Effort;

/// Measures, prints the table and writes the results.
pub(crate) fn kernel(args: &BenchKernel) -> Result<()> {
    let display = Display::new(Audience::unless(args.quiet));
    let measured = measure_and_write(args, &display);
    display.finish();
    say(measured?.trim_end());
    Ok(())
}

fn measure_and_write(args: &BenchKernel, display: &Display) -> Result<String> {
    let subject = subject(args, display)?;
    output::prepare_dir_of(&args.output, output::of_bench)?;
    let effort = if args.quick {
        Effort::QUICK
    } else {
        Effort::FULL
    };
    let figures = measure::all(&subject, &effort, display)?;
    let table = table::text(&figures);
    let staging = Staging::begin_of(&args.output, output::of_bench)?;
    let write = |name, text: &str| {
        let file = staging.file(name);
        output::write(&file, |out| out.write_all(text.as_bytes()))
    };
    write(output::BENCH_TABLE, &table)?;
    write(
        output::BENCH_PLOT,
        &diagram::svg(&plot::against_density(&figures)),
    )?;
    output::write(&staging.file(output::BENCH_FIGURES), |out| {
        serde_json::to_writer_pretty(&mut *out, &figures)?;
        out.write_all(b"\n")
    })?;
    staging.publish()?;
    Ok(table)
}

/// The part, the cutter and the motion of a job, or of the sample.
fn subject(args: &BenchKernel, display: &Display) -> Result<Subject> {
    let (file, name, part) = read(args.job.as_deref(), &args.motion.overrides(), display)?;
    Ok(Subject {
        name,
        part,
        cutter: file.job.cutter,
        // Searches are compared position by position.
        motion: Motion {
            path_tolerance: None,
            ..file.job.motion
        },
    })
}

/// A job or the sample, the name of its part, and the part in its place.
fn read(
    job: Option<&Path>,
    overrides: &Overrides,
    display: &Display,
) -> Result<(JobFile, String, Arc<Part>)> {
    let (file, name, part) = match job {
        Some(path) => {
            let pipeline::Prepared {
                part,
                file,
                warnings,
                ..
            } = pipeline::read(path, overrides)?;
            for warning in warnings {
                display.warn(&warning);
            }
            let name = names(&file);
            (file, name, part)
        }
        None => {
            let path = Path::new(sample::JOB);
            let file = job::parse(sample::job_toml(), path, overrides)?;
            let part = sample::last(&sample::LastStyle::WOMEN)?;
            let part = Arc::new(place(part, file.axis)?);
            (file, "the sample last".to_owned(), part)
        }
    };
    Ok((file, name, part))
}

/// The part's files, without their folders.
fn names(file: &JobFile) -> String {
    let names = file.files.iter().filter_map(|f| f.file_name());
    let names: Vec<_> = names.map(|n| n.to_string_lossy()).collect();
    names.join(", ")
}
