//! What is in a part file, for `horma inspect`: every body, its kind and its size.
//!
//! It describes what is read, and reads nothing that [`crate::part`] does not.

use std::fmt;
use std::path::Path;

use horma_core::{Direction, Mesh, Part, Point, Shape, Surface, cross, dot, length, sub};

use crate::error::Result;
use crate::part::{self, Reading, Trimmed, Unit, Warning};

/// Opposite sides of a surface that are no further apart than this are one, mm.
const CLOSED: f64 = 1.0e-6;

/// Points on each polynomial piece of a surface, to find its extent.
const POINTS: usize = 8;

/// Most points in either direction.
const MAX_POINTS: usize = 1000;

/// The content of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// The file's name.
    pub file: String,
    /// The unit in which its lengths are.
    pub unit: Unit,
    /// Whether it states that.
    pub stated: bool,
    /// Its bodies, in file order.
    pub bodies: Vec<BodyInfo>,
    /// What reading it brought up.
    pub warnings: Vec<Warning>,
}

/// One body.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyInfo {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Least coordinates, mm.
    pub low: Point,
    /// Greatest coordinates, mm.
    pub high: Point,
}

/// What a body is.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// A B-spline surface; pairs are for u and v.
    Surface {
        /// Degrees.
        degrees: [usize; 2],
        /// Numbers of poles.
        poles: [usize; 2],
        /// Whether it has weights.
        rational: bool,
        /// Whether it meets itself.
        closed: [bool; 2],
    },
    /// A triangle mesh.
    Mesh {
        /// Number of triangles.
        triangles: usize,
        /// Number of vertices.
        vertices: usize,
        /// Edges that do not lie between exactly two triangles.
        open_edges: usize,
        /// What a watertight mesh encloses, mm³.
        volume: Option<f64>,
    },
}

/// Reads the file at `path` and describes it; `unit` is that of its lengths if it states none. Gives the part
/// too, where it is in the file.
///
/// # Errors
/// Those of [`part::read`].
pub fn inspect(path: &Path, unit: Option<Unit>) -> Result<(Inspection, Part)> {
    // What a trim cuts away can be looked at all the same.
    let trimmed = Trimmed::Whole;
    let loaded = part::read(path, &Reading { unit, trimmed })?;
    let part = Part {
        bodies: loaded.bodies,
    };
    part.validate()?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    let bodies = part.bodies.iter().map(|body| {
        let (kind, points) = match &body.shape {
            Shape::Surface(surface) => describe_surface(surface),
            Shape::Mesh(mesh) => describe_mesh(mesh),
        };
        let (low, high) = extent(&points);
        BodyInfo {
            name: body.name.clone(),
            kind,
            low,
            high,
        }
    });
    let inspection = Inspection {
        file: name.to_string_lossy().into_owned(),
        unit: loaded.unit,
        stated: loaded.stated,
        bodies: bodies.collect(),
        warnings: loaded.warnings,
    };
    Ok((inspection, part))
}

fn describe_surface(surface: &Surface) -> (Kind, Vec<Point>) {
    let directions = [surface.u(), surface.v()];
    let [us, vs] = directions.map(parameters);
    let kind = Kind::Surface {
        degrees: directions.map(|d| d.degree),
        poles: directions.map(Direction::count),
        rational: surface.weights().is_some(),
        closed: [
            is_closed(surface, &vs),
            is_closed(&surface.transposed(), &us),
        ],
    };
    (kind, surface.grid(&us, &vs))
}

fn parameters(direction: &Direction) -> Vec<f64> {
    let pieces = direction.breaks().len() - 1;
    let count = (pieces * POINTS).min(MAX_POINTS);
    let (first, last) = direction.domain();
    let step = (last - first) / count as f64;
    let start = (0..count).map(|i| first + step * i as f64);
    start.chain([last]).collect()
}

/// Whether the sides `u = first` and `u = last` are one.
fn is_closed(surface: &Surface, vs: &[f64]) -> bool {
    let (first, last) = surface.u().domain();
    let sides = surface.grid(&[first, last], vs);
    let (a, b) = sides.split_at(vs.len());
    a.iter().zip(b).all(|(&a, &b)| length(sub(a, b)) <= CLOSED)
}

fn describe_mesh(mesh: &Mesh) -> (Kind, Vec<Point>) {
    let open_edges = mesh.open_edges().len();
    let kind = Kind::Mesh {
        triangles: mesh.triangles().len(),
        vertices: mesh.vertices().len(),
        open_edges,
        volume: (open_edges == 0).then(|| volume(mesh)),
    };
    (kind, mesh.vertices().to_vec())
}

/// The tetrahedra between one vertex and every triangle, added up with their signs.
fn volume(mesh: &Mesh) -> f64 {
    let apex = mesh.vertices().first().copied().unwrap_or_default();
    let tetrahedra = mesh.triangles().iter().map(|t| {
        let [a, b, c] = t.map(|v| sub(mesh.vertices()[v as usize], apex));
        dot(a, cross(b, c)) / 6.0
    });
    tetrahedra.sum::<f64>().abs()
}

