//! What to compute: everything about a job but the part.

use crate::cutter::Cutter;
use crate::error::{Result, bounded};
use crate::motion::Motion;

/// How to digitize a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Job {
    /// From surfaces to points and facets.
    pub discretization: Discretization,
    /// The wheel.
    pub cutter: Cutter,
    /// The spiral.
    pub motion: Motion,
    /// What the cutter touches.
    pub contact: Contact,
    /// How the touch is searched.
    pub method: Method,
}

/// How parametric surfaces become grids; meshes are taken as they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Discretization {
    /// The same number of rows and columns on each surface, evenly spaced in its parameters, both
    /// ends included: eq. (2) of the 2001 paper.
    Grid {
        /// Isolines across the spindle.
        rows: u32,
        /// Points on each.
        columns: u32,
    },
    /// As many rows and columns as keep every facet within this of its surface, mm.
    Tolerance(f64),
}

impl Discretization {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`crate::Error::OutOfBounds`] for a grid of fewer than 2 × 2 points or a tolerance that
    /// is not positive.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self::Grid { rows, columns } => {
                bounded("rows", f64::from(rows), rows >= 2, "at least 2")?;
                bounded("columns", f64::from(columns), columns >= 2, "at least 2")
            }
            Self::Tolerance(t) => {
                let ok = t >= MIN_TOLERANCE && t.is_finite();
                bounded("tolerance", t, ok, "at least 0.000001 mm")
            }
        }
    }
}

/// Finest chordal tolerance, mm: a nanometre, far below any lathe.
const MIN_TOLERANCE: f64 = 1.0e-6;

/// What the cutter touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// The points of the grid, as in the papers. The cutter sinks into the gaps between them.
    Point,
    /// The facets between the points.
    Facet,
}

/// How the touch is searched. Both give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Only where it can be, by a hierarchy of bounds.
    Exact,
    /// Everywhere: Algorithm 1 of the 2001 paper.
    Brute,
}
