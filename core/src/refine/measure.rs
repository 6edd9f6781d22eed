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

use std::sync::atomic::{AtomicU64, Ordering};

use fearless_simd::{Simd, f64x4, prelude::*};
use rayon::prelude::*;

use super::balance::Grid;
use super::near::{Closeness, look};
use crate::evaluate::{Isoline, Isolines, Net};
use crate::simd::{Token, with_simd};
use crate::slices::{Axes, FOUR, Four, four_points};
use crate::surface::Direction;
use crate::vector::{Point, add_scaled, cross, dot, length, sub};

/// Fewest and most samples to a cell's side.
const LEAST: usize = 4;
const MOST: usize = 32;

/// Rows of cells that one thread takes at a time.
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
    let within = Running::default();
    let chunks = rows.par_chunks(CHUNK).map(|rows| {
        let mut strip = Strip::new(net.simd, columns);
        let mut exceeding = Vec::new();
        for (k, &row) in rows.iter().enumerate() {
            let follows = k > 0 && rows[k - 1] + 1 == row;
            strip.place::<true>(&corners, grid, row, follows);
            strip.sample(&inside, grid, density[0], row);
            strip.bound(density);
            // The likely worst first: it spares the others a look.
            let bounds = &strip.bounds.as_flattened()[..strip.cells];
            let most = bounds.iter().fold(0.0, |a: f64, &b| a.max(b));
            let worst = bounds.iter().position(|&b| b == most).unwrap_or(0);
            let first = std::iter::once(worst);
            for j in first.chain((0..columns.len()).filter(|&j| j != worst)) {
                let column = columns[j];
                // The far edges of the surface belong to the last cells, which have no next ones.
                let last = row + 2 == grid.us.len() || column + 2 == grid.vs.len();
                let known = within.get();
                if bounds[j] <= known * known && !last {
                    continue;
                }
                let closeness = look(net, grid, density, [row, column], [known, tolerance]);
                if closeness.deviation <= tolerance {
                    within.raise(closeness.deviation);
                } else {
                    exceeding.push(Exceeding {
                        row,
                        column,
                        closeness,
                    });
                }
            }
        }
        exceeding
    });
    let exceeding: Vec<Vec<Exceeding>> = chunks.collect();
    Measured {
        within: within.get(),
        exceeding: exceeding.into_iter().flatten().collect(),
    }
}

/// The largest deviation so far, from all threads: what they spare each other does not change the largest in
/// the end.
#[derive(Default)]
struct Running(AtomicU64);

impl Running {
    fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }

    /// Numbers that are not negative are in the order of their bits.
    fn raise(&self, deviation: f64) {
        self.0.fetch_max(deviation.to_bits(), Ordering::Relaxed);
    }
}

