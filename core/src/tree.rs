//! The hierarchy over the candidates that an extent holds, and the search for the highest.
//!
//! Each node holds the lids of up to eight children, which are bound at once. The search is exact: a
//! child is skipped only if its bound lies below the best height found, and of equal heights the lowest
//! candidate wins, in whatever order they are met.

use std::ops::Range;

use fearless_simd::{Simd, f32x8, prelude::*};
use rayon::prelude::*;

use crate::blocks::{Block, longest_side};
use crate::bound::{Frame, Lids, View, lid_bounds};
use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::LANES;
use crate::leaf::{Best, Leaf};
use crate::record::Counters;
use crate::vector::{Interval, Point};

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

/// Leaves below which a subtree is built by one thread.
const ALONE: usize = 256;

impl<L: Leaf> Tree<L> {
    /// Builds the hierarchy, in parallel on the current thread pool.
    pub fn new(
        points: Vec<Point>,
        mut blocks: Vec<Block>,
        fill: impl Fn(&[Point], &Block) -> L + Sync + Send,
    ) -> Self {
        arrange(&mut blocks);
        let filled = blocks.par_iter().with_min_len(ALONE).map(|block| {
            let leaf = fill(&points, block);
            let vertices = leaf.vertices(&points);
            (leaf, vertices)
        });
        let (leaves, vertices): (Vec<L>, Vec<Vec<Point>>) = filled.unzip();
        let outline = Outline::new(&vertices);
        let frame = outline.frame();
        let empty = Node {
            lids: Lids::EMPTY,
            children: [0; LANES],
        };
        let mut nodes = vec![empty; nodes(leaves.len())];
        if !leaves.is_empty() {
            build(&frame, &outline, 0..leaves.len(), &mut nodes, 0);
        }
        Self {
            frame,
            nodes,
            leaves,
            points,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..]) + size_of_val(&self.points[..])
    }

    /// The highest of all candidates. `start` tells where to look first; it does not change the result.
    #[inline(always)]
    pub fn search<S: Simd>(
        &self,
        simd: S,
        cutter: &Cutter,
        pose: &Pose,
        start: &Start,
        counters: &mut Counters,
    ) -> Best {
        let mut best = Best::above(start.floor);
        loop {
            self.raise(simd, cutter, pose, start.place, &mut best, counters);
            if best.id != Best::NOBODY || best.height == f64::NEG_INFINITY {
                break;
            }
            // Rounding has put the floor above everything.
            best.height = f64::NEG_INFINITY;
        }
        best
    }

    /// Raises `best` to the highest of all candidates.
    #[inline(always)]
    fn raise<S: Simd>(
        &self,
        simd: S,
        cutter: &Cutter,
        pose: &Pose,
        place: [f64; 2],
        best: &mut Best,
        counters: &mut Counters,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let view = View::new(&self.frame, cutter, pose);
        let mut top = Top::<L>::new(cutter, pose, place, best.height);
        let mut open = Stack::new();
        open.push(f32::INFINITY, INNER);
        // Equal heights are still looked at: a lower number may be among them.
        while let Some(child) = open.pop(top.height) {
            if child & INNER == 0 {
                let before = (best.height, best.id);
                let leaf = &self.leaves[child as usize];
                counters.evaluations +=
                    leaf.search(simd, &self.points, cutter, pose, &top.ceiling, best);
                if before != (best.height, best.id) {
                    let [d, _, z] = pose.face(best.contact);
                    top = Top::new(cutter, pose, [d, z], best.height);
                }
                continue;
            }
            counters.nodes += 1;
            let node = &self.nodes[(child ^ INNER) as usize];
            let bounds = lid_bounds(simd, cutter, &view, top.place, &node.lids);
            open.push_all(simd, bounds, top.height, &node.children);
        }
    }
}

/// What is known before a search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    /// A height that some candidate exceeds, mm, or minus infinity.
    pub floor: f64,
    /// `(d, z)` of the place on the cutter that is likely to touch.
    pub place: [f64; 2],
}

/// What the best candidate so far rules out.
struct Top<L: Leaf> {
    /// Not above its height, and never below everything.
    height: f32,
    /// `(d, z)` of its place on the cutter, and what leaves make of it.
    place: [f32; 2],
    ceiling: L::Ceiling,
}

impl<L: Leaf> Top<L> {
    #[inline(always)]
    fn new(cutter: &Cutter, pose: &Pose, place: [f64; 2], height: f64) -> Self {
        let low = height as f32 - height.abs() as f32 * f32::EPSILON;
        Self {
            height: low.max(f32::MIN),
            place: [place[0] as f32, place[1] as f32],
            ceiling: L::ceiling(cutter, pose, place),
        }
    }
}

/// The children still to be looked at.
struct Stack {
    open: [(f32, u32); Self::SIZE],
    len: usize,
}

impl Stack {
    /// Seven for each level of the tree, of which there are at most eleven, and one more.
    const SIZE: usize = 80;

