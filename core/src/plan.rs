//! The plan: everything that follows from a part and a job before the first position is digitized.

use std::ops::Range;

use crate::discretize::{Layout, Model, fill, layout, survey};
use crate::error::{Error, Result};
use crate::extent::{Extent, split};
use crate::grid::SurfaceGrid;
use crate::job::{Discretization, Distribution, Job, Method, Sharing};
use crate::motion::Trajectory;
use crate::part::{Part, Shape};
use crate::record::BodyRecord;
use crate::row::{Outline, Row};
use crate::runs::{Run, from_behind, interior_first, remaining};
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
        let (layout, needed) = lay_out(part, &job, memory, POINT_BYTES)?;
        let model = fill(&layout);
        let trajectory = positions(&job, &model.outlines)?;
        Ok(Self {
            job,
            model,
            trajectory,
            most_inserted: most_inserted(&job, memory as f64 - needed),
        })
    }

    /// Lays out the positions over rows that are there already, if all of it fits into `memory` bytes.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]; those of [`Job::validate`] and of [`crate::Motion::over`];
    /// [`Error::LocalNeedsGrids`] if a body is a mesh and the method goes by windows.
    pub fn over(model: Model, job: Job, memory: u64) -> Result<Self> {
        job.validate()?;
        let mesh = model.bodies.iter().find(|body| body.columns.is_none());
        if let (Method::Local(_), Some(mesh)) = (job.method, mesh) {
            let name = mesh.name.clone();
            return Err(Error::LocalNeedsGrids { name });
        }
        let trajectory = positions(&job, &model.outlines)?;
        let points = model.outlines.iter().map(|o| o.points as f64).sum();
        let needed = check_memory(points, POINT_BYTES, trajectory.positions, memory)?;
        Ok(Self {
            job,
            model,
            trajectory,
            most_inserted: most_inserted(&job, memory as f64 - needed),
        })
    }

    /// Whether so many inserted positions can be kept.
    ///
    /// # Errors
    /// [`Error::TooManyInserted`]
    pub fn check_inserted(&self, inserted: u64) -> Result<()> {
        check_inserted(inserted, self.most_inserted)
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

/// A job ready to be handed out to workers.
#[derive(Debug, Clone, PartialEq)]
pub struct Handout {
    /// What was asked for.
    pub job: Job,
    /// How it is shared among workers.
    pub sharing: Sharing,
    /// The positions.
    pub trajectory: Trajectory,
    /// The outline of each row.
    pub outlines: Vec<Outline>,
    /// What became of each body, in order.
    pub bodies: Vec<BodyRecord>,
    /// What rows are sent from.
    pub stock: Stock,
    /// How many positions may be inserted between them, as in [`Plan`].
    pub most_inserted: u64,
}

/// What a master has of the rows.
#[derive(Debug, Clone, PartialEq)]
pub enum Stock {
    /// All of them; row `i` has the id `i`.
    Rows(Vec<Row>),
    /// What they are made from, and none of their points.
    Grids(Vec<SurfaceGrid>),
}

impl Handout {
    /// Bytes of memory that the master of a job needs for it, as far as that is known beforehand; for
    /// positions to be inserted there has to be some more.
    ///
    /// # Errors
    /// Those of [`Handout::new`], before anything large is tried.
    pub fn predict(
        part: &Part,
        job: &Job,
        distribution: Distribution,
        memory: u64,
        workers_here: bool,
    ) -> Result<u64> {
        let point_bytes = point_bytes(part, distribution, workers_here)?;
        let (_, needed) = lay_out(part, job, memory, point_bytes)?;
        Ok(needed as u64)
    }

    /// Plans as [`Plan::new`] does. If the workers make the rows themselves, each is made here only
    /// for its outline, and dropped; their memory counts if it is the same, `workers_here`.
    ///
    /// # Errors
    /// Those of [`Plan::new`], and [`Error::SurfaceNeedsSurfaces`].
    pub fn new(
        part: &Part,
        job: Job,
        sharing: Sharing,
        memory: u64,
        workers_here: bool,
    ) -> Result<Self> {
        match sharing.distribution {
            Distribution::Overlap | Distribution::Halo => {
                let plan = Plan::new(part, job, memory)?;
                Ok(Self {
                    job,
                    sharing,
                    trajectory: plan.trajectory,
                    outlines: plan.model.outlines,
                    bodies: plan.model.bodies,
                    stock: Stock::Rows(plan.model.rows),
                    most_inserted: plan.most_inserted,
                })
            }
            Distribution::Surface => {
                let point_bytes = point_bytes(part, sharing.distribution, workers_here)?;
                let (layout, needed) = lay_out(part, &job, memory, point_bytes)?;
                let survey = survey(&layout, drop);
                Ok(Self {
                    job,
                    sharing,
                    trajectory: positions(&job, &survey.outlines)?,
                    outlines: survey.outlines,
                    bodies: survey.bodies,
                    stock: Stock::Grids(survey.grids),
                    most_inserted: most_inserted(&job, memory as f64 - needed),
                })
            }
        }
    }

    /// Cuts the positions into extents of about equal predicted work, for so many workers.
    pub fn split(&self, workers: u32) -> Vec<Extent> {
        let parts = workers.saturating_mul(self.sharing.extents_per_worker);
        split(&self.trajectory, &self.outlines, &self.job, parts)
    }

    /// Whether so many inserted positions can be kept.
    ///
    /// # Errors
    /// [`Error::TooManyInserted`]
    pub fn check_inserted(&self, inserted: u64) -> Result<()> {
        check_inserted(inserted, self.most_inserted)
    }

    /// The runs that are left of an extent when only these of its positions are missing, which ascend:
    /// in order, or for someone who `helps` another one that is at them.
    pub fn runs_left(&self, extent: &Extent, missing: &[Range<u64>], helps: bool) -> Vec<Run> {
        let (trajectory, outlines, job) = (&self.trajectory, &self.outlines, &self.job);
        let left = remaining(trajectory, outlines, job, &self.runs(extent), missing);
        if helps {
            return from_behind(trajectory, outlines, job, left);
        }
        left
    }

    /// The runs in which a worker digitizes an extent: what needs only the extent's own rows first, if
    /// the others are fetched meanwhile.
    pub fn runs(&self, extent: &Extent) -> Vec<Run> {
        match self.sharing.distribution {
            Distribution::Overlap | Distribution::Surface => vec![extent.whole()],
            Distribution::Halo => {
                interior_first(&self.trajectory, &self.outlines, &self.job, extent)
            }
        }
    }
}

/// Memory of this machine for each point, by who makes it.
fn point_bytes(part: &Part, distribution: Distribution, workers_here: bool) -> Result<f64> {
    if distribution != Distribution::Surface {
        return Ok(POINT_BYTES);
    }
    match mesh(part) {
        Some(name) => Err(Error::SurfaceNeedsSurfaces { name }),
        None if workers_here => Ok(POINT_BYTES),
        None => Ok(0.0),
    }
}

/// How many positions may be inserted if so many bytes are left.
fn most_inserted(job: &Job, left: f64) -> u64 {
    match job.motion.path_tolerance {
        Some(_) => (left / INSERTED_BYTES) as u64,
        None => 0,
    }
}

fn check_inserted(inserted: u64, limit: u64) -> Result<()> {
    if inserted > limit {
        return Err(Error::TooManyInserted { limit });
    }
    Ok(())
}

/// Checks a job, that it fits its part, and that it fits into `memory` bytes, each point taking
/// `point_bytes` of them; decides on the lines of every grid. Also tells how many bytes it takes.
fn lay_out<'a>(
    part: &'a Part,
    job: &Job,
    memory: u64,
    point_bytes: f64,
) -> Result<(Vec<Layout<'a>>, f64)> {
    part.validate()?;
    job.validate()?;
    if let Method::Local(_) = job.method
        && let Some(name) = mesh(part)
    {
        return Err(Error::LocalNeedsGrids { name });
    }
    // The net of poles holds its surface, so this is an upper bound, and it costs nothing.
    let upper = job.motion.over(hull(part), job.cutter.half_width())?;
    let check = |points| check_memory(points, point_bytes, upper.positions, memory);
    check(points(part, job.discretization))?;
    let layout = layout(part, job.discretization, job.coordinates)?;
    let needed = check(layout.iter().map(Layout::points).sum())?;
    Ok((layout, needed))
}

