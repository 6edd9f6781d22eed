//! Where the lines of a grid go, so that it has the fewest points that the bends allow.
//!
//! Every cell has one budget, the tolerance, which the two directions share, and a line crosses the
//! whole surface: the wider the columns somewhere, the narrower every row that bends there. With
//! x and y the logarithms of the sizes, each cell's condition and the logarithm of the number of
//! points are convex, so that there is one best balance, and descending finds it: a column is worth
//! its lines if rows gain as much by it. The result is densities, and from them lines, which
//! are a fraction of a line too many at most between two creases. Nothing is measured here.

use super::curvature::{Bends, Slots};
use crate::simd::{Token, with_simd};

/// Steps of the descent, the first one's length, and what each leaves of it.
const STEPS: usize = 24;
const FIRST: f64 = 0.3;
const SHORTER: f64 = 0.9;

/// The sizes of neighbouring cells differ by no more than a factor of about one and this.
const GROWTH: f64 = 1.0;

/// The lines of both directions, and how many the densities asked for.
pub(super) struct Grid {
    pub us: Vec<f64>,
    pub vs: Vec<f64>,
}

/// Densities: lines to the unit of the parameter, by slot.
pub(super) struct Densities {
    u: Vec<f64>,
    v: Vec<f64>,
}

impl Densities {
    /// About how many lines they make.
    pub fn lines(&self, bends: &Bends) -> [f64; 2] {
        [total(&self.u, &bends.us), total(&self.v, &bends.vs)].map(|n| n + 1.0)
    }

    /// The same in shape, with `factor` times the lines.
    pub fn scaled(&self, factor: f64) -> Self {
        let scale = |d: &[f64]| d.iter().map(|d| d * factor).collect();
        Self {
            u: scale(&self.u),
            v: scale(&self.v),
        }
    }
}

/// The densities that make the number of points least.
pub(super) fn balance(simd: Token, bends: &Bends) -> Densities {
    let (m, n) = (bends.us.len(), bends.vs.len());
    let (floor_u, least) = floors(bends);
    let mut v: Vec<f64> = least.iter().map(|l| l * std::f64::consts::SQRT_2).collect();
    let mut step = FIRST;
    let mut best = (f64::INFINITY, v.clone());
    let mut needed = vec![0.0; n];
    let mut u = vec![0.0; m];
    let mut shares = vec![0.0; m * n];
    for _ in 0..STEPS {
        let sizes: Vec<f64> = v.iter().map(|v| 1.0 / v).collect();
        for k in 0..m {
            let shares = &mut shares[k * n..(k + 1) * n];
            let row = Row::new(simd, bends, k, &sizes);
            u[k] = row.most(floor_u[k], &mut needed);
            if u[k] > floor_u[k] {
                row.shares(u[k], &mut needed, shares);
            } else {
                shares.fill(0.0);
            }
        }
        let points = total(&u, &bends.us) * total(&v, &bends.vs);
        if points < best.0 {
            best = (points, v.clone());
        }
        let rows = total(&u, &bends.us);
        let mut gain = vec![0.0; n];
        for (k, shares) in shares.chunks_exact(n).enumerate() {
            let lines = u[k] * bends.us.width(k) / rows;
            for (gain, share) in gain.iter_mut().zip(shares) {
                *gain += lines * share;
            }
        }
        let all = total(&v, &bends.vs);
        for l in 0..n {
            let cost = v[l] * bends.vs.width(l) / all;
            let better = 1.0 + step * (gain[l] - cost) / (gain[l] + cost);
            v[l] = (v[l] * better).max(least[l]);
        }
        step *= SHORTER;
    }
    settle(simd, bends, &best.1, &floor_u, &least)
}

/// What a direction needs whatever the other does: one cell to the whole of it, lines for the edges
/// and creases; for v, also what would take infinitely many lines of u.
fn floors(bends: &Bends) -> (Vec<f64>, Vec<f64>) {
    let range = |slots: &Slots| 1.0 / (slots.edges[slots.len()] - slots.edges[0]);
    let floor_u: Vec<f64> = bends
        .edges_u
        .iter()
        .map(|e| e.max(range(&bends.us)))
        .collect();
    let n = bends.vs.len();
    let mut least = bends.edges_v.clone();
    for row in bends.v.chunks_exact(n) {
        for (least, v) in least.iter_mut().zip(row) {
            *least = least.max(v.sqrt() * 1.001);
        }
    }
    least.iter_mut().for_each(|l| *l = l.max(range(&bends.vs)));
    (floor_u, least)
}

