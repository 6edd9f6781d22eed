//! The hierarchy over the candidates that an extent holds, and the search for the highest.
//!
//! Each node holds the lids of up to eight children, which are bound at once. The search is exact: a
//! child is skipped only if its bound lies below the best height found, and of equal heights the lowest
//! candidate wins, in whatever order they are met.

mod build;

use fearless_simd::{Simd, f32x8, prelude::*};
use rayon::prelude::*;

use crate::blocks::{Block, Bundle};
use crate::bound::{Frame, Lids, Swing, View, lid_bounds};
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes, lanes};
use crate::leaf::{Batch, Best, Leaf, Start};
use crate::record::Counters;
use crate::simd::{Set, Token, with_simd};
use crate::vector::Point;
use crate::vertices::Vertices;

/// The hierarchy.
#[derive(Debug)]
pub(crate) struct Tree<L> {
    frame: Frame,
    nodes: Vec<Node>,
    leaves: Vec<L>,
    /// What the leaves' corners are places among.
    points: Vec<Point>,
}

/// Up to eight children.
#[derive(Debug, Clone)]
struct Node {
    lids: Lids,
    /// A leaf, or a node if [`INNER`] is added.
    children: [u32; LANES],
}

/// Tells a node from a leaf.
const INNER: u32 = 1 << 31;

impl<L: Leaf> Tree<L> {
    /// Builds the hierarchy, in parallel on the current thread pool: a node over each bundle, and nodes over these.
    pub fn new(
        simd: Token,
        points: Vec<Point>,
        mut bundles: Vec<Bundle>,
        fill: impl Fn(&[Point], &Block) -> L + Sync + Send,
        vertices: impl Fn(&Block, &mut dyn FnMut(&[Point])) + Sync + Send,
    ) -> Self {
        build::arrange(&mut bundles);
        let mut firsts = vec![0];
        firsts.extend(bundles.iter().scan(0, |next, bundle| {
            *next += bundle.blocks.len();
            Some(*next)
        }));
        let blocks: Vec<Block> = bundles.into_iter().flat_map(|b| b.blocks).collect();
        let leaves = blocks.par_iter().with_min_len(build::ALONE * LANES);
        let leaves: Vec<L> = leaves.map(|block| fill(&points, block)).collect();
        let vertices = Vertices::of(&blocks, vertices);
        let frame = vertices.frame();
        Self {
            frame,
            nodes: build::nodes(simd, frame, vertices, firsts),
            leaves,
            points,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..]) + size_of_val(&self.points[..])
    }

    /// The highest of all candidates for each of up to eight positions, which go through the hierarchy
    /// together: where they are close to each other, most of the way is the same for all. `starts` tells
    /// where to look first; it does not change the result.
    pub fn search(
        &self,
        simd: Token,
        cutter: &Cutter,
        starts: &[Start],
        counters: &mut Counters,
    ) -> [Best; LANES] {
        with_simd!(simd, simd => self.search_by(simd, cutter, starts, counters))
    }

    #[inline(always)]
    fn search_by<S: Set>(
        &self,
        simd: S,
        cutter: &Cutter,
        starts: &[Start],
        counters: &mut Counters,
    ) -> [Best; LANES] {
        let mut best = [Best::above(f64::NEG_INFINITY); LANES];
        let mut active = 0;
        for (lane, start) in starts.iter().enumerate() {
            best[lane].height = start.floor;
            active |= 1 << lane;
        }
        let mut batch = Batch {
            cutter,
            starts,
            best: &mut best,
            sights: [L::Sight::default(); LANES],
            floors: true,
        };
        while active != 0 {
            self.raise(simd, &mut batch, active, counters);
            active = 0;
            for (lane, best) in batch.best.iter_mut().enumerate() {
                if best.id == Best::NOBODY && best.height > f64::NEG_INFINITY {
                    // Rounding has put the floor above everything.
                    best.height = f64::NEG_INFINITY;
                    active |= 1 << lane;
                }
            }
            batch.floors = false;
        }
        best
    }

    /// Raises the best of each active position to the highest of all candidates.
    #[inline(always)]
    fn raise<S: Set>(
        &self,
        simd: S,
        batch: &mut Batch<L::Sight>,
        active: Lanes,
        counters: &mut Counters,
    ) {
        let (cutter, starts) = (batch.cutter, batch.starts);
        let Some(first) = starts.first().filter(|_| !self.nodes.is_empty()) else {
            return;
        };
        let mut views = [View::new(&self.frame, cutter, &first.pose, first.place); LANES];
        let mut heights = [f32::INFINITY; LANES];
        for lane in lanes(active) {
            let start = &starts[lane];
            views[lane] = View::new(&self.frame, cutter, &start.pose, start.place);
            L::expect(&mut batch.sights[lane], cutter, &start.pose, start.place);
            heights[lane] = under(batch.best[lane].height);
        }
        let swing = Swing::new(cutter, starts.iter().map(|start| start.pose));
        let close = swing.is_close(&self.frame);
        let mut open = Stack::new();
        open.push([f32::INFINITY; LANES], INNER);
        // Equal heights are still looked at: a lower number may be among them.
        while let Some((child, alive)) = open.pop(simd, &heights) {
            let alive = alive & active;
            if child & INNER == 0 {
                let leaf = &self.leaves[child as usize];
                let (evaluated, raised) = leaf.search(simd, &self.points, batch, alive);
                counters.evaluations += evaluated;
                for lane in lanes(raised) {
                    let best = &batch.best[lane];
                    let [d, _, z] = starts[lane].pose.face(best.contact);
                    views[lane].expect([d, z]);
                    heights[lane] = under(best.height);
                }
                continue;
            }
            let node = &self.nodes[(child ^ INNER) as usize];
            let mut bounds = [[f32::NEG_INFINITY; LANES]; LANES];
            let mut high = 0;
            // What one position's planes lose for others is little beside a large lid's slack.
            let shared = close || node.children[0] & INNER != 0;
            let mut left = alive;
            while left != 0 {
                let (some, swing) = match shared {
                    true => (left, swing),
                    false => (left & left.wrapping_neg(), swing.alone()),
                };
                left &= !some;
                counters.nodes += 1;
                let all = lid_bounds(simd, cutter, &views, some, swing, &node.lids);
                for lane in lanes(some) {
                    high |= all[lane].simd_ge(heights[lane]).to_bitmask();
                    bounds[lane] = *all[lane];
                }
            }
            open.push_all(simd, &bounds, high, &heights, &node.children);
        }
    }
}

