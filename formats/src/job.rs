//! Jobs in: `job.toml`, what was typed, becomes a [`JobFile`], what it means.
//!
//! A job that exists is valid: every number has been checked against its bounds, by the core where
//! the core has an opinion. Flags and `HORMA_*` variables come in as [`Overrides`] and take the
//! place of what the file says. An error names the file, the line and the key, and what would be
//! right. Nothing is read here but the job itself; the part's files are only named.

mod also;
mod digitizing;
mod echo;
mod last;
mod machine;
mod passes;
mod place;
mod program;
mod raw;

use std::fs;
use std::path::{Path, PathBuf};

use horma_core::{
    Axis, Contact, Coordinates, Culling, Cutter, Discretization, Distribution, Job, KeepOut, Local,
    Method, Motion, MotionKind, Point, Sharing, Solid, unit,
};

pub use self::last::{LastOf, Side};
pub use self::machine::Machine;
pub use self::passes::Roughing;
pub use self::place::Place;
use self::raw::{At, Given, RawAxis, RawCutter, RawJob};
use crate::also::Also;
use crate::error::{Error, Result};
use crate::part::{Reading, Trimmed, UNIT_NAMES, Unit};
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

const KINDS: [(&str, MotionKind); 2] = [("helix", MotionKind::Helix), ("rings", MotionKind::Rings)];
const COORDINATES: [(&str, Coordinates); 2] = [
    ("double", Coordinates::Double),
    ("packed21", Coordinates::Packed21),
];
const CONTACTS: [(&str, Contact); 2] = [("facet", Contact::Facet), ("point", Contact::Point)];
const TRIMMED: [(&str, Trimmed); 2] = [("refuse", Trimmed::Refuse), ("whole", Trimmed::Whole)];
const METHODS: [(&str, Method); 3] = [
    ("exact", Method::Exact),
    ("brute", Method::Brute),
    ("local", Method::Local(LOCAL)),
];
/// The local search of a job that says no more.
const LOCAL: Local = Local {
    window: None,
    culling: Culling {
        back_faces: false,
        beyond_reach: false,
    },
    fallback: true,
};
const DISTRIBUTIONS: [(&str, Distribution); 3] = {
    let [a, b, c] = Distribution::ALL;
    [(a.name(), a), (b.name(), b), (c.name(), c)]
};

/// The wheels, each with its keys.
const CUTTERS: [(&str, &[&str]); 4] = [
    ("torus", &["major_radius", "minor_radius"]),
    ("ball", &["radius"]),
    ("cylinder", &["radius", "width"]),
    ("cone", &["radius", "width", "half_angle"]),
];

/// The text that errors point into.
struct Source<'a> {
    text: &'a str,
    path: &'a Path,
}

