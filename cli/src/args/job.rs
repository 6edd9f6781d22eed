//! What can be typed of a job: how it is done differently from what its file says, and what else is written.

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use horma_formats::also;
use horma_formats::job::Overrides;

use crate::progress::Audience;

/// A job, and what it says differently this time.
#[derive(Debug, Args)]
pub(crate) struct Job {
    /// The job file (TOML)
    #[arg(value_name = "JOB")]
    pub file: PathBuf,
    #[command(flatten)]
    pub how: How,
}

/// How a job is done differently from what its file says.
#[derive(Debug, Args)]
pub(crate) struct How {
    /// Show nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    /// Tell other programs what happens: JSON on standard output, a line for each event, which names it
    /// (phase, progress, phase_done, warning, note, done, failed, ...)
    #[arg(long, conflicts_with = "quiet")]
    pub json: bool,
    /// Do not hold the path against the designed surface, nor make the machined one; a gouge deeper than the
    /// tolerance then goes unnoticed
    #[arg(long)]
    pub no_verify: bool,
    #[command(flatten)]
    pub also: Also,
    /// What the cutter touches: facet or point
    #[arg(
        long,
        env = "HORMA_CONTACT",
        help_heading = "Instead of the job file's"
    )]
    pub contact: Option<String>,
    /// How the touch is searched: exact, brute or local
    #[arg(long, env = "HORMA_METHOD", help_heading = "Instead of the job file's")]
    pub method: Option<String>,
    /// Rows around the last winner that the local search looks at: fewer than this away
    #[arg(
        long,
        value_name = "ROWS",
        env = "HORMA_DELTA_U",
        help_heading = "Instead of the job file's"
    )]
    pub delta_u: Option<u32>,
    /// Columns around the last winner that the local search looks at
    #[arg(
        long,
        value_name = "COLUMNS",
        env = "HORMA_DELTA_V",
        help_heading = "Instead of the job file's"
    )]
    pub delta_v: Option<u32>,
    /// Leave the local search as the papers have it: where the window has lost the winner the path is
    /// wrong; the report says where and by how much
    #[arg(long, help_heading = "Instead of the job file's")]
    pub no_fallback: bool,
    /// Chordal tolerance of surfaces, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_TOLERANCE",
        help_heading = "Instead of the job file's"
    )]
    pub tolerance: Option<f64>,
    /// Coordinates of points: double, or packed21, which is a third of it on the way to workers and
    /// 0.0004 mm off
    #[arg(
        long,
        value_name = "KIND",
        env = "HORMA_COORDINATES",
        help_heading = "Instead of the job file's"
    )]
    pub coordinates: Option<String>,
    /// Travel per revolution, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_STEP",
        help_heading = "Instead of the job file's"
    )]
    pub step: Option<f64>,
    /// Positions per revolution
    #[arg(
        long,
        value_name = "N",
        env = "HORMA_POINTS_PER_REVOLUTION",
        help_heading = "Instead of the job file's"
    )]
    pub points_per_revolution: Option<u32>,
    /// First travel, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_FROM",
        allow_negative_numbers = true,
        help_heading = "Instead of the job file's"
    )]
    pub from: Option<f64>,
    /// Last travel, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_TO",
        allow_negative_numbers = true,
        help_heading = "Instead of the job file's"
    )]
    pub to: Option<f64>,
    /// How far a straight move between positions may stray along the attack axis before positions are
    /// inserted, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_PATH_TOLERANCE",
        help_heading = "Instead of the job file's"
    )]
    pub path_tolerance: Option<f64>,
    /// Whose G-code the program is: linuxcnc, fanuc, siemens, mach, grblhal or beckhoff
    #[arg(
        long,
        env = "HORMA_DIALECT",
        help_heading = "Instead of the job file's"
    )]
    pub dialect: Option<String>,
    /// Most moves in one file of the program; what is more goes on in the next
    #[arg(
        long,
        value_name = "MOVES",
        env = "HORMA_SPLIT",
        help_heading = "Instead of the job file's"
    )]
    pub split: Option<u32>,
    /// Feed at the contact, mm/min
    #[arg(
        long,
        value_name = "MM/MIN",
        env = "HORMA_FEED",
        help_heading = "Instead of the job file's"
    )]
    pub feed: Option<f64>,
    /// Retract above the highest position, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_CLEARANCE",
        help_heading = "Instead of the job file's"
    )]
    pub clearance: Option<f64>,
    /// How workers come by the part: overlap (the master sends each what it needs), halo (each row is
    /// sent once, workers fetch the rest from each other) or surface (workers make the points)
    #[arg(
        long,
        env = "HORMA_DISTRIBUTION",
        help_heading = "Instead of the job file's"
    )]
    pub distribution: Option<String>,
    /// Into how many extents the job is cut for each worker. More of them are spread more evenly over
    /// unequal workers, and each needs rows of its neighbours again [default: 1]
    #[arg(
        long,
        value_name = "N",
        env = "HORMA_EXTENTS_PER_WORKER",
        help_heading = "Instead of the job file's"
    )]
    pub extents_per_worker: Option<u32>,
}

impl How {
    /// To whom it is told how the job goes on.
    pub fn audience(&self) -> Audience {
        if self.json {
            Audience::Programs
        } else {
            Audience::unless(self.quiet)
        }
    }

    /// What goes over the job file.
    pub fn overrides(&self, workers: Option<u32>) -> Overrides {
        Overrides {
            workers,
            distribution: self.distribution.clone(),
            extents_per_worker: self.extents_per_worker,
            contact: self.contact.clone(),
            method: self.method.clone(),
            delta_u: self.delta_u,
            delta_v: self.delta_v,
            fallback: self.no_fallback.then_some(false),
            tolerance: self.tolerance,
            coordinates: self.coordinates.clone(),
            step: self.step,
            points_per_revolution: self.points_per_revolution,
            from: self.from,
            to: self.to,
            path_tolerance: self.path_tolerance,
            dialect: self.dialect.clone(),
            split: self.split,
            feed: self.feed,
            clearance: self.clearance,
            also: self.also.overrides(),
            size: None,
            side: None,
        }
    }
}

/// What is written beside the rest.
#[derive(Debug, Args)]
pub(crate) struct Also {
    /// Files to write beside the rest, for other programs: the path as path.parquet, path.npy; the surface that it
    /// leaves as machined.ply (with its errors in colour), machined.stl; the designed one as designed.ply (with
    /// the same colours), designed.stl; part, path and machined surface for viewers as scene.glb
    #[arg(
        long,
        value_name = "FILE,...",
        env = "HORMA_ALSO",
        value_delimiter = ',',
        hide_possible_values = true,
        value_parser = PossibleValuesParser::new(also::Also::ALL.map(also::Also::name)),
        help_heading = "Instead of the job file's"
    )]
    pub also: Vec<String>,
}

impl Also {
    /// What takes the place of the job file's list, if anything is asked for.
    pub fn overrides(&self) -> Option<Vec<String>> {
        Some(self.also.clone()).filter(|all| !all.is_empty())
    }
}
