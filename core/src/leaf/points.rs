//! Leaves of points: a block of four by four, each a candidate.

use fearless_simd::{Simd, f64x8, prelude::*};

use super::{Batch, Leaf};
use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes, heights, lanes};
use crate::path::Touch;
use crate::simd::Set;
use crate::vector::Point;

/// Points in a leaf: two vectors of them.
pub(crate) const POINTS: usize = 2 * LANES;

/// A block of points, its free slots out of any reach.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct PointLeaf {
    at: [[f64; POINTS]; 3],
    ids: [u64; POINTS],
}

impl PointLeaf {
    /// Nothing yet.
    pub const EMPTY: Self = Self {
        at: [[f64::INFINITY; POINTS], [0.0; POINTS], [0.0; POINTS]],
        ids: [u64::MAX; POINTS],
    };

    /// Puts a point into a free slot.
    pub fn set(&mut self, slot: usize, id: u64, point: Point) {
        for (axis, coordinate) in self.at.iter_mut().zip(point) {
            axis[slot] = coordinate;
        }
        self.ids[slot] = id;
    }

    /// How many points there are: told by what is read of it anyway.
    #[inline(always)]
    fn count<S: Simd>(&self, simd: S) -> u32 {
        let low = f64x8::from_slice(simd, &self.at[0][..LANES]);
        let high = f64x8::from_slice(simd, &self.at[0][LANES..]);
        let there = low.simd_lt(f64::INFINITY).to_bitmask();
        there.count_ones() + high.simd_lt(f64::INFINITY).to_bitmask().count_ones()
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
    type Sight = ();

    #[inline(always)]
    fn expect((): &mut (), _: &Cutter, _: &Pose, _: [f64; 2]) {}

    #[inline(always)]
    fn search<S: Set>(
        &self,
        simd: S,
        _: &[Point],
        batch: &mut Batch<()>,
        alive: Lanes,
    ) -> (u64, Lanes) {
        let nothing = f64x8::splat(simd, f64::NEG_INFINITY);
        let mut all = [[nothing; 2]; LANES];
        let mut highest = [f64::NEG_INFINITY; LANES];
        for lane in lanes(alive) {
            let (cutter, pose) = (batch.cutter, &batch.starts[lane].pose);
            all[lane] = [
                self.half(simd, cutter, pose, 0),
                self.half(simd, cutter, pose, LANES),
            ];
            highest[lane] = all[lane][0].max(all[lane][1]).reduce_max();
        }
        let mut raised = 0;
        for lane in lanes(alive) {
            let (best, height) = (&mut batch.best[lane], highest[lane]);
            if height >= best.height.max(f64::MIN) {
                let [low, high] = all[lane];
                let highest =
                    low.simd_eq(height).to_bitmask() | high.simd_eq(height).to_bitmask() << LANES;
                for slot in lanes(highest) {
                    let contact = self.point(slot);
                    if best.raise(Touch { height, contact }, self.ids[slot]) {
                        raised |= 1 << lane;
                    }
                }
            }
        }
        let evaluated = self.count(simd) * alive.count_ones();
        (u64::from(evaluated), raised)
    }
}
