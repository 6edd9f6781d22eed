//! Building the hierarchy: bundles that lie together come under one node, and lids over all of them.

use std::ops::Range;

use rayon::prelude::*;

use super::{INNER, Node};
use crate::blocks::{Bundle, longest_side};
use crate::bound::{Frame, Lids};
use crate::lanes::LANES;
use crate::simd::{Token, with_simd};
use crate::vertices::Vertices;

/// Bundles of leaves below which a subtree is built by one thread.
pub(super) const ALONE: usize = 32;

/// Orders bundles so that those of each node lie together.
pub(super) fn arrange(bundles: &mut [Bundle]) {
    let size = child_size(bundles.len());
    if size > 1 {
        part(bundles, size);
    }
}

/// Parts bundles into children of `size` each, halving along the longest side.
fn part(bundles: &mut [Bundle], size: usize) {
    if bundles.len() <= size {
        return arrange(bundles);
    }
    let children = bundles.len().div_ceil(size);
    let left = children / 2 * size;
    let axis = longest_side(bundles.iter().map(|b| b.middle));
    let middle = |b: &Bundle| b.middle[axis];
    bundles.select_nth_unstable_by(left, |a, b| middle(a).total_cmp(&middle(b)));
    let (left, right) = bundles.split_at_mut(left);
    if right.len() < ALONE {
        part(left, size);
        part(right, size);
    } else {
        rayon::join(|| part(left, size), || part(right, size));
    }
}

/// The nodes over leaves that are in order: those above bundles, the root first, then one over each bundle. `firsts` has
/// the first leaf of each bundle, and one beyond the last.
pub(super) fn nodes(
    simd: Token,
    frame: Frame,
    vertices: Vertices,
    firsts: Vec<usize>,
) -> Vec<Node> {
    let upper = upper(firsts.len() - 1);
    let build = Build {
        simd,
        frame,
        vertices,
        firsts,
        upper,
    };
    build.nodes()
}

/// What nodes are built from.
struct Build {
    simd: Token,
    frame: Frame,
    vertices: Vertices,
    firsts: Vec<usize>,
    /// How many nodes are above those of bundles.
    upper: usize,
}

impl Build {
    fn nodes(&self) -> Vec<Node> {
        let bundles = self.firsts.len() - 1;
        let empty = Node {
            lids: Lids::EMPTY,
            children: [0; LANES],
        };
        let mut nodes = vec![empty; self.upper + bundles];
        let (upper, low) = nodes.split_at_mut(self.upper);
        rayon::join(
            || self.upper(0..bundles, upper, 0),
            || {
                let low = low.par_iter_mut().with_min_len(ALONE).enumerate();
                low.for_each(|(bundle, node)| self.low(bundle, node));
            },
        );
        nodes
    }

    /// Fills the node of a bundle.
    fn low(&self, bundle: usize, node: &mut Node) {
        let leaves = self.firsts[bundle]..self.firsts[bundle + 1];
        for (lane, leaf) in leaves.enumerate() {
            node.children[lane] = leaf as u32;
            self.cover(node, lane, leaf..leaf + 1);
        }
    }

    /// Fills the nodes over bundles that are in order; `offset` is the place of the first node.
    fn upper(&self, bundles: Range<usize>, nodes: &mut [Node], offset: usize) {
        let size = child_size(bundles.len());
        let Some((node, mut below)) = nodes.split_first_mut() else {
            return;
        };
        let child = |start: usize| start..bundles.end.min(start + size);
        let starts = || bundles.clone().step_by(size).enumerate();
        let mut tasks = Vec::with_capacity(LANES);
        let mut at = offset + 1;
        for (lane, start) in starts() {
            let child = child(start);
            let (own, rest) = below.split_at_mut(upper(child.len()));
            below = rest;
            let place = match own.len() {
                0 => self.upper + start,
                _ => at,
            };
            node.children[lane] = INNER | place as u32;
            let nodes = own.len();
            tasks.push((child, own, at));
            at += nodes;
        }
        let fill = |node: &mut Node| {
            for (lane, start) in starts() {
                let Range { start, end } = child(start);
                self.cover(node, lane, self.firsts[start]..self.firsts[end]);
            }
        };
        if bundles.len() < ALONE {
            fill(node);
            for (child, nodes, offset) in tasks {
                self.upper(child, nodes, offset);
            }
        } else {
            rayon::join(
                || fill(node),
                || {
                    let tasks = tasks.into_par_iter();
                    tasks.for_each(|(child, nodes, offset)| self.upper(child, nodes, offset));
                },
            );
        }
    }

    /// Puts a lid around leaves.
    fn cover(&self, node: &mut Node, lane: usize, leaves: Range<usize>) {
        let points = self.vertices.under(leaves);
        with_simd!(self.simd, simd => node.lids.set(simd, lane, &self.frame, points));
    }
}

/// Bundles of each full child of a node over `bundles`: the greatest power of eight below them.
fn child_size(bundles: usize) -> usize {
    let mut size = 1;
    while size * LANES < bundles {
        size *= LANES;
    }
    size
}

/// Nodes of a tree over so many bundles, without those of the bundles themselves; all children but the last are full.
fn upper(bundles: usize) -> usize {
    if bundles < 2 {
        return 0;
    }
    let size = child_size(bundles);
    let (full, rest) = (bundles / size, bundles % size);
    1 + full * upper(size) + upper(rest)
}