/// How far the middles of the sides along u, of those along v, and of the cells are from the planes of
/// their facets, mm, signed: three samples that tell nearly all, for a fifth of the work. By rows and
/// columns, some rows together.
pub(super) fn probe(net: &Net, grid: &Grid) -> Vec<Vec<[f64; 3]>> {
    let columns: Vec<usize> = (0..grid.vs.len() - 1).collect();
    let rows: Vec<usize> = (0..grid.us.len() - 1).collect();
    let n = columns.len();
    let (inside, corners) = places(grid, 2, &columns);
    let (inside, corners) = (Isolines::new(net, &inside), Isolines::new(net, &corners));
    let chunks = rows.par_chunks(CHUNK).map(|rows| {
        let mut strip = Strip::new(net.simd, &columns);
        let mut found = vec![[0.0; 3]; rows.len() * n];
        for (&row, found) in rows.iter().zip(found.chunks_exact_mut(n)) {
            strip.place::<false>(&corners, grid, row, row != rows[0]);
            // By half cells along u, half cells along v, and the number that it becomes.
            strip.sample(&inside, grid, 2, row);
            for (a, b, k) in [(0, 1, 1), (1, 0, 0), (1, 1, 2)] {
                let facets = &strip.facets[usize::from(a <= b)];
                let samples = strip.samples[a].within(b * n..(b + 1) * n);
                with_simd!(net.simd, simd => facets.off(simd, found, k, samples));
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

/// The parameters in v of the samples, all first ones of the cells, then all second ones …: what is computed
/// alike lies side by side. And those of the corners of the cells: all near ones, then all far ones, or those
/// of columns that follow each other only once.
fn places(grid: &Grid, across: usize, columns: &[usize]) -> (Vec<f64>, Vec<f64>) {
    let at = |j, b| part(&grid.vs, j, b, across);
    let inside = (0..across).flat_map(|b| columns.iter().map(move |&j| at(j, b)));
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
    simd: Token,
    cells: usize,
    bounds: Vec<[f64; FOUR]>,
    /// From a cell's near corner to its far one.
    to_far: usize,
    facets: [Planes; 2],
    near: Isoline,
    far: Isoline,
    /// Of each line of samples, all first ones of the cells, then all second ones ….
    samples: Vec<Isoline>,
}

/// Numbers of a facet: the normal and the gradients of two of the barycentric coordinates, each with
/// its value at the origin, and for each corner how far a sample is from the facet for each unit
/// that the corner's coordinate is negative.
const NUMBERS: usize = 15;

/// The facets of one kind along a row of cells, four together and of these a number at a time.
struct Planes(Vec<Numbers>);

type Numbers = [[f64; FOUR]; NUMBERS];

impl Strip {
    fn new(simd: Token, columns: &[usize]) -> Self {
        let cells = columns.len();
        let fours = cells.div_ceil(FOUR);
        let planes = || Planes(vec![[[0.0; FOUR]; NUMBERS]; fours]);
        Self {
            simd,
            cells,
            bounds: vec![[0.0; FOUR]; fours],
            to_far: if beside(columns) { 1 } else { cells },
            facets: [planes(), planes()],
            near: Isoline::default(),
            far: Isoline::default(),
            samples: Vec::new(),
        }
    }

    /// Samples a row of cells along `parts` lines of each cell.
    fn sample(&mut self, inside: &Isolines, grid: &Grid, parts: usize, row: usize) {
        self.samples.resize_with(parts, Isoline::default);
        for (a, line) in self.samples.iter_mut().enumerate() {
            inside.at(part(&grid.us, row, a, parts), line);
        }
    }

    /// Bounds of the squares of the cells' deviations.
    fn bound(&mut self, [along, across]: [usize; 2]) {
        let n = self.cells;
        for (a, line) in self.samples.iter().enumerate() {
            // The first sample of all is the facets' common corner.
            for b in usize::from(a == 0)..across {
                let facets = &self.facets[usize::from(a * across <= b * along)];
                let (bounds, samples) = (&mut self.bounds[..], line.within(b * n..(b + 1) * n));
                with_simd!(self.simd, simd => facets.raise(simd, bounds, samples));
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
        self.bounds.fill([0.0; FOUR]);
        // As in `row::facets`: the diagonal runs from the first corner to the last.
        let n = self.cells;
        let (near, far) = (&self.near, &self.far);
        let [a, d] = [0, far_side].map(|from| near.within(from..from + n));
        let [b, c] = [0, far_side].map(|from| far.within(from..from + n));
        for (facets, corners) in self.facets.iter_mut().zip([[a, b, c], [a, c, d]]) {
            let bounds = &mut self.bounds[..];
            with_simd!(self.simd, simd => facets.set::<_, SIDEWAYS>(simd, bounds, corners));
        }
    }
}

impl Planes {
    /// Prepares the facets between three corners of every cell. The bounds of those without a plane are
    /// raised beyond all others.
    #[inline(always)]
    fn set<S: Simd, const SIDEWAYS: bool>(
        &mut self,
        simd: S,
        bounds: &mut [[f64; FOUR]],
        corners: [Axes; 3],
    ) {
        let one = f64x4::splat(simd, 1.0);
        let beyond = f64x4::splat(simd, f64::INFINITY);
        let mut j = 0;
        for (f, bound) in self.0.iter_mut().zip(bounds) {
            let a = four_points(simd, corners[0], j);
            let b = four_points(simd, corners[1], j);
            let c = four_points(simd, corners[2], j);
            let (ab, ac) = (sub(b, a), sub(c, a));
            let normal = cross(ab, ac);
            let square = dot(normal, normal);
            let flat = square.simd_le(0.0);
            *bound = *flat.select(beyond, f64x4::from_slice(simd, bound));
            let square = square.simd_gt(0.0).select(square, one);
            set_form(f, 0, normal, one / square.sqrt(), a);
            if SIDEWAYS {
                let scale = one / square;
                set_form(f, 4, cross(ac, normal), scale, a);
                set_form(f, 8, cross(normal, ab), scale, a);
                // Where the other two coordinates can make up for one that is negative, a sample comes to
                // the facet along either edge from that corner; the shorter one bounds its distance.
                let bc = sub(c, b);
                let (ab, ac, bc) = (dot(ab, ab), dot(ac, ac), dot(bc, bc));
                f[12] = *ab.min(bc).sqrt();
                f[13] = *ac.min(bc).sqrt();
                f[14] = *ab.min(ac).sqrt();
            }
            j += FOUR;
        }
    }

    /// The signed distances of a sample of each cell from the plane of its facet.
    #[inline(always)]
    fn off<S: Simd>(&self, simd: S, found: &mut [[f64; 3]], k: usize, samples: Axes) {
        let mut j = 0;
        for (f, found) in self.0.iter().zip(found.chunks_mut(FOUR)) {
            let off = form(simd, f, 0, four_points(simd, samples, j));
            for (found, off) in found.iter_mut().zip(*off) {
                found[k] = off;
            }
            j += FOUR;
        }
    }

    /// Raises the bounds to the squares of what a sample of each cell deviates at most.
    #[inline(always)]
    fn raise<S: Simd>(&self, simd: S, bounds: &mut [[f64; FOUR]], samples: Axes) {
        let (none, one) = (f64x4::splat(simd, 0.0), f64x4::splat(simd, 1.0));
        let without = f64x4::splat(simd, f64::INFINITY);
        let mut j = 0;
        for (f, bound) in self.0.iter().zip(bounds) {
            let p = four_points(simd, samples, j);
            let off = form(simd, f, 0, p);
            let (s, t) = (form(simd, f, 4, p), form(simd, f, 8, p));
            let r = one - s - t;
            let by_s = -s * f64x4::from_slice(simd, &f[12]);
            let by_t = -t * f64x4::from_slice(simd, &f[13]);
            let by_r = -r * f64x4::from_slice(simd, &f[14]);
            let sideways = by_s.max(by_t).max(by_r.max(none));
            // With one coordinate above 1, the other two do not make up for each other.
            let beyond = s.max(t).max(r).simd_gt(one).select(without, none);
            let out = sideways + beyond;
            *bound = *f64x4::from_slice(simd, bound).max(off * off + out * out);
            j += FOUR;
        }
    }
}

/// Sets linear functions of points that grow along `v` and vanish at `a`: four numbers from the `k`-th on.
#[inline(always)]
fn set_form<S: Simd>(f: &mut Numbers, k: usize, v: Four<S>, scale: f64x4<S>, a: Four<S>) {
    let v = [v[0] * scale, v[1] * scale, v[2] * scale];
    (f[k], f[k + 1], f[k + 2]) = (*v[0], *v[1], *v[2]);
    f[k + 3] = *-dot(v, a);
}

/// Those functions of points.
#[inline(always)]
fn form<S: Simd>(simd: S, f: &Numbers, k: usize, p: Four<S>) -> f64x4<S> {
    let along = [
        f64x4::from_slice(simd, &f[k]),
        f64x4::from_slice(simd, &f[k + 1]),
        f64x4::from_slice(simd, &f[k + 2]),
    ];
    dot(along, p) + f64x4::from_slice(simd, &f[k + 3])
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
