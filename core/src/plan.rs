//! The plan: everything that follows from a part and a job before the first position is digitized.

use crate::discretize::{Layout, Model, fill, layout};
use crate::error::{Error, Result};
use crate::extent::{Extent, split};
use crate::job::{Discretization, Job, Method};
use crate::motion::Trajectory;
use crate::part::{Body, Part, Shape};
use crate::vector::Interval;

/// A job ready to be digitized, here or elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What was asked for.
    pub job: Job,
    /// The part's rows.
    pub model: Model,
    /// The positions.
    pub trajectory: Trajectory,
    /// How many positions may be inserted between them: as many as there is memory for; none if the
    /// job does not ask for any.
    pub most_inserted: u64,
}

/// Memory for each position: its touch while it is collected, stitched and written.
const POSITION_BYTES: f64 = 160.0;

/// Memory for each inserted position: the same, and what [`crate::verify()`] takes.
const INSERTED_BYTES: f64 = 400.0;

/// Memory for each point of a grid: in its row, in the hierarchy, and its two facets.
const POINT_BYTES: f64 = 320.0;

impl Plan {
    /// Discretizes the part and lays out the positions, if that fits into `memory` bytes.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] before anything large is tried; those of [`crate::discretize()`] and of
    /// [`crate::Motion::over`].
    pub fn new(part: &Part, job: Job, memory: u64) -> Result<Self> {
        part.validate()?;
        job.validate()?;
        if let Method::Local(_) = job.method {
            let mesh = part
                .bodies
                .iter()
                .find(|b| matches!(b.shape, Shape::Mesh(_)));
            if let Some(Body { name, .. }) = mesh {
                return Err(Error::LocalNeedsGrids { name: name.clone() });
            }
        }
        let half_width = job.cutter.half_width();
        // The net of poles holds its surface, so this is an upper bound, and it costs nothing.
        let upper = job.motion.over(hull(part), half_width)?;
        check_memory(points(part, job.discretization), upper.positions, memory)?;
        let layout = layout(part, job.discretization)?;
        let points = layout.iter().map(Layout::points).sum();
        check_memory(points, upper.positions, memory)?;
        let model = fill(&layout);
        let x = model
            .outlines
            .iter()
            .fold(Interval::EMPTY, |x, r| x.hull(r.x));
        let trajectory = job.motion.over(x, half_width)?;
        let left = memory as f64 - memory_for(points, trajectory.positions);
        let most_inserted = match job.motion.path_tolerance {
            Some(_) => (left / INSERTED_BYTES) as u64,
            None => 0,
        };
        Ok(Self {
            job,
            model,
            trajectory,
            most_inserted,
        })
    }

    /// Whether so many inserted positions can be kept.
    ///
    /// # Errors
    /// [`Error::TooManyInserted`]
    pub fn check_inserted(&self, inserted: u64) -> Result<()> {
        let limit = self.most_inserted;
        if inserted > limit {
            return Err(Error::TooManyInserted { limit });
        }
        Ok(())
    }

    /// Cuts the positions into at most `parts` extents of about equal predicted work.
    pub fn split(&self, parts: u32) -> Vec<Extent> {
        let Self {
            job,
            model,
            trajectory,
            ..
        } = self;
        split(trajectory, &model.outlines, job, parts)
    }
}

/// Extent along the spindle of poles and vertices.
fn hull(part: &Part) -> Interval {
    let shapes = part.bodies.iter().map(|b| match &b.shape {
        Shape::Mesh(mesh) => mesh.x_range(),
        Shape::Surface(surface) => Interval::of(surface.poles().iter().map(|p| p[0])),
    });
    shapes.fold(Interval::EMPTY, Interval::hull)
}

/// How many points the part will have, as far as that is known before it is discretized.
fn points(part: &Part, discretization: Discretization) -> f64 {
    let points = part
        .bodies
        .iter()
        .map(|b| match (&b.shape, discretization) {
            (Shape::Mesh(mesh), _) => mesh.vertices().len().max(mesh.triangles().len() / 2) as f64,
            (Shape::Surface(_), Discretization::Grid { rows, columns }) => {
                f64::from(rows) * f64::from(columns)
            }
            (Shape::Surface(surface), Discretization::Tolerance(_)) => surface.poles().len() as f64,
        });
    points.sum()
}

fn check_memory(points: f64, positions: u64, available: u64) -> Result<()> {
    let needed = memory_for(points, positions);
    if needed > available as f64 {
        return Err(Error::OutOfMemory {
            points,
            positions,
            needed,
            available,
        });
    }
    Ok(())
}

fn memory_for(points: f64, positions: u64) -> f64 {
    points * POINT_BYTES + positions as f64 * POSITION_BYTES
}
