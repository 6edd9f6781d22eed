//! The least clearance of a point to all positions of a path.
//!
//! Both clearances are convex in where the point is seen from the cutter, so their tangent at a
//! tile's middle, less what the tile's extents can make of its slope, bounds every position of the
//! tile; where cutter and part are tangent to each other the slack is second order in the tile's
//! size. The search opens the nearest tile first and skips none that could hold the least, so it
//! equals going through all positions, bit for bit, ties included.

use std::ops::{Add, Mul, Sub};

use super::INTERMEDIATE;
use super::body::{Plane, Solid, larger, smaller};
use super::hierarchy::{Child, Hierarchy, Lanes, Leaf, Node, Stands, WIDTH};
use crate::vector::Point;

/// The least clearance found, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Least {
    /// mm; `f64::MAX` while nothing is found.
    pub value: f64,
    /// The number of the position, the lowest of those that share the value; `usize::MAX` while
    /// nothing is found.
    pub index: usize,
    leaf: usize,
}

/// The least of both clearances. They are two minima, seldom at the same position, and behind the
/// cutter neither bounds the other; one descent looks for both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Clearance {
    /// Along the normal.
    pub normal: Least,
    /// Along the attack axis; not found if no position reaches the point.
    pub attack: Least,
}

impl Least {
    /// Nothing found, and only what is no greater than `value` looked for.
    pub const fn below(value: f64) -> Self {
        Self {
            value,
            index: usize::MAX,
            leaf: usize::MAX,
        }
    }

    /// The value, if a position was found.
    pub fn found(&self) -> Option<f64> {
        (self.index != usize::MAX).then_some(self.value)
    }

    #[inline(always)]
    fn offer(&mut self, value: f64, index: usize, leaf: usize) {
        if value < self.value || (value == self.value && index < self.index) {
            *self = Self { value, index, leaf };
        }
    }
}

impl Clearance {
    /// Nothing found, and anything looked for.
    pub const NONE: Self = Self {
        normal: Least::below(f64::MAX),
        attack: Least::below(f64::MAX),
    };

    #[inline(always)]
    fn may_improve(&self, bounds: [f32; 2]) -> bool {
        let [normal, attack] = [f64::from(bounds[0]), f64::from(bounds[1])];
        // What is not a number does not exclude anything.
        !((normal > self.normal.value) & (attack > self.attack.value))
    }
}

impl Found {
    #[inline(always)]
    fn may_improve(&self, bounds: [f32; 2]) -> bool {
        self.standing.may_improve(bounds) | self.moving.may_improve(bounds)
    }
}

/// What is found for a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Over all positions.
    pub standing: Clearance,
    /// Over the poses on all moves, of which pose k from position i goes by the number
    /// `INTERMEDIATE · i + k`; only what is no greater than asked for.
    pub moving: Clearance,
}

/// Tiles still to be opened, with what no position of theirs is below (mm, normal and attack);
/// reused from search to search.
pub(super) type Stack = Vec<([f32; 2], Child)>;

/// A point to search for.
struct Query {
    point: [f32; 3],
    /// Distance from the spindle axis, mm.
    radius: f32,
    /// What rounding can make of a bound, mm.
    slack: f32,
}

/// Rounding of a bound relative to the greatest of its numbers: about 45 operations in singles, each
/// off by 2⁻²⁴ at the most, and some room.
const ROUNDING: f64 = 64.0 / 16_777_216.0;

