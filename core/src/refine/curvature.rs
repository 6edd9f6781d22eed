//! What a surface's curvature asks of a grid: how far a cell of a given size will deviate.
//!
//! Over a triangle, a surface deviates from its facet by at most (hu² |Suu| + 2 hu hv |Suv| +
//! hv² |Svv|) / 8 (Filip, Magedson and Markot, "Surface algorithms using bounds on derivatives",
//! 1986), and to second order only the components along the normal count. Their signs are known
//! here, which the bound does without: where the surface bends both ways, the two directions do
//! not add up. Bends are sampled in every polynomial piece. An estimate to lay lines out by, not a
//! proof: what holds is for `measure` to say.

use std::ops::Range;

use rayon::prelude::*;

use crate::jet::{Derivatives, Jet, collapse_jet, derivatives};
use crate::surface::{Direction, Surface};
use crate::vector::{Point, add_scaled, cross, dot, length};

/// Slots of a direction that has few pieces.
const FEW: usize = 24;

/// Most slots of a direction.
const MANY: usize = 512;

/// A direction cut into slots, each with samples of its own.
pub(super) struct Slots {
    /// Their ends, one more than there are slots.
    pub edges: Vec<f64>,
    /// Parameters, and the slot of each; none is a knot.
    samples: Vec<(f64, usize)>,
}

impl Slots {
    fn new(direction: &Direction) -> Self {
        let breaks = direction.breaks();
        let pieces = breaks.len() - 1;
        let each = (direction.degree - 1).max(2).max(FEW.div_ceil(pieces));
        let group = (pieces * each).div_ceil(MANY);
        let mut edges = Vec::new();
        let mut samples = Vec::new();
        for piece in breaks.windows(2) {
            let at = |part: f64| piece[0] + (piece[1] - piece[0]) * (part / each as f64);
            for i in 0..each {
                if samples.len() % group == 0 {
                    edges.push(at(i as f64));
                }
                samples.push((at(i as f64 + 0.5), edges.len() - 1));
            }
        }
        edges.push(breaks[pieces]);
        Self { edges, samples }
    }

    /// The intervals between lines.
    fn between(lines: &[f64]) -> Self {
        Self {
            edges: lines.to_vec(),
            samples: Vec::new(),
        }
    }

    pub fn len(&self) -> usize {
        self.edges.len() - 1
    }

    /// The slots that each interval between lines lies in.
    fn under(&self, lines: &[f64]) -> Vec<Range<usize>> {
        let inner = &self.edges[1..self.len()];
        let under = |w: &[f64]| {
            let first = inner.partition_point(|&e| e <= w[0]);
            first..inner.partition_point(|&e| e < w[1]) + 1
        };
        lines.windows(2).map(under).collect()
    }

    pub fn width(&self, i: usize) -> f64 {
        self.edges[i + 1] - self.edges[i]
    }
}

/// The bends of a surface over all pairs of slots, v running fastest, in units of the tolerance: a
/// cell of size x × y is good where `max(u x², both (u x² + v y²), v y²) + 2 twist x y ≤ 1`, with
/// `both` 1 or 0.
pub(super) struct Bends {
    pub us: Slots,
    pub vs: Slots,
    pub u: Vec<f64>,
    pub v: Vec<f64>,
    pub twist: Vec<f64>,
    pub both: Vec<f64>,
    /// Lines to the unit of the parameter that the surface's edges and creases need as curves.
    pub edges_u: Vec<f64>,
    pub edges_v: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Bend {
    u: f64,
    v: f64,
    twist: f64,
    both: f64,
}

impl Bend {
    const NONE: Self = Self {
        u: 0.0,
        v: 0.0,
        twist: 0.0,
        both: 0.0,
    };

    /// From bends along the normal.
    fn new(u: f64, v: f64, twist: f64) -> Self {
        let both = u * v >= 0.0;
        // The facets share the diagonal on which both parameters grow. A twist towards the bend adds
        // to it there; one away from it takes from it, and the rest of the cell is no worse.
        let towards = if u + v >= 0.0 { twist } else { -twist };
        Self {
            u: u.abs(),
            v: v.abs(),
            twist: if both && u + v != 0.0 {
                towards.max(0.0)
            } else {
                twist.abs()
            },
            both: f64::from(both),
        }
    }

    /// The larger of the two in everything.
    fn hull(self, other: Self) -> Self {
        Self {
            u: self.u.max(other.u),
            v: self.v.max(other.v),
            twist: self.twist.max(other.twist),
            both: self.both.max(other.both),
        }
    }
}

impl Bends {
    /// None yet, over so many pairs of slots.
    fn new([us, vs]: [Slots; 2], pairs: usize) -> Self {
        Self {
            edges_u: vec![0.0; us.len()],
            edges_v: vec![0.0; vs.len()],
            us,
            vs,
            u: vec![0.0; pairs],
            v: vec![0.0; pairs],
            twist: vec![0.0; pairs],
            both: vec![0.0; pairs],
        }
    }

