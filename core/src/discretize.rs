//! The discrete model: from surfaces and meshes to rows.
//!
//! A surface becomes a grid, either of a stated size (eqs. 1–3 of the 2001 paper) or as fine as a
//! chordal tolerance asks; a mesh is cut into slabs along the spindle. Nothing is welded across
//! seams and no degenerate facet is removed: the contact with a facet copes with both.

use std::collections::HashMap;

use crate::error::{Error, Result};
use crate::grid::SurfaceGrid;
use crate::job::{Coordinates, Discretization};
use crate::part::{Body, Mesh, Part, Shape};
use crate::record::BodyRecord;
use crate::refine::refine;
use crate::row::{Facet, Outline, Row, RowKind, facets, join};
use crate::surface::{Direction, Surface};
use crate::vector::Point;

/// Facets in one slab of a mesh: few enough that a worker's overlap is thin, enough that a row is
/// worth sending.
const SLAB_FACETS: usize = 256;

/// Most rows, and most columns, of one surface.
pub(crate) const MAX_LINES: usize = 1 << 20;

/// The part's discrete model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Model {
    /// All rows; row `i` has the id `i`.
    pub rows: Vec<Row>,
    /// The outline of each row.
    pub outlines: Vec<Outline>,
    /// What became of each body, in order.
    pub bodies: Vec<BodyRecord>,
}

impl Model {
    /// Rows of grids whose points are there already: each an array of rows, none shorter than another, that
    /// run around the spindle one after the other.
    ///
    /// # Errors
    /// [`Error::EmptyPart`] without a grid; [`Error::OutOfBounds`] for one of fewer than 2 × 2 points;
    /// [`Error::UnequalRows`]; those of points that are not finite or too far out.
    pub fn of_grids(grids: &[Vec<Vec<Point>>]) -> Result<Self> {
        if grids.is_empty() {
            return Err(Error::EmptyPart);
        }
        let mut model = Self::default();
        for (number, grid) in (1..).zip(grids) {
            let columns = grid.first().map_or(0, Vec::len) as u32;
            let size = Discretization::Grid {
                rows: grid.len() as u32,
                columns,
            };
            size.validate()?;
            let first = model.rows.len();
            let last = first + grid.len() - 1;
            model
                .rows
                .extend((first..).zip(grid).map(|(id, points)| Row {
                    id: id as u32,
                    points: points.clone(),
                    kind: RowKind::Isoline {
                        joins_next: id < last,
                    },
                }));
            let rows = &model.rows[first..];
            rows.iter().try_for_each(Row::validate)?;
            let mut pairs = rows.windows(2);
            pairs.try_for_each(|pair| pair[0].validate_next(&pair[1]))?;
            let mut outlines: Vec<Outline> = rows.iter().map(Row::outline).collect();
            let name = format!("grid {number}");
            model
                .bodies
                .push(joined(name, &mut outlines, Some(columns), None));
            model.outlines.extend(outlines);
        }
        Ok(model)
    }

    /// Every facet by its corners, mm.
    pub fn triangles(&self) -> Vec<[Point; 3]> {
        let points: Vec<Point> = self.rows.iter().flat_map(|r| r.points.clone()).collect();
        let triangle = |f: Facet| f.corners.map(|c| points[c as usize]);
        facets(&self.rows).map(triangle).collect()
    }
}

/// Makes the rows of every body, their coordinates doubles.
///
/// # Errors
/// [`Error::EmptyPart`], [`Error::GridTooLarge`] or [`Error::ToleranceNotReached`].
pub fn discretize(part: &Part, discretization: Discretization) -> Result<Model> {
    Ok(fill(&layout(part, discretization, Coordinates::Double)?))
}

/// A body as it is going to be discretized.
pub(crate) struct Layout<'a> {
    name: &'a str,
    shape: LayoutShape<'a>,
    coordinates: Coordinates,
}

enum LayoutShape<'a> {
    Mesh(&'a Mesh),
    Grid(Surface, Lines),
}

impl Layout<'_> {
    /// Number of points, or of pairs of facets if these are more.
    pub fn points(&self) -> f64 {
        match &self.shape {
            LayoutShape::Mesh(mesh) => mesh.vertices().len().max(mesh.triangles().len() / 2) as f64,
            LayoutShape::Grid(_, grid) => grid.us.len() as f64 * grid.vs.len() as f64,
        }
    }
}

