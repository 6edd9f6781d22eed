//! A last as dense triangles in its own coordinates, and sections through it.

use std::collections::{BTreeMap, HashMap};

use super::Frame;
use super::curve::join;
use super::landmarks::Landmarks;
use crate::discretize::discretize;
use crate::error::Result;
use crate::job::Discretization;
use crate::part::Part;
use crate::rays::Machined;
use crate::vector::{Interval, Point, add_scaled, cross, dot, length, sub, unit};

/// How far the triangles may lie from a surface, mm: a girth then is less than 0.01 mm too short.
const FINENESS: f64 = 0.0025;

/// Dense triangles over a last, in its own coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Skin {
    /// Corners, each place once.
    pub(super) points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    frame: Frame,
}

/// A plane: a point, and a direction square to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub point: Point,
    pub normal: Point,
}

impl Plane {
    /// Through three points; nothing if they are on a line.
    pub fn through(a: Point, b: Point, c: Point) -> Option<Self> {
        let normal = unit(cross(sub(b, a), sub(c, a)))?;
        Some(Self { point: a, normal })
    }

    fn height(&self, p: Point) -> f64 {
        dot(sub(p, self.point), self.normal)
    }

    /// Coordinates within the plane.
    pub fn within(&self, points: &[Point]) -> Vec<[f64; 2]> {
        let least = (0..3).min_by(|&a, &b| self.normal[a].abs().total_cmp(&self.normal[b].abs()));
        let mut axis = [0.0; 3];
        axis[least.unwrap_or(0)] = 1.0;
        let u = unit(cross(self.normal, axis)).unwrap_or(axis);
        let v = cross(self.normal, u);
        points.iter().map(|&p| [dot(p, u), dot(p, v)]).collect()
    }
}

impl Skin {
    /// All bodies of `part`.
    pub(super) fn of(part: &Part, frame: &Frame) -> Result<Self> {
        let model = discretize(part, Discretization::Tolerance(FINENESS))?;
        let mut places = HashMap::new();
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        for triangle in model.triangles() {
            let corners = triangle.map(|corner| {
                *places
                    .entry(corner.map(|c| (c + 0.0).to_bits()))
                    .or_insert_with(|| {
                        points.push(frame.inward(corner));
                        points.len() as u32 - 1
                    })
            });
            let [a, b, c] = corners;
            if a != b && b != c && c != a {
                triangles.push(corners);
            }
        }
        Ok(Self {
            points,
            triangles,
            frame: *frame,
        })
    }

    /// The same with every corner moved.
    pub(super) fn mapped(&self, f: impl Fn(Point) -> Point) -> Self {
        Self {
            points: self.points.iter().map(|&p| f(p)).collect(),
            triangles: self.triangles.clone(),
            frame: self.frame,
        }
    }

    /// Extent along the last, mm.
    pub(super) fn along(&self) -> Interval {
        Interval::of(self.points.iter().map(|p| p[0]))
    }

