//! What a position sees of a leaf of facets: which of them may be higher than the highest it has found.

use fearless_simd::{Simd, f32x8, prelude::*};

use super::facets::{FACETS, FacetLeaf, VERTICES};
use super::{Best, margin};
use crate::bound::{Dome, NearDome, Spots};
use crate::contact::{Pose, least_height};
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes, both, lanes};
use crate::simd::Set;
use crate::vector::Point;

/// The facets of one leaf under a dome.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sight {
    /// It touches F where the highest touch is, or is expected.
    pub dome: Dome,
    near: NearDome,
    /// What heights are counted from, mm.
    base: f64,
    /// The vertices under the dome: its height over each, and their δ and w.
    spots: [[f32; VERTICES]; 3],
    /// The facets that may be higher than the highest found, or as high.
    pub open: Lanes,
    /// How high each of them is at most, from the base on.
    bounds: [f32; FACETS],
}

impl Sight {
    /// Looks at the vertices: under a dome that touches F where `best` is, or is expected. Given all points, the
    /// highest of them is a floor.
    #[inline(always)]
    pub fn look<S: Set>(
        &mut self,
        simd: S,
        leaf: &FacetLeaf,
        points: Option<&[Point]>,
        cutter: &Cutter,
        pose: &Pose,
        best: &mut Best,
    ) {
        self.open = 0;
        self.base = best.base();
        self.near = self.dome.near(pose, leaf.middle, leaf.size, self.base);
        let (low, over_low) = self.near.over(simd, leaf.eight(simd, 0));
        let (high, over_high) = self.near.over(simd, leaf.eight(simd, LANES));
        let sag = self.near.sag(leaf.edge);
        let top = low.height.max(high.height).reduce_max();
        if top < -sag {
            return;
        }
        let little = margin(cutter, pose, self.base) as f32;
        if let Some(points) = points.filter(|_| top > little) {
            // The facets at a vertex are no lower than it is.
            let tops = both(low.height.simd_ge(top), high.height.simd_ge(top));
            let vertex = leaf.places[tops.trailing_zeros() as usize % VERTICES];
            let floor = least_height(cutter, pose, points[vertex as usize]);
            if floor > best.height {
                *best = Best::above(floor);
            }
        }
        let above = self.above_base(best.height);
        let least = above - sag;
        let higher = both(low.height.simd_ge(least), high.height.simd_ge(least));
        let over = both(over_low.simd_ge(above), over_high.simd_ge(above));
        self.open = leaf.having(simd, higher) & leaf.having(simd, over);
        if self.near.is_level() {
            let off = pose.x - leaf.middle[0];
            let reach = cutter.half_width();
            let reach = reach + 1.0e-6 * (reach + off.abs());
            let (from, to) = ((off - reach) as f32, (off + reach) as f32);
            let [low, high] = [leaf.eight(simd, 0)[0], leaf.eight(simd, LANES)[0]];
            self.open &= leaf.having(simd, both(low.simd_ge(from), high.simd_ge(from)));
            self.open &= leaf.having(simd, both(low.simd_le(to), high.simd_le(to)));
        }
        if best.held != Best::NONE {
            let level = above - little;
            let level = both(over_low.simd_ge(level), over_high.simd_ge(level));
            self.open = leaf.beside(simd, self.open, level, best);
        }
        let Spots { height, d, w } = low;
        for (spots, half) in self.spots.iter_mut().zip([height, d, w]) {
            spots[..LANES].copy_from_slice(&*half);
        }
        let Spots { height, d, w } = high;
        for (spots, half) in self.spots.iter_mut().zip([height, d, w]) {
            spots[LANES..].copy_from_slice(&*half);
        }
    }

    /// A height from the base on, in single precision not above it.
    #[inline(always)]
    fn above_base(&self, height: f64) -> f32 {
        let above = (height - self.base) as f32;
        above - above.abs() * f32::EPSILON
    }

    /// Bounds the open facets, and closes those that are lower than `best`.
    #[inline(always)]
    pub fn bound<S: Set>(&mut self, simd: S, leaf: &FacetLeaf, best: &Best) {
        let above = self.above_base(best.height);
        let mut left = self.open;
        while left != 0 {
            // Eight at a time; where less are left, one of them again.
            let mut slots = [left.trailing_zeros() as usize; LANES];
            for (slot, next) in slots.iter_mut().zip(lanes(left)) {
                *slot = next;
                left &= left - 1;
            }
            let mut corners = [[[0.0; LANES]; 3]; 3];
            for (lane, &slot) in slots.iter().enumerate() {
                for (corner, vertex) in corners.iter_mut().zip(leaf.corners[slot]) {
                    for (corner, spots) in corner.iter_mut().zip(&self.spots) {
                        corner[lane] = spots[usize::from(vertex) % VERTICES];
                    }
                }
            }
            let bounds = simd.piece(
                #[inline(always)]
                || {
                    let spots = [
                        spots(simd, &corners[0]),
                        spots(simd, &corners[1]),
                        spots(simd, &corners[2]),
                    ];
                    self.near.summits(simd, &spots)
                },
            );
            let lower = !bounds.simd_ge(above).to_bitmask();
            for (lane, &slot) in slots.iter().enumerate() {
                self.bounds[slot] = bounds[lane];
                self.open &= !((lower >> lane & 1) << slot);
            }
        }
    }

    /// The most promising of the open facets, if it may be as high as `best`.
    #[inline(always)]
    pub fn most_promising(&self, best: &Best) -> Option<usize> {
        let mut highest = (f32::NEG_INFINITY, None);
        for slot in lanes(self.open) {
            if self.bounds[slot] > highest.0 {
                highest = (self.bounds[slot], Some(slot));
            }
        }
        highest
            .1
            .filter(|_| highest.0 >= self.above_base(best.height))
    }
}

#[inline(always)]
fn spots<S: Simd>(simd: S, [height, d, w]: &[[f32; LANES]; 3]) -> Spots<S> {
    Spots {
        height: f32x8::from_slice(simd, height),
        d: f32x8::from_slice(simd, d),
        w: f32x8::from_slice(simd, w),
    }
}