impl<S: Solid> Hierarchy<S> {
    /// The least clearances of the point (mm) over the positions, and over the moves as far as they
    /// are no greater than those of `moving`. The leaves where those of a point nearby were found,
    /// `hint`, are where to look first, and change nothing else. Inlined, as is all that it calls, so that
    /// it is compiled for the vectors of whoever calls it.
    #[inline(always)]
    pub fn least(
        &self,
        point: Point,
        moving: Clearance,
        hint: &Clearance,
        stack: &mut Stack,
    ) -> Found {
        let mut best = Found {
            standing: Clearance::NONE,
            moving,
        };
        let magnitude = point[0].abs() + point[1].abs() + point[2].abs() + self.magnitude;
        let query = Query {
            point: [point[0] as f32, point[1] as f32, point[2] as f32],
            radius: (point[1] * point[1] + point[2] * point[2]).sqrt() as f32,
            slack: (ROUNDING * magnitude) as f32,
        };
        let leaves = [hint.normal.leaf, hint.attack.leaf];
        let distinct = if leaves[0] == leaves[1] { 1 } else { 2 };
        for &number in &leaves[..distinct] {
            if let Some(leaf) = self.leaves.get(number) {
                self.offer(leaf, None, number, point, &mut best.standing);
            }
        }
        stack.clear();
        stack.push(([f32::NEG_INFINITY; 2], self.root));
        while let Some((bounds, child)) = stack.pop() {
            if !best.may_improve(bounds) {
                continue;
            }
            match child {
                Child::None => {}
                Child::Leaf(number) => self.open(number as usize, bounds, point, &mut best),
                Child::Node(number) => {
                    let node = &self.nodes[number as usize];
                    let [normal, attack] = self.bounds(node, &query);
                    let bottom = stack.len();
                    for k in 0..WIDTH {
                        let bounds = [normal[k], attack[k]];
                        if node.children[k] != Child::None && best.may_improve(bounds) {
                            stack.push((bounds, node.children[k]));
                        }
                    }
                    nearest_last(&mut stack[bottom..]);
                }
            }
        }
        best
    }

    /// Offers the positions of a leaf, and the poses of its moves if its bounds make them worth it.
    #[inline(always)]
    fn open(&self, number: usize, bounds: [f32; 2], point: Point, best: &mut Found) {
        let leaf = &self.leaves[number];
        if best.standing.may_improve(bounds) {
            self.offer(leaf, None, number, point, &mut best.standing);
        }
        if best.moving.may_improve(bounds) {
            for k in 0..INTERMEDIATE {
                self.offer(leaf, Some(k), number, point, &mut best.moving);
            }
        }
    }

    /// Offers the positions of a leaf, or pose `k` of each of its moves.
    #[inline(always)]
    fn offer(
        &self,
        leaf: &Leaf,
        k: Option<usize>,
        number: usize,
        point: Point,
        best: &mut Clearance,
    ) {
        let (stands, poses, pose) = match k {
            None => (&leaf.standing, 1, 0),
            Some(k) => (&leaf.moving[k], INTERMEDIATE, k),
        };
        let (mut normal, mut attack) = ([0.0; WIDTH], [0.0; WIDTH]);
        for lane in 0..WIDTH {
            let seen = seen(stands, lane, point);
            normal[lane] = self.body.normal_clearance(seen);
            attack[lane] = self.body.attack_clearance(seen);
        }
        for lane in 0..WIDTH {
            let index = leaf.index[lane].wrapping_mul(poses) + pose;
            best.normal.offer(normal[lane], index, number);
            best.attack.offer(attack[lane], index, number);
        }
    }

    /// What no position of each tile is below, along the normal and along the attack axis; the
    /// latter infinite if no position of the tile reaches the point.
    #[inline(always)]
    fn bounds(&self, node: &Node, query: &Query) -> [Lanes; 2] {
        let (mut normal, mut attack) = ([0.0; WIDTH], [0.0; WIDTH]);
        for k in 0..WIDTH {
            let seen = seen(&node.middle, k, query.point);
            normal[k] = self.normal_bound(node, k, query, seen);
            attack[k] = self.attack_bound(node, k, query, seen);
        }
        [normal, attack]
    }

