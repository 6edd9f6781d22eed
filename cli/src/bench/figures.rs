//! What a bench finds, as `kernel.json` has it. Times are the shortest of several turns; a ratio is
//! between times that took turns with each other.

use horma_core::Cutter;
use serde::Serialize;

/// All figures of one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Figures {
    /// Version of horma.
    pub version: String,
    /// The part.
    pub part: String,
    /// The cutter, in words.
    pub cutter: String,
    /// Travel per revolution, mm.
    pub step_mm: f64,
    /// Positions per revolution.
    pub points_per_revolution: u32,
    /// Cores that this process may use.
    pub cores: usize,
    /// How many threads of all programs wanted a core in the minute before, on average: above 0, what
    /// is measured on several threads suffers, and above their number everything does.
    pub load: f64,
    /// The instruction set, where none is named.
    pub simd: String,
    /// Turns that each measurement got at least.
    pub turns: usize,
    /// Points on each surface, by rows and columns, where the density is not varied.
    pub grid: [u32; 2],
    /// Cost per position against the density of points.
    pub density: Vec<Density>,
    /// The smallest number of points that would not have fitted into memory.
    pub too_large: Option<f64>,
    /// Instruction sets against each other.
    pub simd_levels: Vec<SimdLevel>,
    /// Threads against each other.
    pub threads: Vec<Threads>,
    /// Cost per position against the number of positions.
    pub positions: Vec<Positions>,
    /// Wheels against each other.
    pub wheels: Vec<Wheel>,
}

/// One density, on one thread.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Density {
    /// Rows and columns of each surface; nothing for meshes.
    pub grid: Option<[u32; 2]>,
    /// Points in all.
    pub points: u64,
    /// Facets in all.
    pub facets: u64,
    /// Point contact.
    pub point: Search,
    /// Facet contact.
    pub facet: Search,
    /// Exact facet contact over exact point contact.
    pub facet_over_point: f64,
}

/// Exact search against brute force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Search {
    /// Time of a position, µs.
    pub exact_us: f64,
    /// Time of a position by brute force, µs.
    pub brute_us: f64,
    /// Of these two.
    pub brute_over_exact: f64,
    /// Positions that were searched exactly.
    pub positions: u64,
    /// Positions that were searched by brute force.
    pub brute_positions: u64,
    /// Nodes bounded for a position.
    pub nodes: f64,
    /// Candidates evaluated for a position.
    pub evaluations: f64,
    /// Time to build the hierarchy, s.
    pub build_s: f64,
    /// Memory of rows and hierarchy for a point.
    pub bytes_per_point: f64,
}

/// One instruction set, on one thread.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct SimdLevel {
    /// Contact and method.
    pub search: &'static str,
    /// The instruction set.
    pub simd: String,
    /// Time of a position, µs.
    pub us: f64,
    /// The scalar set's time over this one's.
    pub speedup: f64,
}

/// One number of threads.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Threads {
    /// How many.
    pub threads: usize,
    /// Wall time over positions, µs.
    pub us: f64,
    /// One thread's time over theirs.
    pub speedup: f64,
    /// Of which each thread has this share.
    pub efficiency: f64,
}

/// One number of positions, on one thread.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Positions {
    /// Travel per revolution, mm.
    pub step_mm: f64,
    /// Positions per revolution.
    pub points_per_revolution: u32,
    /// Positions of the whole path.
    pub positions: u64,
    /// Time of a position, µs.
    pub us: f64,
    /// Of this to the job's.
    pub over_job: f64,
}

/// One wheel, on one thread.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Wheel {
    /// In words.
    pub cutter: String,
    /// Facets of the part.
    pub facets: u64,
    /// Time of a position, µs.
    pub us: f64,
    /// Positions in a second.
    pub positions_per_second: f64,
    /// Time of this to the first one's.
    pub over_first: f64,
}

/// A cutter in words, lengths in mm.
pub(super) fn described(cutter: &Cutter) -> String {
    match *cutter {
        Cutter::Torus {
            major_radius: 0.0,
            minor_radius: r,
        } => format!("ball of radius {r}"),
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => format!("torus R {major_radius} r {minor_radius}"),
        Cutter::Cone {
            radius,
            width,
            half_angle: 0.0,
            ..
        } => format!("cylinder of radius {radius}, width {width}"),
        Cutter::Cone {
            radius,
            width,
            half_angle,
            ..
        } => format!("cone of radius {radius}, width {width}, {half_angle}°"),
    }
}
