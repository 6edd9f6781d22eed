//! What a position sees of a leaf of facets: which of them may be higher than the highest it has found.

use fearless_simd::prelude::*;

use super::facets::{FACETS, FacetLeaf, VERTICES};
use super::{Best, margin};
use crate::bound::{Dome, NearDome, Spots, load};
use crate::contact::{Pose, least_height};
use crate::cutter::Cutter;
use crate::lanes::{Lanes, lanes};
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
        let (under, plane) = self.near.over(simd, leaf.vertices(simd));
        let sag = self.near.sag(leaf.edge);
        let mut above = self.above_base(best.height);
        if under.height.simd_ge(above - sag).to_bitmask() == 0 {
            return;
        }
        let little = margin(cutter, pose, self.base) as f32;
        let raising = under.height.simd_gt(little).to_bitmask();
        if let Some(points) = points.filter(|_| raising != 0) {
            // The facets at a vertex are no lower than it is.
            let tops = under.height.simd_ge(under.height.reduce_max()).to_bitmask();
            let vertex = leaf.places[tops.trailing_zeros() as usize % VERTICES];
            let floor = least_height(cutter, pose, points[vertex as usize]);
            if floor > best.height {
                *best = Best::above(floor);
                above = self.above_base(floor);
            }
        }
        let higher = under.height.simd_ge(above - sag).to_bitmask();
        let over = plane.simd_ge(above).to_bitmask();
        self.open = leaf.having(simd, higher) & leaf.having(simd, over);
        if self.near.is_level() {
            let off = pose.x - leaf.middle[0];
            let reach = cutter.half_width();
            let reach = reach + 1.0e-6 * (reach + off.abs());
            let (from, to) = ((off - reach) as f32, (off + reach) as f32);
            let [x, ..] = leaf.vertices(simd);
            self.open &= leaf.having(simd, x.simd_ge(from).to_bitmask());
            self.open &= leaf.having(simd, x.simd_le(to).to_bitmask());
        }
        if best.held != Best::NONE {
            let level = plane.simd_ge(above - little).to_bitmask();
            self.open = leaf.beside(simd, self.open, level, best);
        }
        self.spots = [*under.height, *under.d, *under.w];
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
        let bounds = simd.piece(
            #[inline(always)]
            || {
                let [height, d, w] = load(simd, &self.spots);
                let vertices = Spots { height, d, w };
                let corners = [
                    leaf.at_corners(simd, 0, &vertices),
                    leaf.at_corners(simd, 1, &vertices),
                    leaf.at_corners(simd, 2, &vertices),
                ];
                self.near.summits(simd, &corners)
            },
        );
        self.open &= bounds.simd_ge(self.above_base(best.height)).to_bitmask();
        self.bounds = *bounds;
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
