//! The hierarchy over the candidates that an extent holds, and the search for the highest.
//!
//! A binary tree of boxes in depth-first order. Its leaves are full but for the last, so the place of
//! every node follows from the number of candidates below it, and halves can be built side by side.
//! The search is exact: a box is skipped only if its bound lies below the best height found, and of
//! equal heights the lowest candidate wins, in whatever order they are met.

use crate::bound::{Patch, facet_bound};
use crate::contact::{Pose, touch_facet, touch_point};
use crate::cutter::Cutter;
use crate::path::Touch;
use crate::record::Counters;
use crate::row::{Facet, Row, facets};
use crate::vector::{Interval, Point};

/// Candidates in a leaf.
const LEAF: usize = 4;

/// Below this many candidates a node's box is turned to fit; larger ones are rarely bound to
/// anything flat, and an upright box costs less.
const FITTED: usize = 1024;

/// Something the cutter can touch.
pub(crate) trait Candidate: Copy + Send + Sync {
    /// Number in the part; the tie-break.
    fn id(&self) -> u64;
    /// Its corners, as indices into the points.
    fn corners(&self) -> &[u32];
    /// Where the cutter touches it; also `None` if that is plainly below `floor`.
    fn touch(&self, points: &[Point], cutter: &Cutter, pose: &Pose, floor: f64) -> Option<Touch>;
}

/// A point of a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointCandidate {
    id: u64,
    point: [u32; 1],
}

impl Candidate for PointCandidate {
    fn id(&self) -> u64 {
        self.id
    }
    fn corners(&self) -> &[u32] {
        &self.point
    }
    #[inline(always)]
    fn touch(&self, points: &[Point], cutter: &Cutter, pose: &Pose, _: f64) -> Option<Touch> {
        touch_point(cutter, pose, points[self.point[0] as usize])
    }
}

/// A facet between two rows, or of a slab.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FacetCandidate {
    id: u64,
    corners: [u32; 3],
}

impl Candidate for FacetCandidate {
    fn id(&self) -> u64 {
        self.id
    }
    fn corners(&self) -> &[u32] {
        &self.corners
    }
    #[inline(always)]
    fn touch(&self, points: &[Point], cutter: &Cutter, pose: &Pose, floor: f64) -> Option<Touch> {
        let corners = self.corners.map(|c| points[c as usize]);
        // Solving a facet costs several times what bounding it does.
        if floor > f64::NEG_INFINITY && facet_bound(cutter, pose, corners).is_none_or(|b| b < floor)
        {
            return None;
        }
        touch_facet(cutter, pose, corners)
    }
}

/// All points of the rows.
pub(crate) fn point_candidates(rows: &[Row]) -> (Vec<Point>, Vec<PointCandidate>) {
    let points: Vec<Point> = rows.iter().flat_map(|r| r.points.iter().copied()).collect();
    let ids = rows
        .iter()
        .flat_map(|r| (0..r.points.len()).map(|i| number(r, i)));
    let candidates = ids
        .zip(0u32..)
        .map(|(id, i)| PointCandidate { id, point: [i] });
    let candidates = candidates.collect();
    (points, candidates)
}

/// All facets of the rows, which are in order of their ids.
pub(crate) fn facet_candidates(rows: &[Row]) -> (Vec<Point>, Vec<FacetCandidate>) {
    let points = rows.iter().flat_map(|r| r.points.iter().copied()).collect();
    let candidate = |f: Facet| FacetCandidate {
        id: number(&rows[f.row], f.number),
        corners: f.corners,
    };
    (points, facets(rows).map(candidate).collect())
}

/// The number of a row's `i`-th candidate in the part.
fn number(row: &Row, i: usize) -> u64 {
    u64::from(row.id) << 32 | i as u64
}

/// The highest candidate found so far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Winner {
    pub touch: Touch,
    id: u64,
    /// Place in the tree: a hint for the next position.
    pub place: u32,
}

/// The hierarchy.
#[derive(Debug)]
pub(crate) struct Tree<C> {
    points: Vec<Point>,
    candidates: Vec<C>,
    patches: Vec<Patch>,
}

impl<C: Candidate> Tree<C> {
    /// Builds the hierarchy, in parallel on the current thread pool.
    pub fn new((points, mut candidates): (Vec<Point>, Vec<C>)) -> Self {
        let mut patches = vec![Patch::EMPTY; nodes(candidates.len())];
        if !candidates.is_empty() {
            build(&points, &mut candidates, &mut patches);
        }
        Self {
            points,
            candidates,
            patches,
        }
    }

    /// Raises `best` to candidate number `place` of the tree if that is higher.
    #[inline]
    pub fn try_place(&self, place: u32, cutter: &Cutter, pose: &Pose, best: &mut Option<Winner>) {
        let floor = best.as_ref().map_or(f64::NEG_INFINITY, |b| b.touch.height);
        self.raise(place, cutter, pose, floor, best);
    }

    #[inline(always)]
    fn raise(
        &self,
        place: u32,
        cutter: &Cutter,
        pose: &Pose,
        floor: f64,
        best: &mut Option<Winner>,
    ) {
        let candidate = &self.candidates[place as usize];
        if let Some(touch) = candidate.touch(&self.points, cutter, pose, floor) {
            let id = candidate.id();
            let wins = |b: &Winner| {
                touch.height > b.touch.height || (touch.height == b.touch.height && id < b.id)
            };
            if best.as_ref().is_none_or(wins) {
                *best = Some(Winner { touch, id, place });
            }
        }
    }

