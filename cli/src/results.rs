//! What a run has to show: its files, all or none, and what is said of them at once.

use std::panic::resume_unwind;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use horma_core::{Clearances, Counters, Machined, Part, Waypoint};
use horma_formats::also::{self, Sources};
use horma_formats::job::JobFile;
use horma_formats::output::Staging;
use horma_formats::report::{self, Report};
use horma_formats::view::Findings;
use horma_formats::{csv, map, output, preview, view};
use tokio_util::sync::CancellationToken;

use crate::error::{Error, Result};
use crate::passes::Passes;
use crate::pipeline::{Asked, phase};
use crate::progress::Display;
use crate::{program, say, verify};

/// What results are written of.
pub(crate) struct Made {
    pub part: Arc<Part>,
    pub file: JobFile,
    pub passes: Passes,
    pub clearances: Option<Clearances>,
    pub surface: Option<Machined>,
}

/// Writes all results, or none.
pub(crate) fn write(
    asked: &Asked,
    made: &Made,
    mut report: Report,
    display: &Display,
    stop: &CancellationToken,
) -> Result<Report> {
    display.tell("write", 0, 0);
    let begin = Instant::now();
    let going_on = || {
        if stop.is_cancelled() {
            Err(Error::Interrupted)
        } else {
            Ok(())
        }
    };
    let staging = Staging::begin(asked.output)?;
    let heading = [
        ("job", &*asked.file.to_string_lossy()),
        ("cutter", &described(&report.job["cutter"])),
    ];
    let Made {
        part, file, passes, ..
    } = made;
    let path = &passes.finish;
    // What is to be looked at takes about as long as the rest.
    let (drawn, seen, written) = thread::scope(|scope| {
        let looking = scope.spawn(|| {
            let sheets = preview::sheets(part);
            let drawn = preview::save(&staging.file(output::PREVIEW), &sheets, path);
            let waypoints: Vec<Waypoint> = path.waypoints().collect();
            let findings = Findings {
                clearances: made.clearances.as_ref(),
                machined: made.surface.as_ref(),
            };
            let (cutter, trajectory) = (&file.job.cutter, Some(&path.trajectory));
            let seen = view::view(&sheets, cutter, &waypoints, trajectory, findings);
            let sources = Sources {
                path: &waypoints,
                part: &sheets,
                machined: made.surface.as_ref(),
            };
            let mut asked = file.also.iter();
            let also = asked.try_for_each(|a| also::save(*a, staging.dir(), &sources));
            (drawn, seen, also)
        });
        let written = program::write(staging.dir(), passes, file, &heading)?;
        going_on()?;
        csv::save(&staging.file(output::PATH), path)?;
        for (number, layer) in (1..).zip(&passes.layers) {
            going_on()?;
            csv::save(&staging.file(&output::rough_name(number)), &layer.path)?;
        }
        if let Some(surface) = &made.surface {
            map::save(&staging.file(output::MACHINED_MAP), surface)?;
        }
        let (drawn, seen, also) = looking.join().unwrap_or_else(|panic| resume_unwind(panic));
        also?;
        Ok::<_, Error>((drawn, seen, written))
    })?;
    going_on()?;
    report.program = Some(written);
    // Nobody turns a picture: a path without one is as good.
    if let Err(error) = drawn {
        let warning = format!("there is no picture: {error}");
        display.warn(&warning);
        report.warnings.push(warning);
    }
    report.record.phases.push(phase("write", begin));
    report::save(&staging.file(output::REPORT), &report)?;
    view::save(&staging.file(output::VIEW), &seen, &report)?;
    staging.publish()?;
    Ok(report)
}

/// A table of the job in words.
fn described(table: &serde_json::Value) -> String {
    let entries = table.as_object().into_iter().flatten();
    let entries: Vec<String> = entries
        .map(|(key, value)| format!("{key} {value}"))
        .collect();
    entries.join(", ")
}

/// What the user wants to know at once.
pub(crate) fn summarize(dir: &Path, report: &Report) {
    let lost = match report.record.lost.len() {
        0 => String::new(),
        n => format!(
            "\n{n} attempts were lost and made again: see {}",
            output::REPORT
        ),
    };
    let window = report.record.window.map_or(String::new(), |window| {
        let Counters {
            lost, largest_loss, ..
        } = report.record.counters;
        format!(
            "\nwindows of {} rows and {} columns lost the winner {lost} times, by {largest_loss:.4} mm at most",
            window.delta_u, window.delta_v
        )
    });
    let verification = report.verification.as_ref();
    let verification = verification.map_or(String::new(), |v| format!("\n{}", verify::describe(v)));
    let machined = report.machined.as_ref().map_or(String::new(), |m| {
        format!("\nas machined: {}", m.describe())
    });
    let path = &report.path;
    let inserted = match path.inserted {
        0 => String::new(),
        n => format!(", {n} of them inserted"),
    };
    let beyond = match path.beyond_tolerance {
        0 => String::new(),
        n => format!(
            "\n{n} straight moves stray farther than the path tolerance: there the height jumps"
        ),
    };
    let rough = report.roughing.map_or(String::new(), |rough| {
        let left = rough.left.map_or(String::new(), |l| {
            format!(
                ", which leave {:.4} / {:.4} / {:.4} mm (least / median / 99 %)",
                l.least, l.median, l.p99
            )
        });
        format!("\nroughing in {} layers{left}", rough.layers)
    });
    let (cutting, programs) = report.program.as_ref().map_or_else(Default::default, |p| {
        let names = [
            p.files.first(),
            p.files.last().filter(|_| p.files.len() > 1),
        ];
        let names = names.into_iter().flatten().map(|name| dir.join(name));
        let names: Vec<String> = names.map(|n| n.display().to_string()).collect();
        (program::describe(p), names.join(" to "))
    });
    let also = report.job["output"]["also"].as_array();
    let also = also.into_iter().flatten().filter_map(|name| name.as_str());
    let map = report.machined.as_ref().map(|_| output::MACHINED_MAP);
    let files = [output::REPORT, output::PREVIEW].into_iter().chain(map);
    let files = files.chain(also).chain([output::VIEW]);
    let files: Vec<String> = files
        .map(|name| dir.join(name).display().to_string())
        .collect();
    say(&format!(
        "{} positions{inserted}, {} without contact{beyond}{lost}{window}{verification}{machined}{rough}\n{cutting}\n{}\n{programs}\n{}",
        path.positions,
        path.without_contact,
        dir.join(output::PATH).display(),
        files.join("\n"),
    ));
}
