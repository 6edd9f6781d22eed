//! How far a surface lies from the facets of its grid, at samples denser than the grid.
//!
//! The deviation of a sample is its distance to the plane of the facet that its parameters fall
//! into, if it lies over that facet; else to the nearest facet of its cell and the eight around,
//! for along a curved line a surface sags sideways, over the facet next door. All samples are held
//! against bounds of that, some ten operations each in loops over arrays; only cells that could
//! raise the maximum, or exceed the tolerance, are looked at closely, so the maximum is exact.
//!
//! Samples show what lies between them only as far as the surface is smooth at their distance: a
//! peak halfway between two of the four of a side is a sixteenth higher at most than what they show.
//! There are at least four to a cell's side and, up to [`MOST`] of them, two to a polynomial piece.

use std::ops::Range;

use rayon::prelude::*;

use super::balance::Grid;
use super::near::{Closeness, look};
use crate::evaluate::{Coordinates, Isoline, Isolines, Net};
use crate::surface::Direction;
use crate::vector::{Point, add_scaled, cross, dot, length, sub};

/// Fewest and most samples to a cell's side.
const LEAST: usize = 4;
const MOST: usize = 32;

/// Rows of cells that share a running maximum, whatever the number of threads.
const CHUNK: usize = 16;

/// A cell that exceeds the tolerance.
pub(super) struct Exceeding {
    pub row: usize,
    pub column: usize,
    pub closeness: Closeness,
}

/// What was measured over some cells.
#[derive(Default)]
pub(super) struct Measured {
    /// Largest deviation within the tolerance, mm.
    pub within: f64,
    /// The cells beyond it.
    pub exceeding: Vec<Exceeding>,
}

impl Measured {
    /// Largest deviation, mm.
    pub fn worst(&self) -> f64 {
        let beyond = self.exceeding.iter().map(|e| e.closeness.deviation);
        beyond.fold(self.within, f64::max)
    }
}

/// Samples to a cell's side along a direction.
pub(super) fn density(direction: &Direction, lines: &[f64]) -> usize {
    let breaks = direction.breaks();
    let up_to = |t: f64| breaks.partition_point(|&b| b < t);
    let after = |t: f64| breaks.partition_point(|&b| b <= t);
    let pieces = lines.windows(2).map(|w| up_to(w[1]) - after(w[0]) + 1);
    (2 * pieces.max().unwrap_or(1)).clamp(LEAST, MOST)
}

/// Measures the cells of some rows and columns, each by the number of its first line.
pub(super) fn measure(
    net: &Net,
    grid: &Grid,
    density: [usize; 2],
    tolerance: f64,
    rows: &[usize],
    columns: &[usize],
) -> Measured {
    if columns.is_empty() {
        return Measured::default();
    }
    let (inside, corners) = places(grid, density[1], columns);
    let (inside, corners) = (Isolines::new(net, &inside), Isolines::new(net, &corners));
    let chunks = rows.par_chunks(CHUNK).map(|rows| {
        let mut strip = Strip::new(columns);
        let mut measured = Measured::default();
        for (k, &row) in rows.iter().enumerate() {
            let follows = k > 0 && rows[k - 1] + 1 == row;
            strip.place::<true>(&corners, grid, row, follows);
            strip.bound(&inside, grid, density, row);
            // The likely worst first: it spares the others a look.
            let most = strip.bounds.iter().fold(0.0, |a: f64, &b| greater(b, a));
            let worst = strip.bounds.iter().position(|&b| b == most).unwrap_or(0);
            let first = std::iter::once(worst);
            for j in first.chain((0..columns.len()).filter(|&j| j != worst)) {
                let column = columns[j];
                // The far edges of the surface belong to the last cells, which have no next ones.
                let last = row + 2 == grid.us.len() || column + 2 == grid.vs.len();
                if strip.bounds[j] <= measured.within * measured.within && !last {
                    continue;
                }
                let closeness = look(
                    net,
                    grid,
                    density,
                    [row, column],
                    [measured.within, tolerance],
                );
                if closeness.deviation <= tolerance {
                    measured.within = measured.within.max(closeness.deviation);
                } else {
                    measured.exceeding.push(Exceeding {
                        row,
                        column,
                        closeness,
                    });
                }
            }
        }
        measured
    });
    let chunks: Vec<Measured> = chunks.collect();
    let mut all = Measured::default();
    for chunk in chunks {
        all.within = all.within.max(chunk.within);
        all.exceeding.extend(chunk.exceeding);
    }
    all
}

