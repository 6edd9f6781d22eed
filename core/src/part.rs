//! The part: parametric surfaces and triangle meshes, each kept apart and in file order.
//!
//! Eq. (1) of the 2001 paper, widened to meshes. A body that exists is valid: its numbers are finite
//! and agree with each other. Files are read elsewhere.

use std::collections::HashMap;

use crate::error::{Error, Result};
use crate::surface::Surface;
use crate::tolerance::MAX_COORDINATE;
use crate::vector::{Interval, Point};

/// The part: its bodies, in file order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Part {
    /// Surfaces and meshes.
    pub bodies: Vec<Body>,
}

/// One surface or one mesh, with the name it has in its file.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// File and name or number within it, for messages.
    pub name: String,
    /// What it is.
    pub shape: Shape,
}

/// What a body is.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A parametric surface.
    Surface(Surface),
    /// A triangle mesh.
    Mesh(Mesh),
}

/// Triangles over shared vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
}

impl Part {
    /// Checks that there is something to machine.
    ///
    /// # Errors
    /// [`Error::EmptyPart`] if there is no surface and no triangle.
    pub fn validate(&self) -> Result<()> {
        let empty = self.bodies.iter().all(|b| match &b.shape {
            Shape::Surface(_) => false,
            Shape::Mesh(m) => m.triangles.is_empty(),
        });
        if empty { Err(Error::EmptyPart) } else { Ok(()) }
    }

    /// Checks that every pole and vertex is finite and within bounds.
    pub(crate) fn check_points(&self) -> Result<()> {
        self.bodies.iter().try_for_each(|body| match &body.shape {
            Shape::Surface(surface) => check_points(&body.name, "pole", surface.poles()),
            Shape::Mesh(mesh) => check_points(&body.name, "vertex", mesh.vertices()),
        })
    }

    /// Applies `f` to every pole and vertex.
    #[must_use]
    pub(crate) fn map_points(mut self, f: impl Fn(Point) -> Point) -> Self {
        for body in &mut self.bodies {
            body.shape.map_points(&f);
        }
        self
    }
}

impl Shape {
    /// Applies `f` to every pole or vertex.
    pub(crate) fn map_points(&mut self, f: impl Fn(Point) -> Point) {
        let points = match self {
            Self::Surface(s) => &mut s.poles,
            Self::Mesh(m) => &mut m.vertices,
        };
        for p in points {
            *p = f(*p);
        }
    }
}

impl Mesh {
    /// A mesh of `triangles`, each three indices into `vertices` (mm).
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::TooFar`] or [`Error::NoSuchVertex`]; `name` is for them.
    pub fn new(name: &str, vertices: Vec<Point>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        check_points(name, "vertex", &vertices)?;
        for (triangle, t) in triangles.iter().enumerate() {
            if let Some(&vertex) = t.iter().find(|&&v| v as usize >= vertices.len()) {
                return Err(Error::NoSuchVertex {
                    name: name.to_owned(),
                    triangle,
                    vertex,
                    vertices: vertices.len(),
                });
            }
        }
        Ok(Self {
            vertices,
            triangles,
        })
    }

    /// A mesh of triangles that are given by their corners (mm): those of the same bits become one vertex.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::TooFar`]; `name` is for them.
    pub fn of_corners(name: &str, corners: impl IntoIterator<Item = [Point; 3]>) -> Result<Self> {
        let mut places = HashMap::new();
        let mut vertices = Vec::new();
        let triangles = corners.into_iter().map(|corners| {
            corners.map(|corner| {
                // −0 and 0 are the same place. More vertices than a u32 counts would take 100 GB.
                let corner = corner.map(|c| c + 0.0);
                *places.entry(corner.map(f64::to_bits)).or_insert_with(|| {
                    vertices.push(corner);
                    vertices.len() as u32 - 1
                })
            })
        });
        let triangles = triangles.collect();
        Self::new(name, vertices, triangles)
    }

    /// Vertices, mm.
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Triangles, as indices into the vertices.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Edges that do not lie between exactly two triangles, by their vertices, vertices at the same place
    /// being one; none means that the mesh is watertight. Degenerate triangles are passed over.
    pub fn open_edges(&self) -> Vec<[u32; 2]> {
        let mut places = HashMap::with_capacity(self.vertices.len());
        let welded: Vec<u32> = (0u32..)
            .zip(&self.vertices)
            .map(|(i, v)| *places.entry(v.map(|c| (c + 0.0).to_bits())).or_insert(i))
            .collect();
        let mut faces: HashMap<(u32, u32), u32> =
            HashMap::with_capacity(self.triangles.len() * 3 / 2);
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| welded[v as usize]);
            if a == b || b == c || c == a {
                continue;
            }
            for (p, q) in [(a, b), (b, c), (c, a)] {
                *faces.entry((p.min(q), p.max(q))).or_insert(0) += 1;
            }
        }
        let open = faces.into_iter().filter(|&(_, n)| n != 2);
        let mut open: Vec<[u32; 2]> = open.map(|((p, q), _)| [p, q]).collect();
        open.sort_unstable();
        open
    }

    /// The same with every triangle turned round.
    #[must_use]
    pub(crate) fn reversed(&self) -> Self {
        Self {
            vertices: self.vertices.clone(),
            triangles: self.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
        }
    }

    /// Extent along x, mm.
    pub fn x_range(&self) -> Interval {
        let used = self.triangles.iter().flatten();
        Interval::of(used.map(|&v| self.vertices[v as usize][0]))
    }
}

/// Refuses coordinates that are not finite or that are too far out.
pub(crate) fn check_points(name: &str, what: &'static str, points: &[Point]) -> Result<()> {
    for (index, p) in points.iter().enumerate() {
        if let Some(&value) = p.iter().find(|c| !c.is_finite()) {
            return Err(Error::NotFinite {
                name: name.to_owned(),
                what,
                index,
                value,
            });
        }
        if let Some(&value) = p.iter().find(|c| c.abs() > MAX_COORDINATE) {
            return Err(Error::TooFar {
                name: name.to_owned(),
                what,
                index,
                value,
                limit: MAX_COORDINATE,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> (Vec<Point>, Vec<[u32; 3]>) {
        let v = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        (v, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    }

    #[test]
    fn open_edges_are_counted() {
        let (v, t) = tetrahedron();
        let closed = Mesh::new("t", v.clone(), t.clone()).expect("valid");
        assert_eq!(closed.open_edges().len(), 0);
        let open = Mesh::new("t", v, t[1..].to_vec()).expect("valid");
        assert_eq!(open.open_edges().len(), 3);
    }

    #[test]
    fn bad_numbers_are_refused_by_name() {
        let (mut v, t) = tetrahedron();
        v[2][1] = f64::NAN;
        let e = Mesh::new("a.stl", v, t).expect_err("NaN");
        assert!(e.to_string().contains("a.stl: vertex 2"), "{e}");
    }
}