    /// Raises `best` to the highest of all candidates, by trying every one.
    pub fn try_all(&self, cutter: &Cutter, pose: &Pose, best: &mut Option<Winner>) -> Counters {
        let all = self.candidates.len() as u32;
        for place in 0..all {
            // No floor: brute force solves every candidate, and so checks what the bounds skip.
            self.raise(place, cutter, pose, f64::NEG_INFINITY, best);
        }
        Counters {
            evaluations: u64::from(all),
            nodes: 0,
        }
    }

    /// Raises `best` to the highest of all candidates, by the hierarchy.
    pub fn search(&self, cutter: &Cutter, pose: &Pose, best: &mut Option<Winner>) -> Counters {
        let mut counters = Counters::default();
        let mut open = Stack::EMPTY;
        let bound = |node: u32, counters: &mut Counters| {
            counters.nodes += 1;
            self.patches[node as usize].bound(cutter, pose)
        };
        if !self.candidates.is_empty()
            && let Some(height) = bound(0, &mut counters)
        {
            open.push(Open {
                height,
                node: 0,
                first: 0,
                count: self.candidates.len() as u32,
            });
        }
        while let Some(Open {
            height,
            node,
            first,
            count,
        }) = open.pop()
        {
            // Equal heights are still looked at: a lower number may be among them.
            if best.as_ref().is_some_and(|b| height < b.touch.height) {
                continue;
            }
            if count as usize <= LEAF {
                for place in first..first + count {
                    self.try_place(place, cutter, pose, best);
                }
                counters.evaluations += u64::from(count);
                continue;
            }
            let left_count = left_of(count as usize) as u32;
            let left_node = node + 1;
            let right_node = left_node + nodes(left_count as usize) as u32;
            let left = bound(left_node, &mut counters).map(|height| Open {
                height,
                node: left_node,
                first,
                count: left_count,
            });
            let right = bound(right_node, &mut counters).map(|height| Open {
                height,
                node: right_node,
                first: first + left_count,
                count: count - left_count,
            });
            // The more promising one is looked at first.
            let (lower, higher) = match (left, right) {
                (Some(l), Some(r)) if l.height > r.height => (right, left),
                _ => (left, right),
            };
            lower.into_iter().chain(higher).for_each(|o| open.push(o));
        }
        counters
    }
}

/// A node still to be looked at.
#[derive(Debug, Clone, Copy)]
struct Open {
    height: f64,
    node: u32,
    first: u32,
    count: u32,
}

/// The nodes still to be looked at: one for each level of the tree, of which there are at most 32.
struct Stack {
    nodes: [Open; 40],
    len: usize,
}

impl Stack {
    const EMPTY: Self = Self {
        nodes: [Open {
            height: 0.0,
            node: 0,
            first: 0,
            count: 0,
        }; 40],
        len: 0,
    };

    fn push(&mut self, node: Open) {
        self.nodes[self.len] = node;
        self.len += 1;
    }

    fn pop(&mut self) -> Option<Open> {
        self.len = self.len.checked_sub(1)?;
        Some(self.nodes[self.len])
    }
}

/// Nodes of a tree over `count` candidates: its leaves are full but for the last.
fn nodes(count: usize) -> usize {
    (2 * count.div_ceil(LEAF)).saturating_sub(1)
}

/// How many of `count > LEAF` candidates go left: as many full leaves as make a complete tree.
fn left_of(count: usize) -> usize {
    LEAF * (count.div_ceil(LEAF).next_power_of_two() / 2)
}

fn build<C: Candidate>(points: &[Point], candidates: &mut [C], patches: &mut [Patch]) {
    let corner = |c: &u32| points[*c as usize];
    let corners = candidates
        .iter()
        .flat_map(|c| c.corners().iter().map(corner));
    let (patch, below) = patches
        .split_first_mut()
        .expect("a node for every candidate");
    *patch = if candidates.len() <= FITTED {
        Patch::around(corners)
    } else {
        Patch::upright(corners)
    };
    if candidates.len() <= LEAF {
        return;
    }
    let left_count = left_of(candidates.len());
    let axis = longest_axis(points, candidates);
    let middle = |c: &C| {
        c.corners()
            .iter()
            .map(|&i| points[i as usize][axis])
            .sum::<f64>()
    };
    candidates.select_nth_unstable_by(left_count, |a, b| middle(a).total_cmp(&middle(b)));
    let (left, right) = candidates.split_at_mut(left_count);
    let (left_patches, right_patches) = below.split_at_mut(nodes(left_count));
    if right.len() < FITTED {
        build(points, left, left_patches);
        build(points, right, right_patches);
    } else {
        rayon::join(
            || build(points, left, left_patches),
            || build(points, right, right_patches),
        );
    }
}

/// The axis along which the candidates' first corners extend most.
fn longest_axis<C: Candidate>(points: &[Point], candidates: &[C]) -> usize {
    let extent = |axis: usize| {
        let along = candidates
            .iter()
            .map(|c| points[c.corners()[0] as usize][axis]);
        let range = Interval::of(along);
        range.high - range.low
    };
    let extents = [extent(0), extent(1), extent(2)];
    (0..3).fold(0, |a, b| if extents[b] > extents[a] { b } else { a })
}