/// The densities for the bends that the cells of a grid were found to have, lines between them.
pub(super) fn adjust(simd: Token, bends: &Bends) -> Densities {
    let (floor_u, least) = floors(bends);
    let n = bends.vs.len();
    // A cell that is too large is made smaller in the direction in which it bends more.
    let now = least.iter().enumerate();
    let mut v: Vec<f64> = now
        .map(|(l, least)| least.max(1.0 / bends.vs.width(l)))
        .collect();
    let sizes: Vec<f64> = v.iter().map(|v| 1.0 / v).collect();
    for k in 0..bends.us.len() {
        let x = bends.us.width(k);
        for l in 0..n {
            let i = k * n + l;
            let (own, other) = (bends.v[i], bends.u[i]);
            if own * sizes[l] * sizes[l] > other * x * x {
                let needed = density_needed(own, other, bends.twist[i], bends.both[i], x);
                let most = 2.0 / sizes[l];
                let sound = needed > 0.0 && needed < most;
                v[l] = v[l].max(if sound { needed } else { most });
            }
        }
    }
    settle(simd, bends, &v, &floor_u, &least)
}

/// The densities of u that go with those of v, and of v the least that go with these.
fn settle(simd: Token, bends: &Bends, v: &[f64], floor_u: &[f64], least: &[f64]) -> Densities {
    let n = bends.vs.len();
    let sizes: Vec<f64> = v.iter().map(|v| 1.0 / v).collect();
    let mut needed = vec![0.0; n];
    let mut u: Vec<f64> = (0..bends.us.len())
        .map(|k| Row::new(simd, bends, k, &sizes).most(floor_u[k], &mut needed))
        .collect();
    grade(&mut u, &bends.us);
    let mut v = least.to_vec();
    let mut same = vec![0.0; n];
    // As for u, with the directions exchanged; a row of u at a time, since v lies together.
    for (k, &density) in u.iter().enumerate() {
        // A hair smaller: where only u bends it takes the whole budget, and nothing is left to divide by.
        same.fill(0.999 / density);
        let row = Row::new(simd, bends, k, &same);
        let exchanged = Row {
            own: row.other,
            other: row.own,
            ..row
        };
        with_simd!(simd, _simd => exchanged.all(&mut needed));
        for (v, needed) in v.iter_mut().zip(&needed) {
            *v = v.max(*needed);
        }
    }
    grade(&mut v, &bends.vs);
    Densities { u, v }
}

fn total(densities: &[f64], slots: &Slots) -> f64 {
    let parts = densities
        .iter()
        .enumerate()
        .map(|(i, d)| d * slots.width(i));
    parts.sum()
}

/// Lines to the unit that one direction needs where the other has cells of size `y`. Infinite, or
/// less than nothing, where no number of lines is enough.
#[inline(always)]
fn density_needed(own: f64, other: f64, twist: f64, both: f64, y: f64) -> f64 {
    let left = 1.0 - other * y * y;
    let shared = 1.0 - both * other * y * y;
    let cy = twist * y;
    let added = (cy + (cy * cy + own * shared).sqrt()) / shared;
    let split = 2.0 * cy / left;
    if added > split { added } else { split }
}

/// The bends of one row of slots, those along u its own, and the sizes along v.
struct Row<'a> {
    simd: Token,
    own: &'a [f64],
    other: &'a [f64],
    twist: &'a [f64],
    both: &'a [f64],
    sizes: &'a [f64],
}

impl<'a> Row<'a> {
    fn new(simd: Token, bends: &'a Bends, k: usize, sizes: &'a [f64]) -> Self {
        let n = sizes.len();
        let [own, other, twist, both] =
            [&bends.u, &bends.v, &bends.twist, &bends.both].map(|b| &b[k * n..][..n]);
        Self {
            simd,
            own,
            other,
            twist,
            both,
            sizes,
        }
    }