/// How far the middles of the sides along u, of those along v, and of the cells are from the planes of
/// their facets, mm, signed: three samples that tell nearly all, for a fifth of the work. By rows and
/// columns.
pub(super) fn probe(net: &Net, grid: &Grid) -> Vec<[f64; 3]> {
    let columns: Vec<usize> = (0..grid.vs.len() - 1).collect();
    let rows: Vec<usize> = (0..grid.us.len() - 1).collect();
    let n = columns.len();
    let (inside, corners) = places(grid, 2, &columns);
    let (inside, corners) = (Isolines::new(net, &inside), Isolines::new(net, &corners));
    let chunks = rows.par_chunks(CHUNK).flat_map_iter(|rows| {
        let mut strip = Strip::new(&columns);
        let mut found = vec![[0.0; 3]; rows.len() * n];
        for (&row, found) in rows.iter().zip(found.chunks_exact_mut(n)) {
            strip.place::<false>(&corners, grid, row, row != rows[0]);
            // By half cells along u, half cells along v, and the number that it becomes.
            for (a, b, k) in [(0, 1, 1), (1, 0, 0), (1, 1, 2)] {
                if b != 1 || k != 2 {
                    inside.at(part(&grid.us, row, a, 2), &mut strip.samples);
                    strip.dealt.deal(&strip.samples.points, 2);
                }
                let facets = &strip.facets[usize::from(a <= b)];
                facets.off(found, k, &strip.dealt, b * n..(b + 1) * n);
            }
        }
        found
    });
    chunks.collect()
}

/// Whether the columns follow each other, so that the far corners of one are the near ones of the next.
fn beside(columns: &[usize]) -> bool {
    columns.windows(2).all(|w| w[0] + 1 == w[1])
}

/// The parameters in v of the samples, and of the corners of the cells: all near ones, then all
/// far ones, or those of columns that follow each other only once.
fn places(grid: &Grid, across: usize, columns: &[usize]) -> (Vec<f64>, Vec<f64>) {
    let at = |j, b| part(&grid.vs, j, b, across);
    let inside = columns
        .iter()
        .flat_map(|&j| (0..across).map(move |b| at(j, b)));
    let corners = if beside(columns) {
        grid.vs[columns[0]..columns[0] + columns.len() + 1].to_vec()
    } else {
        let near = columns.iter().map(|&j| grid.vs[j]);
        near.chain(columns.iter().map(|&j| grid.vs[j + 1]))
            .collect()
    };
    (inside.collect(), corners)
}

/// The parameter at `part / parts` of cell `i`.
pub(super) fn part(lines: &[f64], i: usize, part: usize, parts: usize) -> f64 {
    if part == parts {
        return lines[i + 1];
    }
    lines[i] + (lines[i + 1] - lines[i]) * (part as f64 / parts as f64)
}

/// One row of cells, and room for its samples.
struct Strip {
    bounds: Vec<f64>,
    /// From a cell's near corner to its far one.
    to_far: usize,
    facets: [Planes; 2],
    near: Isoline,
    far: Isoline,
    samples: Isoline,
    /// The same, all first ones of the cells, then all second ones …: what is computed alike lies side
    /// by side.
    dealt: Coordinates,
}