    /// The outline of a section: the longest curve in it. What is open is closed by straight lines.
    pub(super) fn section(&self, plane: &Plane) -> Vec<Point> {
        let heights: Vec<f64> = self.points.iter().map(|&p| plane.height(p)).collect();
        let over = |v: u32| heights[v as usize] >= 0.0;
        let mut beside: BTreeMap<(u32, u32), Vec<(u32, u32)>> = BTreeMap::new();
        for &[a, b, c] in &self.triangles {
            let edges = [(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q)));
            let mut crossed = edges.into_iter().filter(|&(p, q)| over(p) != over(q));
            if let (Some(p), Some(q)) = (crossed.next(), crossed.next()) {
                beside.entry(p).or_default().push(q);
                beside.entry(q).or_default().push(p);
            }
        }
        let place = |&(a, b): &(u32, u32)| {
            let [from, to] = [a, b].map(|v| heights[v as usize]);
            let [p, q] = [a, b].map(|v| self.points[v as usize]);
            add_scaled(p, from / (from - to), sub(q, p))
        };
        let curves = curves(&mut beside);
        join(
            curves
                .iter()
                .map(|c| c.iter().map(place).collect())
                .collect(),
        )
    }

    /// Landmarks on this skin where they have come to on one that was `moved`: as its nearest corners.
    pub(super) fn carried(&self, moved: &Self, landmarks: &Landmarks) -> Landmarks {
        landmarks.map(|place| {
            let off = |p: &Point| length(sub(*p, place));
            let pairs = self.points.iter().zip(&moved.points);
            let nearest = pairs.min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
            nearest.map_or(place, |(was, is)| add_scaled(place, 1.0, sub(*is, *was)))
        })
    }

    /// What a path makes of it: every corner moved along the surface's normal by as much as the machined
    /// surface is off there, and the share of the corners of which that is known; the rest stays.
    pub(super) fn machined(&self, machined: &Machined) -> (Self, f64) {
        let mut normals = vec![[0.0; 3]; self.points.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.points[v as usize]);
            let normal = cross(sub(b, a), sub(c, a));
            for &v in t {
                normals[v as usize] = add_scaled(normals[v as usize], 1.0, normal);
            }
        }
        let mut known = 0;
        let mut points = Vec::with_capacity(self.points.len());
        for (&p, normal) in self.points.iter().zip(normals) {
            let off = machined.at(self.frame.outward(p));
            let from_spindle = [0.0, p[1], p[2]];
            points.push(match (off, unit(normal)) {
                (Some(off), Some(normal)) => {
                    known += 1;
                    let outwards = if dot(normal, from_spindle) < 0.0 {
                        -off
                    } else {
                        off
                    };
                    add_scaled(p, outwards, normal)
                }
                _ => p,
            });
        }
        let share = f64::from(known) / (self.points.len() as f64).max(1.0);
        let moved = Self {
            points,
            triangles: self.triangles.clone(),
            frame: self.frame,
        };
        (moved, share)
    }
}

/// Follows the crossed edges from triangle to triangle: curves, those with ends first.
fn curves(beside: &mut BTreeMap<(u32, u32), Vec<(u32, u32)>>) -> Vec<Vec<(u32, u32)>> {
    let ends = beside.iter().filter(|(_, next)| next.len() == 1);
    let mut starts: Vec<(u32, u32)> = ends.map(|(&edge, _)| edge).collect();
    starts.extend(beside.keys());
    let mut curves = Vec::new();
    for start in starts {
        let mut curve = vec![start];
        let mut here = start;
        while let Some(next) = beside.get_mut(&here).and_then(Vec::pop) {
            if let Some(back) = beside.get_mut(&next)
                && let Some(found) = back.iter().position(|&edge| edge == here)
            {
                back.swap_remove(found);
            }
            curve.push(next);
            here = next;
        }
        if curve.len() > 1 {
            curves.push(curve);
        }
    }
    curves
}

/// Length of the shortest tape around points of a plane: the perimeter of their convex hull, mm.
pub(super) fn tape(points: Vec<[f64; 2]>) -> f64 {
    let [under, over] = hull(points);
    [under, over].iter().map(|side| stretch(side)).sum()
}

/// Length of a line through points, mm.
pub(super) fn stretch(points: &[[f64; 2]]) -> f64 {
    let pairs = points.windows(2);
    pairs
        .map(|p| length([p[1][0] - p[0][0], p[1][1] - p[0][1], 0.0]))
        .sum()
}

/// The convex hull: the side below and the side above, both from the least first coordinate to the greatest
/// (Andrew's monotone chain).
pub(super) fn hull(mut points: Vec<[f64; 2]>) -> [Vec<[f64; 2]>; 2] {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    [1.0, -1.0].map(|side| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for &p in &points {
            while let [.., a, b] = chain[..] {
                let turn = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
                if side * turn > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain
    })
}
