//! What to compute: everything about a job but the part.

use std::fmt;

use crate::cutter::Cutter;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, bounded};
use crate::motion::Motion;
use crate::packed::Packing;
use crate::vector::Point;

/// How to digitize a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Job {
    /// From surfaces to points and facets.
    pub discretization: Discretization,
    /// What the coordinates of these points are rounded to.
    pub coordinates: Coordinates,
    /// The wheel.
    pub cutter: Cutter,
    /// The spiral.
    pub motion: Motion,
    /// What the cutter touches.
    pub contact: Contact,
    /// How the touch is searched.
    pub method: Method,
}

impl Job {
    /// Checks the numbers and that they fit together.
    ///
    /// # Errors
    /// Those of [`Discretization::validate`], [`Motion::validate`] and [`Method::validate`];
    /// [`crate::Error::ToleranceTooFine`], [`crate::Error::PathToleranceNeedsFallback`].
    pub fn validate(&self) -> Result<()> {
        self.discretization.validate()?;
        self.coordinates.chordal(self.discretization)?;
        self.motion.validate()?;
        self.method.validate(self.contact)?;
        match self.method {
            Method::Local(local) if !local.fallback && self.motion.path_tolerance.is_some() => {
                Err(Error::PathToleranceNeedsFallback)
            }
            _ => Ok(()),
        }
    }
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

/// What the coordinates of rows are rounded to, by whoever makes them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coordinates {
    /// Doubles, as they come.
    #[default]
    Double,
    /// Words of 21 bits, 11 of them after the point: a point travels in 64 bits, as in the coprocessor paper.
    Packed21,
}

impl Coordinates {
    /// How far a point can be from where it was, mm, if it is within reach: half a unit along each axis.
    pub fn error(self) -> f64 {
        match self {
            Self::Double => 0.0,
            Self::Packed21 => Packing::POINTS.error() * 3.0_f64.sqrt(),
        }
    }

    /// The nearest point that there is.
    pub(crate) fn round(self, point: Point) -> Point {
        match self {
            Self::Double => point,
            Self::Packed21 => Packing::POINTS.round(point),
        }
    }

    /// What is left of a chordal tolerance once points are rounded: a corner of a facet moves by no more than
    /// [`Coordinates::error`], and no place between corners moves further than these.
    ///
    /// # Errors
    /// [`Error::ToleranceTooFine`] if nothing is.
    pub(crate) fn chordal(self, discretization: Discretization) -> Result<Discretization> {
        let Discretization::Tolerance(tolerance) = discretization else {
            return Ok(discretization);
        };
        let (left, error) = (tolerance - self.error(), self.error());
        if left < MIN_TOLERANCE {
            return Err(Error::ToleranceTooFine { tolerance, error });
        }
        Ok(Discretization::Tolerance(left))
    }

    /// Checks that a coordinate of a body can be told apart from others.
    ///
    /// # Errors
    /// [`Error::TooFarToPack`]
    pub(crate) fn check(self, name: &str, points: &[Point]) -> Result<()> {
        let limit = Packing::POINTS.limit();
        let beyond = |c: &&f64| self == Self::Packed21 && c.abs() > limit;
        match points.iter().flatten().find(beyond) {
            None => Ok(()),
            Some(&value) => Err(Error::TooFarToPack {
                name: name.to_owned(),
                value,
                limit,
            }),
        }
    }
}

/// Finest chordal tolerance, mm: a nanometre, far below any lathe.
const MIN_TOLERANCE: f64 = 1.0e-6;

/// How workers come by the rows that their positions need.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Distribution {
    /// The master sends each worker its rows and those of others that its cutter reaches: the first
    /// architecture of the 2001 paper. Rows that several need travel as often.
    #[default]
    Overlap,
    /// The master sends each row once, to the worker that owns it, and workers fetch the rest from
    /// each other: the paper's second architecture.
    Halo,
    /// The master sends surfaces and the parameters of their rows, and workers make the points.
    Surface,
}

impl Distribution {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Overlap, Self::Halo, Self::Surface];

    /// What it is called wherever it is typed or shown.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Overlap => "overlap",
            Self::Halo => "halo",
            Self::Surface => "surface",
        }
    }
}

impl fmt::Display for Distribution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// How a job is shared among workers. The path does not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sharing {
    /// How they come by their rows.
    pub distribution: Distribution,
    /// Into how many extents the job is cut for each of them: 1 or more.
    pub extents_per_worker: u32,
}

/// What the cutter touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// The points of the grid, as in the papers. The cutter sinks into the gaps between them.
    Point,
    /// The facets between the points.
    Facet,
}

/// How the touch is searched. All give the same bits, but for [`Local`] without its fallback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Only where it can be, by a hierarchy of bounds.
    Exact,
    /// Everywhere: Algorithm 1 of the 2001 paper.
    Brute,
    /// Around the last winners: Algorithm 2 of the 2001 paper.
    Local(Local),
}

/// The search around the last winner on each surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Local {
    /// How far around it; by default the smallest window that never loses the winner.
    pub window: Option<Window>,
    /// Points that are not evaluated.
    pub culling: Culling,
    /// Whether to fall back on the exact search where the window has lost the winner. Without it the
    /// path is the paper's, which may gouge.
    pub fallback: bool,
}

/// Only points less than this away from the last winner, in rows and in columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Window {
    /// δu, rows.
    pub delta_u: u32,
    /// δv, columns; round closed surfaces it wraps.
    pub delta_v: u32,
}

/// Points that are left out before their height is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Culling {
    /// Those whose surface faces away from the cutter.
    pub back_faces: bool,
    /// Those beyond the cutter's width: outside the tool's area of influence.
    pub beyond_reach: bool,
}

impl Window {
    /// Larger than any grid.
    pub const EVERYTHING: Self = Self {
        delta_u: 1 << 30,
        delta_v: 1 << 30,
    };
}

impl Local {
    /// Whether it takes the whole path in one process: a chain of windows without the fallback is one
    /// from end to end, and a window is found by trying it on all of it.
    pub fn needs_whole_path(&self) -> bool {
        !self.fallback || self.window.is_none()
    }
}

impl Method {
    /// Checks the numbers and that the method fits the job.
    ///
    /// # Errors
    /// [`crate::Error::OutOfBounds`] for a window that holds nothing, [`crate::Error::LocalNeedsPoints`]
    /// for windows over facets.
    pub fn validate(&self, contact: Contact) -> Result<()> {
        let Self::Local(local) = self else {
            return Ok(());
        };
        if contact == Contact::Facet {
            return Err(Error::LocalNeedsPoints);
        }
        local.window.map_or(Ok(()), |window| {
            let least = "at least 1";
            bounded(
                "delta_u",
                f64::from(window.delta_u),
                window.delta_u > 0,
                least,
            )?;
            bounded(
                "delta_v",
                f64::from(window.delta_v),
                window.delta_v > 0,
                least,
            )
        })
    }
}
