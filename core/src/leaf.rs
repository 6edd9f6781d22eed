//! Leaves of the hierarchy: a few candidates that lie together, laid out for vectors.
//!
//! A leaf is solved exactly. A grid's is a block of four by four points or two by four cells, a mesh's a handful of
//! triangles that share vertices. A candidate carries its number in the part, which breaks ties.

mod facets;
mod points;
mod sight;

use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes};
use crate::path::Touch;
use crate::simd::Set;
use crate::vector::Point;

pub(crate) use facets::{FACETS, FacetLeaf, VERTICES};
pub(crate) use points::{POINTS, PointLeaf};

/// What is known before a search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    /// Where part and cutter stand.
    pub pose: Pose,
    /// A height that some candidate exceeds, mm, or minus infinity.
    pub floor: f64,
    /// `(d, z)` of the place on the cutter that is likely to touch.
    pub place: [f64; 2],
}

/// The highest candidate found so far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Best {
    /// Its height, mm; before there is one, a height that some candidate exceeds, or minus infinity.
    pub height: f64,
    /// Its number in the part; [`Best::NOBODY`] before there is one.
    pub id: u64,
    /// Where it is touched.
    pub contact: Point,
    /// What holds the cutter up, if that tells something about the facets around it: both ends of an edge, or a
    /// vertex twice; else [`Best::NONE`].
    pub held: [u32; 2],
}

impl Best {
    /// The number of no candidate.
    pub const NOBODY: u64 = u64::MAX;
    /// No vertices.
    pub const NONE: [u32; 2] = [u32::MAX; 2];

    /// Nothing found yet, but known to be above `floor`.
    #[inline(always)]
    pub fn above(floor: f64) -> Self {
        Self {
            height: floor,
            id: Self::NOBODY,
            contact: [0.0; 3],
            held: Self::NONE,
        }
    }

    /// Takes a candidate's touch if it is higher, or as high and first in number; returns whether it did.
    #[inline(always)]
    pub fn raise(&mut self, touch: Touch, id: u64) -> bool {
        let raised = touch.height > self.height || (touch.height == self.height && id < self.id);
        if raised {
            *self = Self {
                height: touch.height,
                id,
                contact: touch.contact,
                held: Self::NONE,
            };
        }
        raised
    }

    /// What heights are counted from, so that single precision tells close ones apart.
    #[inline(always)]
    fn base(&self) -> f64 {
        self.height.max(-1.0e9)
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

/// Up to eight positions that are searched together.
#[derive(Debug)]
pub(crate) struct Batch<'a, S> {
    pub cutter: &'a Cutter,
    pub starts: &'a [Start],
    /// The highest that each of them has found.
    pub best: &'a mut [Best; LANES],
    /// What each of them sees of a leaf.
    pub sights: [S; LANES],
    /// Whether a height that rounding may have put above everything is taken for a floor.
    pub floors: bool,
}

/// A few candidates.
pub(crate) trait Leaf: Sync + Send {
    /// What a position sees of it, before any candidate is evaluated.
    type Sight: Copy + Default;

    /// The highest touch is expected at a place on the cutter, `(d, z)`.
    fn expect(sight: &mut Self::Sight, cutter: &Cutter, pose: &Pose, place: [f64; 2]);

    /// Raises the best of each position that is `alive` to the highest candidate.
    /// Returns how many candidates were evaluated, and the positions that were raised.
    ///
    /// Each step is taken for all positions before the next one: what one of them computes does not wait for
    /// another's branches, which nothing predicts.
    fn search<S: Set>(
        &self,
        simd: S,
        points: &[Point],
        batch: &mut Batch<Self::Sight>,
        alive: Lanes,
    ) -> (u64, Lanes);
}

/// What is far above the rounding of heights about such a one, mm.
#[inline(always)]
fn margin(cutter: &Cutter, pose: &Pose, height: f64) -> f64 {
    MARGIN * (cutter.max_radius() + height.abs() + pose.x.abs())
}

/// That margin, relative to the lengths involved.
const MARGIN: f64 = 1.0e-7;