/// Decides on the lines of every grid, and makes none yet.
pub(crate) fn layout(
    part: &Part,
    discretization: Discretization,
    coordinates: Coordinates,
) -> Result<Vec<Layout<'_>>> {
    part.validate()?;
    discretization.validate()?;
    let chordal = coordinates.chordal(discretization)?;
    let bodies = part.bodies.iter();
    bodies
        .map(|body| layout_body(body, chordal, coordinates))
        .collect()
}

fn layout_body(
    body: &Body,
    discretization: Discretization,
    coordinates: Coordinates,
) -> Result<Layout<'_>> {
    let name = &body.name;
    let shape = match &body.shape {
        Shape::Mesh(mesh) => {
            coordinates.check(name, mesh.vertices())?;
            LayoutShape::Mesh(mesh)
        }
        Shape::Surface(surface) => {
            // Its net of poles holds the surface.
            coordinates.check(name, surface.poles())?;
            let surface = surface.clone().along_x();
            let grid = lines(name, &surface, discretization)?;
            LayoutShape::Grid(surface, grid)
        }
    };
    Ok(Layout {
        name,
        shape,
        coordinates,
    })
}

/// Makes the rows that were laid out.
pub(crate) fn fill(bodies: &[Layout]) -> Model {
    let mut rows = Vec::new();
    let survey = survey(bodies, |row| rows.push(row));
    Model {
        rows,
        outlines: survey.outlines,
        bodies: survey.bodies,
    }
}

/// What a plan has to know of rows that need not be there.
pub(crate) struct Survey {
    pub outlines: Vec<Outline>,
    pub bodies: Vec<BodyRecord>,
    pub grids: Vec<SurfaceGrid>,
}

/// Makes the rows that were laid out, one after the other, and leaves them to `take`.
pub(crate) fn survey(bodies: &[Layout], mut take: impl FnMut(Row)) -> Survey {
    let mut survey = Survey {
        outlines: Vec::new(),
        bodies: Vec::new(),
        grids: Vec::new(),
    };
    for body in bodies {
        let first = survey.outlines.len() as u32;
        let mut outlines = Vec::new();
        let mut add = |row: Row| {
            outlines.push(row.outline());
            take(row);
        };
        let Layout {
            name,
            shape,
            coordinates,
        } = body;
        let (columns, deviation) = match shape {
            LayoutShape::Mesh(mesh) => {
                slabs(mesh, *coordinates, first).for_each(add);
                (None, None)
            }
            LayoutShape::Grid(surface, lines) => {
                let grid = SurfaceGrid::whole(name, surface, lines, *coordinates, first);
                grid.rows(&mut add);
                survey.grids.push(grid);
                let deviation = lines.deviation.map(|d| d + coordinates.error());
                (Some(lines.vs.len() as u32), deviation)
            }
        };
        let name = (*name).to_owned();
        let joined = joined(name, &mut outlines, columns, deviation);
        survey.bodies.push(BodyRecord {
            rounding: coordinates.error(),
            ..joined
        });
        survey.outlines.extend(outlines);
    }
    survey
}

/// Joins the outlines of a body, and tells what became of it.
fn joined(
    name: String,
    outlines: &mut [Outline],
    columns: Option<u32>,
    deviation: Option<f64>,
) -> BodyRecord {
    join(outlines);
    let x = Outline::span(outlines);
    BodyRecord {
        name,
        rows: outlines.len() as u32,
        columns,
        points: outlines.iter().map(|r| r.points).sum(),
        facets: outlines.iter().map(|r| r.facets).sum(),
        x: [x.low, x.high],
        deviation,
        rounding: 0.0,
    }
}

/// The parameters of a grid's lines.
pub(crate) struct Lines {
    pub us: Vec<f64>,
    pub vs: Vec<f64>,
    pub deviation: Option<f64>,
}

fn lines(name: &str, surface: &Surface, discretization: Discretization) -> Result<Lines> {
    match discretization {
        Discretization::Tolerance(tolerance) => refine(name, surface, tolerance),
        Discretization::Grid { rows, columns } => {
            let (rows, columns) = (rows as usize, columns as usize);
            if rows.max(columns) > MAX_LINES {
                return Err(Error::GridTooLarge {
                    name: name.to_owned(),
                    rows,
                    columns,
                    limit: MAX_LINES,
                });
            }
            Ok(Lines {
                us: evenly(surface.u(), rows),
                vs: evenly(surface.v(), columns),
                deviation: None,
            })
        }
    }
}