/// The positions over rows of these outlines.
fn positions(job: &Job, outlines: &[Outline]) -> Result<Trajectory> {
    job.motion
        .over(Outline::span(outlines), job.cutter.half_width())
}

/// The name of the first mesh.
fn mesh(part: &Part) -> Option<String> {
    let mut bodies = part.bodies.iter();
    let mesh = bodies.find(|b| matches!(b.shape, Shape::Mesh(_)));
    mesh.map(|b| b.name.clone())
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

fn check_memory(points: f64, point_bytes: f64, positions: u64, available: u64) -> Result<f64> {
    let needed = points * point_bytes + positions as f64 * POSITION_BYTES;
    if needed > available as f64 {
        return Err(Error::OutOfMemory {
            points,
            positions,
            needed,
            available,
        });
    }
    Ok(needed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extent::tests::job;
    use crate::part::Body;
    use crate::surface::tests::quarter_cylinder;

    #[test]
    fn over_rows_that_are_there_it_is_what_made_them() {
        let part = Part {
            bodies: vec![Body {
                name: "body".to_owned(),
                shape: Shape::Surface(quarter_cylinder(5.0, 10.0)),
            }],
        };
        let job = job(1.0, Some(0.01));
        let made = Plan::new(&part, job, 1 << 30).expect("a plan");
        let over = |memory| Plan::over(made.model.clone(), job, memory);
        assert_eq!(over(1 << 30), Ok(made.clone()));
        assert!(matches!(over(1000), Err(Error::OutOfMemory { .. })));
    }
}
