//! Jobs in: `job.toml`, what was typed, becomes a [`JobFile`], what it means.
//!
//! A job that exists is valid: every number has been checked against its bounds, by the core where
//! the core has an opinion. Flags and `HORMA_*` variables come in as [`Overrides`] and take the
//! place of what the file says. An error names the file, the line and the key, and what would be
//! right. Nothing is read here but the job itself; the part's files are only named.

mod also;
mod cluster;
mod cutter;
mod digitizing;
mod discretization;
mod echo;
mod last;
mod machine;
mod motion;
mod part;
mod passes;
mod place;
mod program;
mod raw;
mod source;

use std::fs;
use std::path::{Path, PathBuf};

use horma_core::{Axis, Job, KeepOut, Sharing, Solid};

pub use self::last::{LastOf, Side};
pub use self::machine::Machine;
pub use self::passes::Roughing;
pub use self::place::Place;
use self::raw::{At, RawJob};
use self::source::{Source, reworded};
use crate::also::Also;
use crate::error::{Error, Result};
use crate::part::Reading;
use crate::post::Program;

/// Chordal tolerance of a job that does not say, mm.
pub const DEFAULT_TOLERANCE: f64 = 0.01;
/// Feed of a job that does not say, mm/min.
pub const DEFAULT_FEED: f64 = 2000.0;
/// Clearance of a job that does not say, mm.
pub const DEFAULT_CLEARANCE: f64 = 20.0;
/// Most workers that a job can ask for.
pub const MAX_WORKERS: u32 = 10_000;
/// Extents for each worker of a job that does not say: an idle worker helps a late one anyway, and
/// every extent needs its halo again.
pub const DEFAULT_EXTENTS_PER_WORKER: u32 = 1;
/// Most extents for each worker that a job can ask for.
pub const MAX_EXTENTS_PER_WORKER: u32 = 1000;

/// A job, with everything that it leaves open filled in.
#[derive(Debug, Clone, PartialEq)]
pub struct JobFile {
    /// The part's files; relative ones start from the job file's folder.
    pub files: Vec<PathBuf>,
    /// What is said of files beside what they say themselves.
    pub reading: Reading,
    /// The spindle, in file coordinates, mm.
    pub axis: Axis,
    /// What to compute.
    pub job: Job,
    /// What the part is cut from, if the job says so.
    pub stock: Option<Solid>,
    /// How that is roughed, if it is; only where there is a stock.
    pub roughing: Option<Roughing>,
    /// What the cutter must not enter.
    pub keep_outs: Vec<KeepOut>,
    /// Where to compute it.
    pub cluster: Cluster,
    /// How to write it for the machine.
    pub program: Program,
    /// What the machine can do.
    pub machine: Machine,
    /// What is written beside the path, its program and its report.
    pub also: Vec<Also>,
    /// The last in the part, if the job speaks of one.
    pub last: Option<LastOf>,
}

/// Where a job is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cluster {
    /// Worker processes; 0 computes in this one.
    pub workers: u32,
    /// How it is shared among them.
    pub sharing: Sharing,
}

/// What flags and environment variables put in the place of the job file's values.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Overrides {
    /// `cluster.workers`
    pub workers: Option<u32>,
    /// `cluster.distribution`
    pub distribution: Option<String>,
    /// `cluster.extents_per_worker`
    pub extents_per_worker: Option<u32>,
    /// `digitizing.contact`
    pub contact: Option<String>,
    /// `digitizing.method`
    pub method: Option<String>,
    /// `digitizing.delta_u`, rows
    pub delta_u: Option<u32>,
    /// `digitizing.delta_v`, columns
    pub delta_v: Option<u32>,
    /// `digitizing.fallback`
    pub fallback: Option<bool>,
    /// `discretization.tolerance`, mm; it also takes the place of a grid.
    pub tolerance: Option<f64>,
    /// `discretization.coordinates`
    pub coordinates: Option<String>,
    /// `motion.step`, mm
    pub step: Option<f64>,
    /// `motion.points_per_revolution`
    pub points_per_revolution: Option<u32>,
    /// `motion.from`, mm
    pub from: Option<f64>,
    /// `motion.to`, mm
    pub to: Option<f64>,
    /// `motion.path_tolerance`, mm
    pub path_tolerance: Option<f64>,
    /// `program.dialect`
    pub dialect: Option<String>,
    /// `program.split`, moves
    pub split: Option<u32>,
    /// `program.feed`, mm/min
    pub feed: Option<f64>,
    /// `program.clearance`, mm
    pub clearance: Option<f64>,
    /// `output.also`
    pub also: Option<Vec<String>>,
    /// The size to be made of the last
    pub size: Option<f64>,
    /// The side to be made of the last
    pub side: Option<String>,
}

/// Reads the job file at `path`.
///
/// # Errors
/// [`Error::Io`], and those of [`parse`].
pub fn read(path: &Path, overrides: &Overrides) -> Result<JobFile> {
    let text = fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
    parse(&text, path, overrides)
}

/// Parses the text of the job file at `path`.
///
/// # Errors
/// [`Error::Job`], with the place of what is wrong.
pub fn parse(text: &str, path: &Path, overrides: &Overrides) -> Result<JobFile> {
    let source = Source { text, path };
    let mut raw: RawJob = toml::from_str(text).map_err(|e| {
        let at = e.span().map(At::File);
        source.wrong(at.as_ref(), reworded(e.message()))
    })?;
    raw.replace(overrides);
    let (files, reading, axis) = source.part(&raw)?;
    let (contact, method) = source.digitizing(&raw)?;
    let job = Job {
        discretization: source.discretization(&raw)?,
        coordinates: source.coordinates(&raw)?,
        cutter: source.cutter(&raw)?,
        motion: source.motion(&raw)?,
        contact,
        method,
    };
    job.validate().map_err(|e| source.core(&raw, e))?;
    let cluster = source.cluster(&raw)?;
    source.in_one_process(&raw, method, cluster.workers)?;
    let program = source.program(&raw)?;
    Ok(JobFile {
        files,
        reading,
        axis,
        job,
        stock: source.stock(&raw)?,
        roughing: source.roughing(&raw, job, program.feed)?,
        keep_outs: source.keep_outs(&raw)?,
        cluster,
        program,
        machine: source.machine(&raw)?,
        also: source.also(&raw)?,
        last: source.last(&raw)?,
    })
}

#[cfg(test)]
mod tests;