    /// The density of u that all slots need, at least `floor`; what each needs is left in `needed`.
    fn most(&self, floor: f64, needed: &mut [f64]) -> f64 {
        with_simd!(self.simd, _simd => self.all(needed));
        needed.iter().fold(floor, |a, &b| a.max(b))
    }

    /// The share of each slot in what is needed at most: by how much the one falls as the other's v grows,
    /// spread over all that are nearly the worst. In place of what they need.
    fn shares(&self, most: f64, needed: &mut [f64], shares: &mut [f64]) {
        with_simd!(self.simd, _simd => self.weighed(most, needed, shares));
        let all: f64 = needed.iter().sum();
        shares.iter_mut().for_each(|s| *s /= all);
    }

    #[inline(always)]
    fn all(&self, needed: &mut [f64]) {
        let (n, row) = (needed.len(), self);
        let (own, other, sizes) = (&row.own[..n], &row.other[..n], &row.sizes[..n]);
        let (twist, both) = (&row.twist[..n], &row.both[..n]);
        for l in 0..n {
            needed[l] = density_needed(own[l], other[l], twist[l], both[l], sizes[l]);
        }
    }

    /// What each needs becomes how near that is to the most, and the shares are weighed by it.
    #[inline(always)]
    fn weighed(&self, most: f64, needed: &mut [f64], shares: &mut [f64]) {
        let (n, row) = (needed.len(), self);
        let (own, other, sizes) = (&row.own[..n], &row.other[..n], &row.sizes[..n]);
        let (twist, both) = (&row.twist[..n], &row.both[..n]);
        let shares = &mut shares[..n];
        for l in 0..n {
            let near = needed[l] / most;
            let near = near * near;
            let near = near * near;
            let near = near * near;
            let near = near * near;
            let (x, y) = (1.0 / most, sizes[l]);
            let cxy = twist[l] * x * y;
            let by_v = both[l] * other[l] * y * y + cxy;
            let by_u = own[l] * x * x + cxy;
            shares[l] = near * by_v / (by_u + 0.05 * by_v + 1e-30);
            needed[l] = near;
        }
    }
}

/// Raises densities beside high ones, so that a cell does not reach far into a place it is too
/// large for.
fn grade(densities: &mut [f64], slots: &Slots) {
    let n = densities.len();
    let mut pass = |i: usize, from: usize| {
        let between = (slots.width(i) + slots.width(from)) / 2.0;
        let most = 1.0 / densities[from] + GROWTH * between;
        densities[i] = densities[i].max(1.0 / most);
    };
    (1..n).for_each(|i| pass(i, i - 1));
    (1..n).rev().for_each(|i| pass(i - 1, i));
}

/// The lines that densities make: every crease, and between two of them the least whole number,
/// spread as the densities are.
pub(super) fn grid(densities: &Densities, bends: &Bends, creases: [&[f64]; 2]) -> Grid {
    Grid {
        us: lines(&densities.u, &bends.us, creases[0]),
        vs: lines(&densities.v, &bends.vs, creases[1]),
    }
}

fn lines(densities: &[f64], slots: &Slots, creases: &[f64]) -> Vec<f64> {
    let mut lines = vec![creases[0]];
    for ends in creases.windows(2) {
        // The slots within, cut off at the ends, and how many lines there are up to each.
        let clipped = |i: usize| (slots.edges[i].max(ends[0]), slots.edges[i + 1].min(ends[1]));
        let first = slots.edges.partition_point(|&e| e <= ends[0]).max(1) - 1;
        let within = (first..slots.len()).take_while(|&i| slots.edges[i] < ends[1]);
        let within: Vec<usize> = within.collect();
        let share = |i: usize| (clipped(i).1 - clipped(i).0) * densities[i];
        let all: f64 = within.iter().map(|&i| share(i)).sum();
        // A hair more than a whole number is that number: the sum is rounded.
        let cells = (all - 1e-6).ceil().max(1.0);
        let mut before = 0.0;
        let mut next = 1.0;
        for &i in &within {
            let (low, high) = clipped(i);
            let after = before + share(i);
            while next < cells && after * cells >= next * all {
                let part = (next * all / cells - before) / (after - before);
                let at = low + (high - low) * part;
                if at > lines[lines.len() - 1] && at < ends[1] {
                    lines.push(at);
                }
                next += 1.0;
            }
            before = after;
        }
        lines.push(ends[1]);
    }
    lines
}