/// Numbers of a facet: the normal and the gradients of two of the barycentric coordinates, each with
/// its value at the origin, and for each corner how far a sample is from the facet for each unit
/// that the corner's coordinate is negative.
const NUMBERS: usize = 15;

/// The facets of one kind along a row of cells, a number at a time.
struct Planes([Vec<f64>; NUMBERS]);

impl Strip {
    fn new(columns: &[usize]) -> Self {
        let cells = columns.len();
        let planes = || Planes(std::array::from_fn(|_| vec![0.0; cells]));
        Self {
            bounds: vec![0.0; cells],
            to_far: if beside(columns) { 1 } else { cells },
            facets: [planes(), planes()],
            near: Isoline::default(),
            far: Isoline::default(),
            samples: Isoline::default(),
            dealt: Coordinates::default(),
        }
    }

    /// Bounds of the squares of the cells' deviations.
    fn bound(&mut self, inside: &Isolines, grid: &Grid, density: [usize; 2], row: usize) {
        let n = self.bounds.len();
        let [along, across] = density;
        for a in 0..along {
            inside.at(part(&grid.us, row, a, along), &mut self.samples);
            self.dealt.deal(&self.samples.points, across);
            // The first sample of all is the facets' common corner.
            for b in usize::from(a == 0)..across {
                let side = usize::from(a * across <= b * along);
                self.facets[side].raise(&mut self.bounds, &self.dealt, b * n..(b + 1) * n);
            }
        }
    }

    /// Prepares the facets of a row, `SIDEWAYS` as well or only their planes.
    fn place<const SIDEWAYS: bool>(
        &mut self,
        corners: &Isolines,
        grid: &Grid,
        row: usize,
        follows: bool,
    ) {
        if follows {
            std::mem::swap(&mut self.near, &mut self.far);
        } else {
            corners.at(grid.us[row], &mut self.near);
        }
        corners.at(grid.us[row + 1], &mut self.far);
        let far_side = self.to_far;
        self.bounds.fill(0.0);
        // As in `row::facets`: the diagonal runs from the first corner to the last.
        let (near, far) = (&self.near.points, &self.far.points);
        let corners = [(near, 0), (far, 0), (far, far_side)];
        self.facets[0].set::<SIDEWAYS>(&mut self.bounds, corners);
        let corners = [(near, 0), (far, far_side), (near, far_side)];
        self.facets[1].set::<SIDEWAYS>(&mut self.bounds, corners);
    }
}

impl Planes {
    /// Prepares the facets between three corners of every cell, each given by where the first cell's
    /// lies among some points. The bounds of those without a plane are raised beyond all others.
    fn set<const SIDEWAYS: bool>(
        &mut self,
        bounds: &mut [f64],
        corners: [(&Coordinates, usize); 3],
    ) {
        let n = bounds.len();
        let f = self.0.each_mut().map(|numbers| &mut numbers[..n]);
        let [a, b, c] = corners.map(|(points, from)| {
            let to = from + n;
            [
                &points.x[from..to],
                &points.y[from..to],
                &points.z[from..to],
            ]
            .map(|c| &c[..n])
        });
        for j in 0..n {
            let (a, b, c) = (
                [a[0][j], a[1][j], a[2][j]],
                [b[0][j], b[1][j], b[2][j]],
                [c[0][j], c[1][j], c[2][j]],
            );
            let (ab, ac) = (sub(b, a), sub(c, a));
            let normal = cross(ab, ac);
            let square = dot(normal, normal);
            if square <= 0.0 {
                bounds[j] = f64::INFINITY;
            }
            let square = if square > 0.0 { square } else { 1.0 };
            let mut form = |k: usize, v: Point, scale: f64| {
                let v = [v[0] * scale, v[1] * scale, v[2] * scale];
                (f[k][j], f[k + 1][j], f[k + 2][j]) = (v[0], v[1], v[2]);
                f[k + 3][j] = -dot(v, a);
            };
            form(0, normal, 1.0 / square.sqrt());
            if !SIDEWAYS {
                continue;
            }
            let scale = 1.0 / square;
            form(4, cross(ac, normal), scale);
            form(8, cross(normal, ab), scale);
            // Where the other two coordinates can make up for one that is negative, a sample comes to
            // the facet along either edge from that corner; the shorter one bounds its distance.
            let bc = sub(c, b);
            let (ab, ac, bc) = (dot(ab, ab), dot(ac, ac), dot(bc, bc));
            let less = |a: f64, b: f64| if a < b { a } else { b };
            f[12][j] = less(ab, bc).sqrt();
            f[13][j] = less(ac, bc).sqrt();
            f[14][j] = less(ab, ac).sqrt();
        }
    }