fn extent(points: &[Point]) -> (Point, Point) {
    let of = |pick: fn(f64, f64) -> f64, start: f64| {
        points.iter().fold([start; 3], |bound, p| {
            std::array::from_fn(|i| pick(bound[i], p[i]))
        })
    };
    (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY))
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Surface {
                degrees: [p, q],
                poles: [m, n],
                rational,
                closed,
            } => {
                let rational = if *rational { "rational " } else { "" };
                let closed = match closed {
                    [false, false] => "open",
                    [true, false] => "closed in u",
                    [false, true] => "closed in v",
                    [true, true] => "closed in u and v",
                };
                write!(
                    f,
                    "{rational}B-spline of degree {p} × {q}, {m} × {n} poles, {closed}"
                )
            }
            Self::Mesh {
                triangles,
                vertices,
                open_edges,
                volume,
            } => {
                write!(f, "mesh of {triangles} triangles, {vertices} vertices, ")?;
                match volume {
                    Some(volume) => write!(f, "watertight, {:.1} cm³", volume / 1000.0),
                    None => write!(f, "{open_edges} open edges"),
                }
            }
        }
    }
}

impl Inspection {
    /// The unit of its lengths, and whether it says so.
    pub fn unit(&self) -> String {
        let Unit { name, millimetres } = &self.unit;
        match self.stated {
            true => name.clone(),
            false if *millimetres == 1.0 => "no unit stated, taken as mm".to_owned(),
            false => format!("no unit stated, taken as {name}"),
        }
    }

    /// Name, kind, size and least corner of each body, in words.
    pub fn rows(&self) -> Vec<[String; 4]> {
        let prefix = format!("{}: ", self.file);
        self.bodies.iter().map(|b| row(b, &prefix)).collect()
    }
}

/// A line for the file, one for each body, in columns, and one for each warning.
impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.bodies.len();
        let bodies = if count == 1 { "body" } else { "bodies" };
        write!(f, "{}: {count} {bodies}, {}", self.file, self.unit())?;
        let rows = self.rows();
        let width = |i: usize| rows.iter().map(|r| r[i].chars().count()).max().unwrap_or(0);
        let widths = [width(0), width(1), width(2)];
        for [name, kind, size, from] in &rows {
            let [a, b, c] = widths;
            write!(f, "\n  {name:a$}  {kind:b$}  {size:>c$}  {from}")?;
        }
        for warning in &self.warnings {
            write!(f, "\nwarning: {warning}")?;
        }
        Ok(())
    }
}

fn row(body: &BodyInfo, prefix: &str) -> [String; 4] {
    let BodyInfo { low, high, .. } = body;
    let [x, y, z] = sub(*high, *low);
    [
        body.name
            .strip_prefix(prefix)
            .unwrap_or(&body.name)
            .to_owned(),
        body.kind.to_string(),
        format!("{x:.2} × {y:.2} × {z:.2} mm"),
        format!("from ({:.2}, {:.2}, {:.2})", low[0], low[1], low[2]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(file: &str, content: &str) -> String {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join(file);
        std::fs::write(&path, content).expect("written");
        inspect(&path, None).expect("valid").0.to_string()
    }

    #[test]
    fn a_watertight_mesh_has_a_volume() {
        let corners = "v 0 0 0\nv 10 0 0\nv 0 20 0\nv 0 0 30\n";
        let faces = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
        let expected = "t.obj: 1 body, no unit stated, taken as mm
  t.obj  mesh of 4 triangles, 4 vertices, watertight, 1.0 cm³  \
            10.00 × 20.00 × 30.00 mm  from (0.00, 0.00, 0.00)";
        assert_eq!(shown("t.obj", &format!("{corners}{faces}")), expected);
        let open = shown(
            "t.obj",
            &format!("{corners}o long name\n{}o b\nf 1 2 3\n", &faces[8..]),
        );
        let expected = "t.obj: 2 bodies, no unit stated, taken as mm
  long name  mesh of 3 triangles, 4 vertices, 3 open edges  \
            10.00 × 20.00 × 30.00 mm  from (0.00, 0.00, 0.00)
  b          mesh of 1 triangles, 3 vertices, 3 open edges   \
            10.00 × 20.00 × 0.00 mm  from (0.00, 0.00, 0.00)
warning: t.obj: long name: 3 edges are open; the mesh is machined as it is
warning: t.obj: b: 3 edges are open; the mesh is machined as it is";
        assert_eq!(open, expected);
    }

    #[test]
    fn surfaces_know_whether_they_are_closed() {
        let line = |r: f64| [[0.0, r, 0.0], [9.0, r, 0.0]];
        let u = Direction {
            degree: 1,
            knots: vec![0.0, 0.0, 1.0, 1.0],
        };
        let v = Direction {
            degree: 1,
            knots: vec![0.0, 0.0, 1.0, 2.0, 2.0],
        };
        let check = |last: Point, expected: [bool; 2]| {
            // Three poles around the x axis at each end, v running fastest.
            let ring = |i: usize| {
                [
                    line(1.0)[i],
                    line(-1.0)[i],
                    [line(0.0)[i][0], last[1], last[2]],
                ]
            };
            let poles = [ring(0), ring(1)].concat();
            let s = Surface::new("s", u.clone(), v.clone(), poles, None).expect("valid");
            let (kind, points) = describe_surface(&s);
            assert!(
                matches!(kind, Kind::Surface { closed, .. } if closed == expected),
                "{kind}"
            );
            assert_eq!(extent(&points).0, [0.0, -1.0, 0.0]);
        };
        check([0.0, 1.0, 0.0], [false, true]);
        check([0.0, 1.0, 2.0], [false, false]);
    }
}