    #[inline(always)]
    fn normal_bound(&self, node: &Node, k: usize, query: &Query, seen: [f32; 3]) -> f32 {
        let Plane { value, slope } = self.body.normal_plane(seen);
        let turned = [seen[1] + node.middle.height[k], seen[2]];
        let turn = Turn::new(turned, [slope[1], slope[2]], node.half_angle[k]);
        let by_x = slope[0] + slope[1] * node.by_x[k];
        let by_angle = turn.by_angle - slope[1] * node.by_angle[k];
        value
            - by_x.abs() * node.half_x[k]
            - by_angle.abs() * node.half_angle[k]
            - slope[1].abs() * node.residual[k]
            - turn.curl
            - query.slack
    }

    #[inline(always)]
    fn attack_bound(&self, node: &Node, k: usize, query: &Query, seen: [f32; 3]) -> f32 {
        let [d, y, z] = seen;
        let (half_x, half_angle) = (node.half_x[k], node.half_angle[k]);
        let slack = query.slack;
        let w = self.body.half_width() as f32 + slack;
        let m = self.body.max_radius() as f32 + slack;
        let reach = [larger(d - half_x, -w), smaller(d + half_x, w)];
        let turned = [y + node.middle.height[k], z];
        let swing = turned[0].abs() * half_angle + 0.5 * query.radius * half_angle * half_angle;
        let chord = self.body.chord_plane(reach, [z - swing, z + swing]);
        let turn = Turn::new(turned, [-1.0, -chord.slope[1]], half_angle);
        // Only the travel within reach counts: from the middle of that part rather than the tile's.
        let (middle, half) = (0.5 * (reach[0] + reach[1]), 0.5 * (reach[1] - reach[0]));
        let by_x = node.by_x[k] + chord.slope[0];
        let by_angle = turn.by_angle + node.by_angle[k];
        let steep = chord.slope[0].abs() + chord.slope[1].abs();
        let chord_seen =
            chord.value + chord.slope[0] * (d - chord.at[0]) + chord.slope[1] * (z - chord.at[1]);
        let bound = by_x * (d - middle)
            - by_x.abs() * half
            - by_angle.abs() * half_angle
            - y
            - chord_seen
            - node.residual[k]
            - turn.curl
            - (1.0 + steep) * slack;
        if (reach[0] > reach[1]) | (z - swing > m) | (z + swing < -m) {
            f32::INFINITY
        } else {
            bound
        }
    }
}

/// What turning a point `(y, z)` by up to half an angle δ either way makes of a linear function of
/// it: turned it is off by `sin δ (−z, y) − (1 − cos δ)(y, z)`.
struct Turn {
    /// The function's slope by the angle.
    by_angle: f32,
    /// How much less than that slope says the function can be, with `|sin δ − δ| ≤ δ³/6` and
    /// `0 ≤ 1 − cos δ ≤ δ²/2`. On the side of the part that faces the cutter the latter only takes
    /// the point away from it.
    curl: f32,
}

impl Turn {
    #[inline(always)]
    fn new([y, z]: [f32; 2], slope: [f32; 2], half_angle: f32) -> Self {
        let by_angle = slope[1] * y - slope[0] * z;
        let inwards = larger(slope[0] * y + slope[1] * z, 0.0);
        let square = half_angle * half_angle;
        Self {
            by_angle,
            curl: square * (0.5 * inwards + by_angle.abs() * half_angle * (1.0 / 6.0)),
        }
    }
}

/// A part point seen from the cutter's centre.
#[inline(always)]
fn seen<T>(stands: &Stands<T>, k: usize, p: [T; 3]) -> [T; 3]
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>,
{
    [
        p[0] - stands.x[k],
        (p[1] * stands.cos[k] - p[2] * stands.sin[k]) - stands.height[k],
        p[1] * stands.sin[k] + p[2] * stands.cos[k],
    ]
}

/// Puts what is nearest along the normal where it is popped first.
#[inline(always)]
fn nearest_last(tiles: &mut [([f32; 2], Child)]) {
    for i in 1..tiles.len() {
        let mut k = i;
        while k > 0 && tiles[k - 1].0[0] < tiles[k].0[0] {
            tiles.swap(k - 1, k);
            k -= 1;
        }
    }
}