    #[inline(always)]
    fn new() -> Self {
        Self {
            open: [(0.0, 0); Self::SIZE],
            len: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, bound: f32, child: u32) {
        self.open[self.len] = (bound, child);
        self.len += 1;
    }

    /// Pushes the children whose bound is not below `height`, the most promising one last.
    #[inline(always)]
    fn push_all<S: Simd>(&mut self, _: S, bounds: f32x8<S>, height: f32, children: &[u32; LANES]) {
        let mut high = bounds.simd_ge(height).to_bitmask();
        let first = self.len;
        let mut highest = first;
        while high != 0 {
            let lane = high.trailing_zeros() as usize;
            high &= high - 1;
            if self.len > first && bounds[lane] > self.open[highest].0 {
                highest = self.len;
            }
            self.push(bounds[lane], children[lane]);
        }
        if self.len > first {
            self.open.swap(highest, self.len - 1);
        }
    }

    /// The next child whose bound is not below `height`.
    #[inline(always)]
    fn pop(&mut self, height: f32) -> Option<u32> {
        while let Some(len) = self.len.checked_sub(1) {
            self.len = len;
            let (bound, child) = self.open[len];
            if bound >= height {
                return Some(child);
            }
        }
        None
    }
}

/// Leaves of each full child of a node over `leaves` leaves: the greatest power of eight below them.
fn child_size(leaves: usize) -> usize {
    let mut size = 1;
    while size * LANES < leaves {
        size *= LANES;
    }
    size
}

/// Nodes of a tree over `leaves` leaves; all children but the last are full.
fn nodes(leaves: usize) -> usize {
    if leaves == 0 {
        return 0;
    }
    let size = child_size(leaves);
    if size == 1 {
        return 1;
    }
    let (full, rest) = (leaves / size, leaves % size);
    1 + full * nodes(size) + nodes(rest)
}

/// Orders blocks so that those of each node lie together.
fn arrange(blocks: &mut [Block]) {
    let size = child_size(blocks.len());
    if size > 1 {
        part(blocks, size);
    }
}

/// Parts blocks into children of `size` blocks, halving along the longest side.
fn part(blocks: &mut [Block], size: usize) {
    if blocks.len() <= size {
        return arrange(blocks);
    }
    let children = blocks.len().div_ceil(size);
    let left = children / 2 * size;
    let axis = longest_side(&blocks.iter().map(|b| b.middle));
    let middle = |b: &Block| b.middle[axis];
    blocks.select_nth_unstable_by(left, |a, b| middle(a).total_cmp(&middle(b)));
    let (left, right) = blocks.split_at_mut(left);
    if right.len() < ALONE {
        part(left, size);
        part(right, size);
    } else {
        rayon::join(|| part(left, size), || part(right, size));
    }
}

/// The vertices of all leaves, one leaf after the other.
struct Outline {
    points: Vec<Point>,
    /// Where those of each leaf begin, and where the last end.
    starts: Vec<usize>,
}

impl Outline {
    fn new(leaves: &[Vec<Point>]) -> Self {
        let mut starts = vec![0];
        let mut points = Vec::with_capacity(leaves.iter().map(Vec::len).sum());
        for vertices in leaves {
            points.extend_from_slice(vertices);
            starts.push(points.len());
        }
        Self { points, starts }
    }

    fn of(&self, leaves: Range<usize>) -> &[Point] {
        &self.points[self.starts[leaves.start]..self.starts[leaves.end]]
    }

    fn frame(&self) -> Frame {
        let x = Interval::of(self.points.iter().map(|p| p[0]));
        let square = |p: &Point| p[1] * p[1] + p[2] * p[2];
        let across = self.points.iter().map(square).fold(0.0, f64::max);
        Frame::new(x, across.sqrt())
    }
}

/// Fills the nodes over leaves that are in order; `offset` is the place of the first node.
fn build(
    frame: &Frame,
    outline: &Outline,
    leaves: Range<usize>,
    nodes: &mut [Node],
    offset: usize,
) {
    let size = child_size(leaves.len());
    let Some((node, mut below)) = nodes.split_first_mut() else {
        return;
    };
    let child = |start: usize| start..leaves.end.min(start + size);
    let starts = || leaves.clone().step_by(size).enumerate();
    let mut tasks = Vec::with_capacity(LANES);
    let mut at = offset + 1;
    for (lane, start) in starts() {
        node.children[lane] = start as u32;
        if size > 1 {
            node.children[lane] = INNER | at as u32;
            let (own, rest) = below.split_at_mut(self::nodes(child(start).len()));
            below = rest;
            let nodes = own.len();
            tasks.push((child(start), own, at));
            at += nodes;
        }
    }
    let fill = |node: &mut Node| {
        for (lane, start) in starts() {
            node.lids.set(lane, frame, outline.of(child(start)));
        }
    };
    if leaves.len() < ALONE {
        fill(node);
        for (child, nodes, offset) in tasks {
            build(frame, outline, child, nodes, offset);
        }
    } else {
        rayon::join(
            || fill(node),
            || {
                let tasks = tasks.into_par_iter();
                tasks.for_each(|(child, nodes, offset)| {
                    build(frame, outline, child, nodes, offset);
                });
            },
        );
    }
}
