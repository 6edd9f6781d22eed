//! Leaves of the hierarchy: a few candidates that lie together, laid out for vectors.
//!
//! A leaf is solved exactly. A grid's is a block of four by four points or cells, a mesh's a handful of
//! triangles that share vertices. A candidate carries its number in the part, which breaks ties.

use fearless_simd::{Simd, f64x8, prelude::*};

use crate::bound::{Near, Plane, facet_bounds, load};
use crate::contact::{Pose, touch_seen};
use crate::cutter::Cutter;
use crate::lanes::{LANES, heights, lanes};
use crate::path::Touch;
use crate::simd::Set;
use crate::vector::{Interval, Point};

/// The highest candidate found so far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Best {
    /// Its height, mm; before there is one, a height that some candidate exceeds, or minus infinity.
    pub height: f64,
    /// Its number in the part; [`Best::NOBODY`] before there is one.
    pub id: u64,
    /// Where it is touched.
    pub contact: Point,
}

impl Best {
    /// The number of no candidate.
    pub const NOBODY: u64 = u64::MAX;

    /// Nothing found yet, but known to be above `floor`.
    #[inline(always)]
    pub fn above(floor: f64) -> Self {
        Self {
            height: floor,
            id: Self::NOBODY,
            contact: [0.0; 3],
        }
    }

    /// Takes a candidate's touch if it is higher, or as high and first in number.
    #[inline(always)]
    pub fn raise(&mut self, touch: Touch, id: u64) {
        if touch.height > self.height || (touch.height == self.height && id < self.id) {
            *self = Self {
                height: touch.height,
                id,
                contact: touch.contact,
            };
        }
    }

    /// The touch, if there was any.
    #[inline(always)]
    pub fn touch(&self) -> Option<Touch> {
        (self.id != Self::NOBODY).then_some(Touch {
            height: self.height,
            contact: self.contact,
        })
    }
}

/// A few candidates.
pub(crate) trait Leaf: Sync + Send {
    /// What rules candidates out before they are evaluated.
    type Ceiling: Copy;

    /// The ceiling that touches F at a place on the cutter, `(d, z)`.
    fn ceiling(cutter: &Cutter, pose: &Pose, place: [f64; 2]) -> Self::Ceiling;

    /// Raises `best` to the highest candidate; none is above the ceiling. Returns how many candidates
    /// were evaluated.
    fn search<S: Set>(
        &self,
        simd: S,
        points: &[Point],
        cutter: &Cutter,
        pose: &Pose,
        ceiling: &Self::Ceiling,
        best: &mut Best,
    ) -> u64;
}

/// Points in a leaf: two vectors of them.
pub(crate) const POINTS: usize = 2 * LANES;

/// A block of points, its free slots out of any reach.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct PointLeaf {
    at: [[f64; POINTS]; 3],
    ids: [u64; POINTS],
    count: usize,
}

impl PointLeaf {
    /// Nothing yet.
    pub const EMPTY: Self = Self {
        at: [[f64::INFINITY; POINTS], [0.0; POINTS], [0.0; POINTS]],
        ids: [u64::MAX; POINTS],
        count: 0,
    };

    /// Adds a point to less than [`POINTS`] others.
    pub fn push(&mut self, id: u64, point: Point) {
        for (axis, coordinate) in self.at.iter_mut().zip(point) {
            axis[self.count] = coordinate;
        }
        self.ids[self.count] = id;
        self.count += 1;
    }

    /// Heights of eight of its points.
    #[inline(always)]
    fn half<S: Simd>(&self, simd: S, cutter: &Cutter, pose: &Pose, first: usize) -> f64x8<S> {
        let eight = [
            f64x8::from_slice(simd, &self.at[0][first..first + LANES]),
            f64x8::from_slice(simd, &self.at[1][first..first + LANES]),
            f64x8::from_slice(simd, &self.at[2][first..first + LANES]),
        ];
        heights(simd, cutter, pose, eight)
    }

    #[inline(always)]
    fn point(&self, slot: usize) -> Point {
        [self.at[0][slot], self.at[1][slot], self.at[2][slot]]
    }
}

impl Leaf for PointLeaf {
    /// Evaluating a point costs hardly more than ruling it out.
    type Ceiling = ();

    #[inline(always)]
    fn ceiling(_: &Cutter, _: &Pose, _: [f64; 2]) -> Self::Ceiling {}

    #[inline(always)]
    fn search<S: Set>(
        &self,
        simd: S,
        _: &[Point],
        cutter: &Cutter,
        pose: &Pose,
        (): &Self::Ceiling,
        best: &mut Best,
    ) -> u64 {
        let all = [
            self.half(simd, cutter, pose, 0),
            self.half(simd, cutter, pose, LANES),
        ];
        // One comparison for all of them: which of them are ahead, one after the other, nothing predicts.
        let height = all[0].max(all[1]).reduce_max();
        if height >= best.height.max(f64::MIN) {
            let highest =
                all[0].simd_eq(height).to_bitmask() | all[1].simd_eq(height).to_bitmask() << LANES;
            for slot in lanes(highest) {
                let contact = self.point(slot);
                best.raise(Touch { height, contact }, self.ids[slot]);
            }
        }
        self.count as u64
    }
}