    fn set(&mut self, i: usize, bend: Bend) {
        self.u[i] = bend.u;
        self.v[i] = bend.v;
        self.twist[i] = bend.twist;
        self.both[i] = bend.both;
    }
}

/// The bends that a grid's cells were found to have: how far the middles of their sides along u,
/// along v, and of the cells are off the facets, by rows and columns, some rows together; these in units of
/// what is good for a cell.
pub(super) fn bends_found(
    before: &Bends,
    [us, vs]: [&[f64]; 2],
    found: &[Vec<[f64; 3]>],
    good: f64,
) -> Bends {
    let n = vs.len() - 1;
    let pairs = (us.len() - 1) * n;
    let mut all = Bends::new([Slots::between(us), Slots::between(vs)], pairs);
    let rows = found.iter().flat_map(|rows| rows.chunks_exact(n));
    for (k, row) in rows.enumerate() {
        let x = all.us.width(k);
        for (l, off) in row.iter().enumerate() {
            let [u, v, middle] = off.map(|d| d / good);
            let y = all.vs.width(l);
            // What is off in the middle of the diagonal is the sum of both and of the twist.
            let bend = Bend::new(u / (x * x), v / (y * y), (middle - u - v) / (2.0 * x * y));
            all.set(k * n + l, bend);
        }
    }
    let edges = |slots: &Slots, edges: &[f64], lines: &[f64]| {
        let most = |slots: Range<usize>| edges[slots].iter().fold(0.0, |a: f64, &b| a.max(b));
        slots.under(lines).into_iter().map(most).collect()
    };
    all.edges_u = edges(&before.us, &before.edges_u, us);
    all.edges_v = edges(&before.vs, &before.edges_v, vs);
    all
}

/// Samples the bends of a surface.
pub(super) fn bends(surface: &Surface, tolerance: f64) -> Bends {
    let (us, vs) = (Slots::new(surface.u()), Slots::new(surface.v()));
    let scale = 1.0 / (8.0 * tolerance);
    let rational = surface.weights().is_some();
    let jets = |d: &Direction, ts: &[f64]| ts.iter().map(|&t| Jet::new(d, t)).collect::<Vec<_>>();
    let places: Vec<f64> = vs.samples.iter().map(|s| s.0).collect();
    let inside = jets(surface.v(), &places);
    let across = jets(surface.v(), &surface.v().creases());
    let sample = |&(u, slot): &(f64, usize)| {
        let curves = collapse_jet(surface, &Jet::new(surface.u(), u));
        let mut row = vec![Bend::NONE; vs.len()];
        for (jet, &(_, slot)) in inside.iter().zip(&vs.samples) {
            let bend = bend(&derivatives(&curves, jet, rational), scale);
            row[slot] = row[slot].hull(bend);
        }
        let edge = across.iter().map(|jet| {
            let d = derivatives(&curves, jet, rational);
            (beside(d.uu, d.u) * scale).sqrt()
        });
        (slot, row, edge.fold(0.0, f64::max))
    };
    let rows: Vec<_> = us.samples.par_iter().map(sample).collect();

    let cells = us.len() * vs.len();
    let mut all = vec![Bend::NONE; cells];
    let mut edges_u = vec![0.0_f64; us.len()];
    for (slot, row, edge) in rows {
        edges_u[slot] = edges_u[slot].max(edge);
        let sums = &mut all[slot * vs.len()..(slot + 1) * vs.len()];
        for (sum, bend) in sums.iter_mut().zip(row) {
            *sum = sum.hull(bend);
        }
    }
    let mut edges_v = vec![0.0_f64; vs.len()];
    for jet in jets(surface.u(), &surface.u().creases()) {
        let curves = collapse_jet(surface, &jet);
        for (jet, &(_, slot)) in inside.iter().zip(&vs.samples) {
            let d = derivatives(&curves, jet, rational);
            edges_v[slot] = edges_v[slot].max((beside(d.vv, d.v) * scale).sqrt());
        }
    }
    let mut bends = Bends::new([us, vs], cells);
    for (i, bend) in all.into_iter().enumerate() {
        bends.set(i, bend);
    }
    (bends.edges_u, bends.edges_v) = (edges_u, edges_v);
    bends
}

/// The bends along the normal; where there is none, in any direction.
fn bend(d: &Derivatives, scale: f64) -> Bend {
    let normal = cross(d.u, d.v);
    let area = length(normal);
    // Below this the direction of the normal is rounding.
    if area <= 1e-9 * length(d.u) * length(d.v) {
        return Bend {
            u: beside(d.uu, d.u) * scale,
            v: beside(d.vv, d.v) * scale,
            twist: length(d.uv) * scale,
            both: 1.0,
        };
    }
    let along = |p: Point| dot(p, normal) / area * scale;
    let (u, v, twist) = (along(d.uu), along(d.vv), along(d.uv));
    Bend::new(u, v, twist)
}

/// How fast a curve with these derivatives leaves its tangent.
fn beside(second: Point, first: Point) -> f64 {
    let square = dot(first, first);
    if square > 0.0 {
        length(add_scaled(second, -dot(second, first) / square, first))
    } else {
        length(second)
    }
}