    /// The signed distances of a sample of each cell from the plane of its facet.
    fn off(&self, found: &mut [[f64; 3]], k: usize, samples: &Coordinates, within: Range<usize>) {
        let n = found.len();
        let [a, b, c, d]: [&[f64]; 4] = std::array::from_fn(|k| &self.0[k][..n]);
        let [x, y, z] =
            [&samples.x, &samples.y, &samples.z].map(|c| &c[within.start..within.end][..n]);
        for (j, found) in found.iter_mut().enumerate() {
            found[k] = a[j] * x[j] + b[j] * y[j] + c[j] * z[j] + d[j];
        }
    }

    /// Raises the bounds to the squares of what a sample of each cell deviates at most.
    fn raise(&self, bounds: &mut [f64], samples: &Coordinates, within: Range<usize>) {
        let n = bounds.len();
        let f: [&[f64]; NUMBERS] = std::array::from_fn(|k| &self.0[k][..n]);
        let (x, y, z) = (
            &samples.x[within.clone()][..n],
            &samples.y[within.clone()][..n],
            &samples.z[within][..n],
        );
        for j in 0..n {
            let along =
                |k: usize| f[k][j] * x[j] + f[k + 1][j] * y[j] + f[k + 2][j] * z[j] + f[k + 3][j];
            let (off, s, t) = (along(0), along(4), along(8));
            let r = 1.0 - s - t;
            let sideways = greater(
                greater(-s * f[12][j], -t * f[13][j]),
                greater(-r * f[14][j], 0.0),
            );
            // With one coordinate above 1, the other two do not make up for each other.
            let beyond = if greater(greater(s, t), r) > 1.0 {
                f64::INFINITY
            } else {
                0.0
            };
            let out = sideways + beyond;
            bounds[j] = greater(bounds[j], off * off + out * out);
        }
    }
}

/// The greater of two numbers, in one instruction: neither is NaN.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Distance from `p` to the triangle, and whether it lies over it.
pub(super) fn to_triangle(p: Point, [a, b, c]: [Point; 3]) -> (f64, bool) {
    if let Some(distance) = over_triangle(p, [a, b, c]) {
        return (distance, true);
    }
    let edges = [to_chord(p, a, b), to_chord(p, b, c), to_chord(p, c, a)];
    (edges[0].min(edges[1]).min(edges[2]), false)
}

/// Distance from `p` to the plane of the triangle, if it lies over it.
#[inline(always)]
pub(super) fn over_triangle(p: Point, [a, b, c]: [Point; 3]) -> Option<f64> {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let n = cross(ab, ac);
    let square = dot(n, n);
    let (s, t) = (dot(cross(ap, ac), n), dot(cross(ab, ap), n));
    let over = square > 0.0 && s >= 0.0 && t >= 0.0 && s + t <= square;
    over.then(|| dot(ap, n).abs() / square.sqrt())
}

/// Distance from `p` to the segment from `a` to `b`.
pub(super) fn to_chord(p: Point, a: Point, b: Point) -> f64 {
    let (ap, ab) = (sub(p, a), sub(b, a));
    let square = dot(ab, ab);
    let t = if square > 0.0 {
        (dot(ap, ab) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    length(add_scaled(ap, -t, ab))
}