/// In single precision not above a height, and never below everything.
#[inline(always)]
fn under(height: f64) -> f32 {
    let low = height as f32 - height.abs() as f32 * f32::EPSILON;
    low.max(f32::MIN)
}

/// The children still to be looked at, each with its bound for every position.
struct Stack {
    open: [([f32; LANES], u32); Self::SIZE],
    len: usize,
}

impl Stack {
    /// Seven for each level of the tree, of which there are at most twelve, and one more.
    const SIZE: usize = 85;

    #[inline(always)]
    fn new() -> Self {
        Self {
            open: [([0.0; LANES], 0); Self::SIZE],
            len: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, bounds: [f32; LANES], child: u32) {
        self.open[self.len] = (bounds, child);
        self.len += 1;
    }

    /// Pushes the children in `high`, the most promising one last.
    #[inline(always)]
    fn push_all<S: Simd>(
        &mut self,
        simd: S,
        bounds: &[[f32; LANES]; LANES],
        high: Lanes,
        heights: &[f32; LANES],
        children: &[u32; LANES],
    ) {
        let heights = f32x8::from_slice(simd, heights);
        let (mut highest, mut promise) = (self.len, f32::NEG_INFINITY);
        for slot in lanes(high) {
            let mut own = [0.0; LANES];
            for lane in 0..LANES {
                own[lane] = bounds[lane][slot];
            }
            let excess = (f32x8::from_slice(simd, &own) - heights).reduce_max();
            if excess > promise {
                (highest, promise) = (self.len, excess);
            }
            self.push(own, children[slot]);
        }
        if let Some(last) = self
            .len
            .checked_sub(1)
            .filter(|_| promise > f32::NEG_INFINITY)
        {
            self.open.swap(highest, last);
        }
    }

    /// The next child, and the positions for which its bound is not below their `heights`.
    #[inline(always)]
    fn pop<S: Simd>(&mut self, simd: S, heights: &[f32; LANES]) -> Option<(u32, Lanes)> {
        let heights = f32x8::from_slice(simd, heights);
        while let Some(len) = self.len.checked_sub(1) {
            self.len = len;
            let (bounds, child) = &self.open[len];
            let alive = f32x8::from_slice(simd, bounds)
                .simd_ge(heights)
                .to_bitmask();
            if alive != 0 {
                return Some((*child, alive));
            }
        }
        None
    }
}
