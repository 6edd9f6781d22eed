//! What is drawn of a part: its surfaces as grids with their normals, its meshes as they are.
//!
//! A picture needs no chordal tolerance: cells of some pixels, shaded smoothly, look like the
//! surface and cost a fraction of finding a grid that is proven fine enough.

use horma_core::{
    Direction, Interval, Mesh, Part, Point, Shape, Surface, cross, length, sub, unit,
};

/// Triangles with vertices in common.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sheet {
    /// Its points, mm.
    pub points: Vec<Point>,
    /// Unit normal at each point, or nothing at all if its triangles are flat.
    pub normals: Vec<Point>,
    /// Its triangles by their points.
    pub triangles: Vec<[u32; 3]>,
}

/// Cells along the longest side of the part: each is some pixels of [`super::SIZE`].
const CELLS: f64 = 120.0;

/// Most cells along one direction of one surface.
const MAX_CELLS: f64 = 1200.0;

/// A sheet for each body.
pub fn sheets(part: &Part) -> Vec<Sheet> {
    let points = || part.bodies.iter().flat_map(|body| outline(&body.shape));
    let side = |k: usize| {
        let x = Interval::of(points().map(|p| p[k]));
        x.high - x.low
    };
    let cell = (0..3).map(side).fold(0.0, f64::max) / CELLS;
    let bodies = part.bodies.iter();
    bodies
        .map(|body| match &body.shape {
            Shape::Surface(surface) => of_surface(surface, cell),
            Shape::Mesh(mesh) => of_mesh(mesh),
        })
        .collect()
}

/// Points that the body lies within.
fn outline(shape: &Shape) -> &[Point] {
    match shape {
        Shape::Surface(surface) => surface.poles(),
        Shape::Mesh(mesh) => mesh.vertices(),
    }
}

fn of_mesh(mesh: &Mesh) -> Sheet {
    Sheet {
        points: mesh.vertices().to_vec(),
        normals: Vec::new(),
        triangles: mesh.triangles().to_vec(),
    }
}

fn of_surface(surface: &Surface, cell: f64) -> Sheet {
    let (poles, n) = (surface.poles(), surface.v().count());
    let gap = |a: usize, b: usize| length(sub(poles[b], poles[a]));
    // No line of a surface is much longer than the longest line of its poles.
    let along_u = (0..n).map(|j| (j + n..poles.len()).step_by(n).map(|b| gap(b - n, b)).sum());
    let along_v = (0..poles.len())
        .step_by(n)
        .map(|i| (i + 1..i + n).map(|b| gap(b - 1, b)).sum());
    let cells = |length: f64| (length / cell).ceil().clamp(1.0, MAX_CELLS) as usize;
    let us = lines(surface.u(), cells(along_u.fold(0.0, f64::max)));
    let vs = lines(surface.v(), cells(along_v.fold(0.0, f64::max)));
    let points = surface.grid(&us, &vs);
    let (rows, columns) = (us.len(), vs.len());
    let at = |i: usize, j: usize| points[i * columns + j];
    let normal = |i: usize, j: usize| {
        let along = sub(at((i + 1).min(rows - 1), j), at(i.saturating_sub(1), j));
        let across = sub(at(i, (j + 1).min(columns - 1)), at(i, j.saturating_sub(1)));
        // Where a side collapses into a point there is none, and the facets' own will do.
        unit(cross(along, across)).unwrap_or([0.0; 3])
    };
    let all = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
    let normals = all.map(|(i, j)| normal(i, j)).collect();
    let corners = (0..rows - 1).flat_map(|i| (0..columns - 1).map(move |j| i * columns + j));
    let triangles = corners.flat_map(|k| {
        let [a, b, c, d] = [k, k + 1, k + columns, k + columns + 1].map(|k| k as u32);
        [[a, c, d], [a, d, b]]
    });
    Sheet {
        triangles: triangles.collect(),
        normals,
        points,
    }
}

/// Parameters of about `cells` cells: the breaks, so that a crease stays one, and as many between
/// them as are wanted. Of more breaks than that, only some.
fn lines(direction: &Direction, cells: usize) -> Vec<f64> {
    let breaks = direction.breaks();
    let last = breaks.len() - 1;
    let ends: Vec<f64> = if last > cells {
        (0..=cells).map(|i| breaks[i * last / cells]).collect()
    } else {
        breaks
    };
    let pieces = ends.len() - 1;
    let each = ((cells + pieces / 2) / pieces).max(1);
    let inner = ends.windows(2).flat_map(|w| {
        let (from, width) = (w[0], w[1] - w[0]);
        (0..each).map(move |i| from + width * (i as f64 / each as f64))
    });
    inner.chain(ends.last().copied()).collect()
}

#[cfg(test)]
mod tests {
    use horma_core::Body;

    use super::*;

    /// A strip bent by a right angle, in `pieces` along u.
    fn bent(pieces: usize) -> Surface {
        let knots = |n: usize| {
            let inner = (0..=n).map(|i| i as f64);
            [0.0].into_iter().chain(inner).chain([n as f64]).collect()
        };
        let direction = |n| Direction {
            degree: 1,
            knots: knots(n),
        };
        let half = pieces as f64 / 2.0;
        let poles = (0..=pieces).flat_map(|i| {
            let along = i as f64 - half;
            [0.0, 3.0].map(|y| [along, y, along.abs()])
        });
        Surface::new(
            "bent",
            direction(pieces),
            direction(1),
            poles.collect(),
            None,
        )
        .expect("valid")
    }

    #[test]
    fn a_surface_keeps_its_creases_and_its_ends() {
        for pieces in [2, 10, 4000] {
            let shape = Shape::Surface(bent(pieces));
            let body = Body {
                name: "bent".to_owned(),
                shape,
            };
            let sheets = sheets(&Part { bodies: vec![body] });
            let [sheet] = sheets.as_slice() else {
                panic!("one body")
            };
            let half = pieces as f64 / 2.0;
            let has = |p: Point| sheet.points.iter().any(|&q| length(sub(p, q)) < 1e-9);
            assert!(has([-half, 0.0, half]) && has([half, 3.0, half]));
            assert!(has([0.0; 3]) || pieces == 4000);
            let rows = sheet.points.iter().filter(|p| p[1] == 0.0).count();
            assert!((80..=240).contains(&rows), "{rows}");
            assert_eq!(sheet.normals.len(), sheet.points.len());
            let steep = sheet.normals[0][2].abs();
            assert!((steep - 0.5_f64.sqrt()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_mesh_is_drawn_as_it_is() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Mesh::new("m", corners, vec![[0, 1, 2]]).expect("valid");
        let sheet = of_mesh(&mesh);
        assert_eq!(sheet.triangles, mesh.triangles());
        assert!(sheet.normals.is_empty());
    }
}