/// Facets in a leaf: those of two by two cells.
pub(crate) const FACETS: usize = LANES;

/// Facets that lie together.
#[derive(Debug, Clone)]
#[repr(align(32))]
pub(crate) struct FacetLeaf {
    /// The corners of each facet from the middle on, in single precision: what the bounds need. Free
    /// slots repeat the first facet.
    near: [[[f32; FACETS]; 3]; 3],
    middle: Point,
    /// Largest distance of a corner from the middle, along any axis, mm.
    size: f32,
    count: u32,
    /// The corners as places among all points: what is solved exactly.
    corners: [[u32; 3]; FACETS],
    ids: [u64; FACETS],
}

impl FacetLeaf {
    /// Of one to [`FACETS`] facets with their numbers.
    pub fn new(points: &[Point], facets: &[([u32; 3], u64)]) -> Self {
        let mut leaf = Self {
            near: [[[0.0; FACETS]; 3]; 3],
            middle: [0.0; 3],
            size: 0.0,
            count: facets.len() as u32,
            corners: [[0; 3]; FACETS],
            ids: [Best::NOBODY; FACETS],
        };
        // By corner and axis.
        let mut at = [[[0.0; FACETS]; 3]; 3];
        for slot in 0..FACETS {
            let (corners, id) = *facets.get(slot).unwrap_or(&facets[0]);
            (leaf.corners[slot], leaf.ids[slot]) = (corners, id);
            for (at, corner) in at.iter_mut().zip(corners) {
                let p = points[corner as usize];
                for k in 0..3 {
                    at[k][slot] = p[k];
                }
            }
        }
        for k in 0..3 {
            let corners = at.each_ref().map(|axes| &axes[k]);
            let Interval { low, high } = range(corners);
            leaf.middle[k] = (low + high) / 2.0;
            leaf.size = leaf.size.max((high - leaf.middle[k]) as f32);
            for (near, corner) in leaf.near.iter_mut().zip(corners) {
                near[k] = corner.map(|c| (c - leaf.middle[k]) as f32);
            }
        }
        leaf
    }

    /// Raises `best` to the facet in a slot.
    #[inline(never)]
    fn solve(&self, points: &[Point], cutter: &Cutter, pose: &Pose, slot: usize, best: &mut Best) {
        let [a, b, c] = self.corners[slot];
        let corners = [points[a as usize], points[b as usize], points[c as usize]];
        let seen = [
            pose.face(corners[0]),
            pose.face(corners[1]),
            pose.face(corners[2]),
        ];
        if let Some(touch) = touch_seen(cutter, corners, seen, best.height) {
            best.raise(touch, self.ids[slot]);
        }
    }
}

/// The range of one coordinate of facets, given by their corners.
fn range([a, b, c]: [&[f64; FACETS]; 3]) -> Interval {
    // Facet by facet first, which is vectors; comparisons are one instruction, and nothing here is NaN.
    let less = |a: f64, b: f64| if a < b { a } else { b };
    let greater = |a: f64, b: f64| if a > b { a } else { b };
    let low: [f64; FACETS] = std::array::from_fn(|i| less(less(a[i], b[i]), c[i]));
    let high: [f64; FACETS] = std::array::from_fn(|i| greater(greater(a[i], b[i]), c[i]));
    Interval {
        low: low.into_iter().fold(low[0], less),
        high: high.into_iter().fold(high[0], greater),
    }
}

impl Leaf for FacetLeaf {
    type Ceiling = Plane;

    #[inline(always)]
    fn ceiling(cutter: &Cutter, pose: &Pose, place: [f64; 2]) -> Self::Ceiling {
        Plane::at(cutter, pose, place)
    }

    #[inline(always)]
    fn search<S: Set>(
        &self,
        simd: S,
        points: &[Point],
        cutter: &Cutter,
        pose: &Pose,
        ceiling: &Self::Ceiling,
        best: &mut Best,
    ) -> u64 {
        // Heights are counted from the best one, so that single precision tells close ones apart.
        let base = best.height.max(-1.0e9);
        let [d, y, z] = pose.face(self.middle);
        let near = Near::new(cutter, pose, [d, y - base, z], self.size);
        let roof = near.roof(ceiling, pose, self.middle, base);
        let corners = [
            load(simd, &self.near[0]),
            load(simd, &self.near[1]),
            load(simd, &self.near[2]),
        ];
        let used = (1u64 << self.count) - 1;
        let under = roof.above(simd, corners);
        let alive = under.simd_ge(0.0).to_bitmask() & used;
        if alive == 0 {
            return 0;
        }
        let bounds = simd.piece(
            #[inline(always)]
            || facet_bounds(simd, cutter, &near, corners).min(under),
        );
        let mut high = bounds.simd_ge(0.0).to_bitmask() & used;
        // The most promising one is solved first; it may rule out the others.
        while high != 0 {
            let mut highest = (f32::NEG_INFINITY, 0);
            for slot in lanes(high) {
                if bounds[slot] > highest.0 {
                    highest = (bounds[slot], slot);
                }
            }
            let (bound, slot) = highest;
            if f64::from(bound) < best.height - base {
                break;
            }
            high &= !(1 << slot);
            self.solve(points, cutter, pose, slot, best);
        }
        u64::from(alive.count_ones())
    }
}