/// `n` evenly spaced parameters, both ends of the domain included: eq. (2).
fn evenly(direction: &Direction, n: usize) -> Vec<f64> {
    let (low, high) = direction.domain();
    let last = (n - 1) as f64;
    let inner = (0..n - 1).map(|i| low + (high - low) * (i as f64 / last));
    inner.chain([high]).collect()
}

/// The slabs of a mesh, their ids counted on from `first`.
fn slabs(mesh: &Mesh, coordinates: Coordinates, first: u32) -> impl Iterator<Item = Row> {
    let vertex = |v: u32| mesh.vertices()[v as usize];
    let middle = |t: &[u32; 3]| t.iter().map(|&v| vertex(v)[0]).sum::<f64>();
    let mut order: Vec<[u32; 3]> = mesh.triangles().to_vec();
    // The sort is stable, so triangles at the same place stay in file order.
    order.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
    let count = order.len().div_ceil(SLAB_FACETS);
    (0..count).map(move |i| {
        let slab = &order[i * SLAB_FACETS..order.len().min((i + 1) * SLAB_FACETS)];
        let mut points: Vec<Point> = Vec::new();
        let mut local = HashMap::new();
        let facets = slab.iter().map(|t| {
            t.map(|v| {
                *local.entry(v).or_insert_with(|| {
                    points.push(coordinates.round(vertex(v)));
                    points.len() as u32 - 1
                })
            })
        });
        let facets = facets.collect();
        Row {
            id: first + i as u32,
            points,
            kind: RowKind::Slab { facets },
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::tests::quarter_cylinder;

    fn part(shape: Shape) -> Part {
        Part {
            bodies: vec![Body {
                name: "body".to_owned(),
                shape,
            }],
        }
    }

    #[test]
    fn a_grid_has_both_ends_and_its_rows_across_the_spindle() {
        let surface = quarter_cylinder(5.0, 10.0).transposed();
        let size = Discretization::Grid {
            rows: 3,
            columns: 5,
        };
        let model = discretize(&part(Shape::Surface(surface)), size).expect("valid");
        let xs: Vec<_> = model.rows.iter().map(|r| r.points[0][0]).collect();
        assert_eq!(xs, [0.0, 5.0, 10.0]);
        assert!(model.rows.iter().all(|r| r.points.len() == 5));
        let outlines = &model.outlines;
        assert_eq!(outlines[0].x.high, 5.0, "facets reach up to the next row");
        assert_eq!(outlines[2].facets, 0);
    }

    #[test]
    fn points_that_are_there_are_taken_as_they_are() {
        let surface = quarter_cylinder(5.0, 10.0);
        let size = |rows, columns| Discretization::Grid { rows, columns };
        let made = |rows, columns| {
            let part = part(Shape::Surface(surface.clone()));
            discretize(&part, size(rows, columns)).expect("valid")
        };
        let points = |model: &Model| -> Vec<Vec<Point>> {
            model.rows.iter().map(|r| r.points.clone()).collect()
        };
        let (a, b) = (made(3, 5), made(4, 7));
        let both = Model::of_grids(&[points(&a), points(&b)]).expect("valid");
        assert_eq!(
            both.outlines,
            [a.outlines.clone(), b.outlines.clone()].concat()
        );
        assert_eq!(both.rows[..3], a.rows);
        assert_eq!(both.rows[3].id, 3);
        assert_eq!(both.bodies[1].facets, b.bodies[0].facets);

        let mut short = points(&a);
        short[1].pop();
        let mut far = points(&a);
        far[1][2][0] = f64::INFINITY;
        for bad in [
            vec![],
            vec![vec![]],
            vec![points(&a)[..1].to_vec()],
            vec![short],
            vec![far],
        ] {
            assert!(Model::of_grids(&bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn slabs_hold_every_triangle_once() {
        let n = 1000;
        let vertices = (0..n + 2).map(|i| [f64::from(i % 37), f64::from(i), 0.0]);
        let triangles = (0..n as u32).map(|i| [i, i + 1, i + 2]).collect();
        let mesh = Mesh::new("m", vertices.collect(), triangles).expect("valid");
        let model = discretize(&part(Shape::Mesh(mesh)), Discretization::Tolerance(0.1));
        let model = model.expect("valid");
        assert_eq!(model.rows.len(), 4);
        let facets: u64 = model.outlines.iter().map(|o| o.facets).sum();
        assert_eq!(facets, n as u64);
        model.rows.iter().for_each(|r| r.validate().expect("valid"));
    }
}