impl Source<'_> {
    fn part(&self, raw: &RawJob) -> Result<(Vec<PathBuf>, Reading, Axis)> {
        let Some(part) = &raw.part else {
            let what = "there is no [part]; say what to machine, as in files = [\"last.step\"]";
            return Err(self.wrong(None, what));
        };
        let files = self.required(
            part,
            part.value.files.as_ref(),
            "part",
            "files = [\"last.step\"]",
        )?;
        let files_at = part.value.files.as_ref().map(|f| &f.at);
        if files.is_empty() || files.iter().any(|f| f.as_os_str().is_empty()) {
            let what = "files must name at least one file, as in files = [\"last.step\"]";
            return Err(self.wrong(files_at, what));
        }
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let files = files.iter().map(|f| folder.join(f)).collect();
        let axis = part.value.axis.as_ref();
        let axis = axis.map_or(Ok(Axis::default()), |a| self.axis(a))?;
        let trimmed = part.value.trimmed.as_ref();
        let reading = Reading {
            unit: part
                .value
                .units
                .as_ref()
                .map(|u| self.unit(u))
                .transpose()?,
            trimmed: self.choose(trimmed, "trimmed", Trimmed::Refuse, &TRIMMED)?,
        };
        Ok((files, reading, axis))
    }

    fn unit(&self, given: &Given<String>) -> Result<Unit> {
        Unit::named(&given.value).ok_or_else(|| {
            let what = format!("unknown unit '{}'; known: {UNIT_NAMES}", given.value);
            self.wrong(Some(&given.at), what)
        })
    }

    fn axis(&self, given: &Given<toml::Value>) -> Result<Axis> {
        const FORM: &str = "axis must be \"auto\" or { point = [x, y, z], direction = [x, y, z] }";
        if given.value.as_str() == Some("auto") {
            return Ok(Axis::Principal);
        }
        let wrong = |what: String| self.wrong(Some(&given.at), what);
        let raw: RawAxis = given
            .value
            .clone()
            .try_into()
            .map_err(|e: toml::de::Error| wrong(format!("{FORM}: {}", reworded(e.message()))))?;
        let point: Point = raw.point.unwrap_or_default();
        let direction = raw.direction.unwrap_or([1.0, 0.0, 0.0]);
        if let Some(c) = point.into_iter().find(|c| !c.is_finite()) {
            return Err(wrong(format!(
                "axis.point has the coordinate {c}, but must be finite"
            )));
        }
        if unit(direction).is_none() {
            return Err(wrong(
                horma_core::Error::NoDirection { direction }.to_string(),
            ));
        }
        Ok(Axis::Through { point, direction })
    }

    fn discretization(&self, raw: &RawJob) -> Result<Discretization> {
        let raw = &raw.discretization;
        match (&raw.tolerance, &raw.grid) {
            (None, None) => Ok(Discretization::Tolerance(DEFAULT_TOLERANCE)),
            (Some(tolerance), None) => Ok(Discretization::Tolerance(tolerance.value)),
            (None, Some(grid)) => Ok(Discretization::Grid {
                rows: self.count(&grid.value.rows, "rows")?,
                columns: self.count(&grid.value.columns, "columns")?,
            }),
            (Some(_), Some(grid)) => {
                let what = "tolerance and grid are both given, but only one of them can hold";
                Err(self.wrong(Some(&grid.at), what))
            }
        }
    }

    fn coordinates(&self, raw: &RawJob) -> Result<Coordinates> {
        let given = raw.discretization.coordinates.as_ref();
        self.choose(given, "coordinates", Coordinates::Double, &COORDINATES)
    }

    fn cutter(&self, raw: &RawJob) -> Result<Cutter> {
        let Some(section) = &raw.cutter else {
            let what = "there is no [cutter]; say which wheel cuts, as in kind = \"torus\", \
                major_radius = 40, minor_radius = 8";
            return Err(self.wrong(None, what));
        };
        let cutter = &section.value;
        self.required(section, cutter.kind.as_ref(), "cutter", "kind = \"torus\"")?;
        let (kind, keys) = self.choose(
            cutter.kind.as_ref(),
            "cutter",
            CUTTERS[0],
            &CUTTERS.map(|c| (c.0, c)),
        )?;
        for (key, value) in cutter.dimensions() {
            if let Some(value) = value
                && !keys.contains(&key)
            {
                let keys = keys.join(", ");
                let what = format!("{key} does not belong to a {kind}, which has {keys}");
                return Err(self.wrong(Some(&value.at), what));
            }
        }
        let get = |key: &'static str| self.dimension(section, kind, key);
        let cutter = match kind {
            "torus" => Cutter::torus(get("major_radius")?, get("minor_radius")?),
            "ball" => Cutter::ball(get("radius")?),
            "cylinder" => Cutter::cylinder(get("radius")?, get("width")?),
            _ => Cutter::cone(get("radius")?, get("width")?, get("half_angle")?),
        };
        cutter.map_err(|e| self.core(raw, e))
    }

    fn dimension(&self, section: &Given<RawCutter>, kind: &str, key: &str) -> Result<f64> {
        let mut all = section.value.dimensions().into_iter();
        let value = all.find_map(|(k, v)| v.filter(|_| k == key));
        value.map(|v| v.value).ok_or_else(|| {
            let angle = key == "half_angle";
            let unit = if angle { "degrees" } else { "mm" };
            self.wrong(
                Some(&section.at),
                format!("a {kind} needs {key}, in {unit}"),
            )
        })
    }

    fn motion(&self, raw: &RawJob) -> Result<Motion> {
        let Some(section) = &raw.motion else {
            let what = "there is no [motion]; say how the cutter travels, as in step = 2.0, \
                points_per_revolution = 360";
            return Err(self.wrong(None, what));
        };
        let motion = &section.value;
        let step = self.required(section, motion.step.as_ref(), "motion", "step = 2.0")?;
        let points = motion.points_per_revolution.as_ref();
        self.required(section, points, "motion", "points_per_revolution = 360")?;
        let points = points.map(|p| self.count(p, "points_per_revolution"));
        Ok(Motion {
            kind: self.choose(motion.kind.as_ref(), "motion", MotionKind::Helix, &KINDS)?,
            step: *step,
            points_per_revolution: points.transpose()?.unwrap_or_default(),
            from: motion.from.as_ref().map(|g| g.value),
            to: motion.to.as_ref().map(|g| g.value),
            path_tolerance: motion.path_tolerance.as_ref().map(|g| g.value),
            lead: [&motion.lead_in, &motion.lead_out].map(|g| g.as_ref().map_or(0.0, |g| g.value)),
        })
    }

    fn cluster(&self, raw: &RawJob) -> Result<Cluster> {
        let raw = &raw.cluster;
        let workers = raw.workers.as_ref();
        let workers = workers.map_or(Ok(0), |w| self.count(w, "workers"))?;
        if workers > MAX_WORKERS {
            let what = format!("workers is {workers}, but must be at most {MAX_WORKERS}");
            return Err(self.wrong(raw.workers.as_ref().map(|w| &w.at), what));
        }
        let extents = raw.extents_per_worker.as_ref();
        let default = Ok(DEFAULT_EXTENTS_PER_WORKER);
        let extents_per_worker =
            extents.map_or(default, |e| self.count(e, "extents_per_worker"))?;
        if !(1..=MAX_EXTENTS_PER_WORKER).contains(&extents_per_worker) {
            let what = format!(
                "extents_per_worker is {extents_per_worker}, but must be 1 to {MAX_EXTENTS_PER_WORKER}"
            );
            return Err(self.wrong(extents.map(|e| &e.at), what));
        }
        let distribution = self.choose(
            raw.distribution.as_ref(),
            "distribution",
            Distribution::Overlap,
            &DISTRIBUTIONS,
        )?;
        Ok(Cluster {
            workers,
            sharing: Sharing {
                distribution,
                extents_per_worker,
            },
        })
    }

    /// A number within its bounds, or the default.
    fn number(
        &self,
        given: Option<&Given<f64>>,
        key: &str,
        default: f64,
        bound: &str,
        ok: fn(f64) -> bool,
    ) -> Result<f64> {
        let Some(given) = given else {
            return Ok(default);
        };
        if given.value.is_finite() && ok(given.value) {
            return Ok(given.value);
        }
        let what = format!("{key} is {}, but must be {bound}", given.value);
        Err(self.wrong(Some(&given.at), what))
    }

    fn required<'v, S, T>(
        &self,
        section: &Given<S>,
        value: Option<&'v Given<T>>,
        name: &str,
        example: &str,
    ) -> Result<&'v T> {
        value.map(|g| &g.value).ok_or_else(|| {
            let key = example.split(' ').next().unwrap_or_default();
            let what = format!("[{name}] has no {key}; give one, as in {example}");
            self.wrong(Some(&section.at), what)
        })
    }

    /// A number of things.
    fn count(&self, given: &Given<i64>, key: &str) -> Result<u32> {
        u32::try_from(given.value).map_err(|_| {
            let most = u32::MAX;
            let what = format!("{key} is {}, but must be from 0 to {most}", given.value);
            self.wrong(Some(&given.at), what)
        })
    }

    /// The one of `known` that is named, or the default.
    fn choose<T: Copy>(
        &self,
        given: Option<&Given<String>>,
        what: &str,
        default: T,
        known: &[(&str, T)],
    ) -> Result<T> {
        let Some(given) = given else {
            return Ok(default);
        };
        let found = known.iter().find(|(name, _)| *name == given.value);
        found.map(|&(_, value)| value).ok_or_else(|| {
            let known = known.iter().map(|(name, _)| *name).collect::<Vec<_>>();
            let what = format!(
                "unknown {what} '{}'; known: {}",
                given.value,
                known.join(", ")
            );
            self.wrong(Some(&given.at), what)
        })
    }

    /// What the core refuses, at the key that it is about.
    fn core(&self, raw: &RawJob, error: horma_core::Error) -> Error {
        let key = match &error {
            horma_core::Error::OutOfBounds { quantity, .. } => quantity,
            horma_core::Error::ConeTooSteep { .. } => "half_angle",
            horma_core::Error::EmptyTravel { .. } => "to",
            horma_core::Error::LocalNeedsPoints => "method",
            horma_core::Error::ToleranceTooFine { .. } => "tolerance",
            horma_core::Error::PathToleranceNeedsFallback => "path_tolerance",
            _ => return Error::Core(error),
        };
        self.wrong(raw.at(key), error.to_string())
    }

    fn wrong(&self, at: Option<&At>, what: impl Into<String>) -> Error {
        let place = match at {
            None => Place::File(self.path.to_owned()),
            Some(At::Flag(key)) => Place::Flag(key),
            Some(At::File(span)) => Place::of(self.path, self.text, span),
        };
        Error::Job {
            what: what.into(),
            place: Box::new(place),
        }
    }
}

/// The parser's message in the words of a job file.
fn reworded(message: &str) -> String {
    let mut message = message.trim_end().replace('\n', ", ");
    for (theirs, ours) in [
        ("expected f64", "expected a number"),
        ("expected i64", "expected a whole number"),
        ("expected a sequence", "expected a list"),
        ("unknown field", "unknown key"),
        ("missing field", "missing key"),
    ] {
        message = message.replace(theirs, ours);
    }
    message
}

#[cfg(test)]
mod tests;
