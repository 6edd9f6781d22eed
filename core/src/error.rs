//! What the mathematics refuses, and why.

use std::ops::Range;

use crate::motion::Index;

/// Everything that can be wrong with a part, a cutter or a motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A number outside its bounds. `quantity` is the name it has in a job file.
    #[error("{quantity} is {value}, but must be {bound}")]
    OutOfBounds {
        /// Name in the job file.
        quantity: &'static str,
        /// The number that was given.
        value: f64,
        /// What would have been accepted.
        bound: &'static str,
    },
    /// A cone so steep that its small end has a negative radius.
    #[error(
        "half_angle is {half_angle}°, but a cone of radius {radius} and width {width} allows at most {limit}°"
    )]
    ConeTooSteep {
        /// Angle between the cone's side and its axis, degrees.
        half_angle: f64,
        /// Radius in the middle of the cone's width, mm.
        radius: f64,
        /// Full width, mm.
        width: f64,
        /// Steepest angle that these dimensions allow, degrees.
        limit: f64,
    },
    /// The travel ends before it begins.
    #[error("the travel goes from {from} to {to}, but must not end before it begins")]
    EmptyTravel {
        /// First travel, mm.
        from: f64,
        /// Last travel, mm.
        to: f64,
    },
    /// A path with more positions than an index can count.
    #[error(
        "the motion has {positions:.3e} positions, more than the {limit:.1e} that a path can have"
    )]
    TooManyPositions {
        /// Number of positions asked for.
        positions: f64,
        /// Most positions that a path can have.
        limit: f64,
    },
    /// A grid with more points than a row or a part can index.
    #[error(
        "{name}: a grid of {rows} rows × {columns} columns is more than the {limit} that a surface can have in either direction"
    )]
    GridTooLarge {
        /// Name of the surface.
        name: String,
        /// Rows asked for.
        rows: usize,
        /// Columns asked for.
        columns: usize,
        /// Most rows, and most columns.
        limit: usize,
    },
    /// Windows around the last winner where there are no rows and columns.
    #[error(
        "{name} is a mesh, but the local search needs surfaces, which have rows and columns; choose the exact one"
    )]
    LocalNeedsGrids {
        /// Name of the mesh.
        name: String,
    },
    /// Workers that make their rows from surfaces where there are none.
    #[error(
        "{name} is a mesh, but the distribution surface needs surfaces, from which workers make their rows; choose overlap or halo"
    )]
    SurfaceNeedsSurfaces {
        /// Name of the mesh.
        name: String,
    },
    /// Windows around the last winner over facets.
    #[error(
        "the local search is over points, as in the papers; set contact to point, or choose the exact one"
    )]
    LocalNeedsPoints,
    /// An instruction set that is unknown or that this machine lacks.
    #[error("{name:?} is no instruction set of this machine, which has {}", available.join(", "))]
    NoSuchSimd {
        /// The name that was given.
        name: String,
        /// Those that could be given.
        available: Vec<String>,
    },
    /// A job that would not fit into memory.
    #[error("the job has {points} points and {positions} positions, which would take {:.1} GB of memory where {:.1} GB are available; choose a coarser grid or tolerance, a larger step or fewer points per revolution", needed / 1e9, *available as f64 / 1e9)]
    OutOfMemory {
        /// Points of the discrete model.
        points: f64,
        /// Positions of the path.
        positions: u64,
        /// Memory that they would take, bytes.
        needed: f64,
        /// Memory there is, bytes.
        available: u64,
    },
    /// Nothing to machine.
    #[error("the part is empty: it has no surface and no triangle")]
    EmptyPart,
    /// A coordinate, weight or knot that is not a number.
    #[error("{name}: {what} {index} is {value}, which is not a finite number")]
    NotFinite {
        /// Name of the body.
        name: String,
        /// Kind of number: `vertex`, `pole`, `weight` or `knot`.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
        /// The number as found.
        value: f64,
    },
    /// A coordinate so far out that doubles no longer resolve a micrometre well.
    #[error(
        "{name}: {what} {index} has a coordinate of {value} mm, beyond the {limit} mm that a part may extend"
    )]
    TooFar {
        /// Name of the body.
        name: String,
        /// Kind of number: `vertex` or `pole`.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
        /// The coordinate as found, mm.
        value: f64,
        /// Greatest magnitude, mm.
        limit: f64,
    },
    /// A coordinate that does not fit into 21 bits.
    #[error(
        "{name}: a coordinate of {value} mm is beyond the {limit} mm that packed21 reaches; move the part nearer to the origin by its axis, or leave its coordinates double"
    )]
    TooFarToPack {
        /// Name of the body.
        name: String,
        /// The coordinate as found, mm.
        value: f64,
        /// Greatest magnitude, mm.
        limit: f64,
    },
    /// A chordal tolerance that rounding uses up.
    #[error(
        "tolerance is {tolerance} mm, of which rounding to packed21 takes {error:.6}; take a coarser one, or leave coordinates double"
    )]
    ToleranceTooFine {
        /// As asked for, mm.
        tolerance: f64,
        /// How far rounded points are off, mm.
        error: f64,
    },
    /// A B-spline surface whose numbers contradict each other.
    #[error("{name}: {reason}")]
    BadSurface {
        /// Name of the surface.
        name: String,
        /// What contradicts what.
        reason: String,
    },
    /// A triangle that names a vertex that does not exist.
    #[error("{name}: triangle {triangle} names vertex {vertex}, but there are only {vertices}")]
    NoSuchVertex {
        /// Name of the mesh.
        name: String,
        /// The triangle, from 0.
        triangle: usize,
        /// The vertex it names, from 0.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A row whose facets name points that it does not have.
    #[error("row {row}: facet {facet} names a point beyond the row's {points}")]
    BadRow {
        /// Number of the row in the part.
        row: u32,
        /// The facet, from 0.
        facet: usize,
        /// Points in the row.
        points: usize,
    },
    /// Two isolines of one surface that do not have the same number of points.
    #[error("row {row} has {points} points, but the row it joins has {next}")]
    UnequalRows {
        /// Number of the first row in the part.
        row: u32,
        /// Its points.
        points: usize,
        /// The next row's.
        next: usize,
    },
    /// A spindle axis without a direction.
    #[error("the axis has the direction [{}, {}, {}], which has no length", direction[0], direction[1], direction[2])]
    NoDirection {
        /// The direction that was given.
        direction: [f64; 3],
    },
    /// A grid that cannot be refined to the tolerance.
    #[error(
        "{name}: a grid of {rows} × {columns} points still deviates by {deviation} mm from the surface, and the tolerance is {tolerance} mm; ask for a coarser tolerance"
    )]
    ToleranceNotReached {
        /// Name of the surface.
        name: String,
        /// Rows of the finest grid tried.
        rows: usize,
        /// Columns of the finest grid tried.
        columns: usize,
        /// Deviation still found, mm.
        deviation: f64,
        /// Deviation asked for, mm.
        tolerance: f64,
    },
    /// A position of a path that cannot be one.
    #[error("position {index} has a {quantity} of {value}, but must have one {bound}")]
    BadPosition {
        /// The position, from 0.
        index: usize,
        /// `travel`, `angle` or `height`.
        quantity: &'static str,
        /// The number as found.
        value: f64,
        /// What would have been accepted.
        bound: &'static str,
    },
    /// Samples of a part so close that there would be too many.
    #[error(
        "samples {spacing} mm apart would be {samples:.3e}, more than the {limit:.1e} that a part can have; ask for a wider spacing"
    )]
    TooManySamples {
        /// Samples that it would take.
        samples: f64,
        /// Spacing asked for, mm.
        spacing: f64,
        /// Most samples.
        limit: f64,
    },
    /// Too many rays.
    #[error(
        "{rays:.3e} rays from the spindle are more than the {limit:.1e} that there can be; ask for a wider spacing"
    )]
    TooManyRays {
        /// Rays that it would take.
        rays: f64,
        /// Most rays.
        limit: f64,
    },
    /// A body that is said to be the last, and is not there.
    #[error("no body of the part is called {name:?}; there are: {known}")]
    NoSuchBody {
        /// What it should be called.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// Something without what a last has.
    #[error(
        "no {what} is found on the last; say which bodies it has, where its toe is and which way is up in [last], or give the landmark in [measures]"
    )]
    NotALast {
        /// What was looked for.
        what: &'static str,
    },
    /// Stitching found positions that nobody delivered.
    #[error("positions {first} to {last} are missing from the path")]
    Gap {
        /// First missing position.
        first: u64,
        /// Last missing position.
        last: u64,
    },
    /// Stitching found positions that were delivered twice.
    #[error("positions {first} to {last} were delivered twice")]
    Duplicate {
        /// First position delivered again.
        first: u64,
        /// Last position delivered again.
        last: u64,
    },
    /// Stitching found an inserted position where it does not belong.
    #[error(
        "position {index} was inserted after {last}, on the moves from positions {} to {}", moves.start, moves.end.saturating_sub(1)
    )]
    Misplaced {
        /// The inserted position.
        index: Index,
        /// The one before it.
        last: Index,
        /// Positions from which the moves begin that it may be on.
        moves: Range<u64>,
    },
    /// More inserted positions than there is memory for.
    #[error(
        "the path tolerance takes more than {limit} positions between those of the motion, for which there is no memory; choose a larger path_tolerance"
    )]
    TooManyInserted {
        /// Most that there is memory for.
        limit: u64,
    },
    /// Roughing in more layers than are made.
    #[error(
        "roughing takes {layers} layers, more than the {limit} that are made over so many positions; ask for a larger depth_of_cut, or check the stock"
    )]
    TooManyLayers {
        /// Layers that it would take.
        layers: f64,
        /// Most that are made.
        limit: u64,
    },
    /// Heights between positions where only a chain through all positions gives them.
    #[error(
        "path_tolerance needs heights between positions, which the local search without its fallback does not have; leave the fallback on, or choose the exact search"
    )]
    PathToleranceNeedsFallback,
    /// Stitching found a position that the trajectory does not have.
    #[error("position {position} was delivered, but the path has only {positions}")]
    BeyondTheEnd {
        /// The last position delivered.
        position: u64,
        /// Number of positions of the trajectory.
        positions: u64,
    },
}

impl Error {
    /// Whether what was asked for is sound, but cannot be done: too much, too fine, or nothing at all.
    pub fn is_impossible(&self) -> bool {
        matches!(
            self,
            Self::OutOfMemory { .. }
                | Self::ToleranceNotReached { .. }
                | Self::TooManyPositions { .. }
                | Self::TooManyInserted { .. }
                | Self::TooManyLayers { .. }
                | Self::TooManyRays { .. }
                | Self::TooManySamples { .. }
                | Self::GridTooLarge { .. }
                | Self::EmptyTravel { .. }
        )
    }
}

/// The result of an operation of the core.
pub type Result<T> = std::result::Result<T, Error>;

/// `Ok` if `ok` holds, else the error that names the quantity, its value and its bound.
pub(crate) fn bounded(
    quantity: &'static str,
    value: f64,
    ok: bool,
    bound: &'static str,
) -> Result<()> {
    if ok {
        Ok(())
    } else {
        Err(Error::OutOfBounds {
            quantity,
            value,
            bound,
        })
    }
}
