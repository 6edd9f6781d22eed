//! Brute force: Algorithm 1 of the 2001 paper, over points with vectors of its own.
//!
//! All points of all rows in one long array for each coordinate, swept from end to end for every
//! position. No bound is used here, so that it checks what the bounds skip.

use std::ops::Range;

use fearless_simd::{Simd, f64x8, prelude::*};

use crate::contact::{Pose, touch_facet};
use crate::cutter::Cutter;
use crate::lanes::{LANES, heights};
use crate::leaf::Best;
use crate::path::Touch;
use crate::record::Counters;
use crate::row::{Facet, Row, facets};
use crate::simd::{Token, with_simd};
use crate::vector::Point;

/// The points of rows, in order of their numbers.
#[derive(Debug)]
pub(crate) struct Sweep {
    at: [Vec<f64>; 3],
    /// y and z of a normal at each point, if those that face away are left out.
    normals: Option<[Vec<f64>; 2]>,
    /// Whether points beyond the cutter's width are left out.
    within_width: bool,
    /// The first candidate of each row, and the place of its point.
    rows: Vec<(u64, usize)>,
}

impl Sweep {
    /// All points; `normals` are one for each or none at all.
    pub fn new(rows: &[Row], normals: &[Point], within_width: bool) -> Self {
        let points: Vec<Point> = rows.iter().flat_map(|r| r.points.iter().copied()).collect();
        // A vector's worth of room behind the last point.
        let axis = |points: &[Point], k: usize, filler: f64| {
            let filler = std::iter::repeat_n(filler, LANES);
            points.iter().map(|p| p[k]).chain(filler).collect()
        };
        let mut start = 0;
        let starts = rows.iter().map(|r| {
            let place = start;
            start += r.points.len();
            (r.candidate(0), place)
        });
        Self {
            rows: starts.collect(),
            at: [
                axis(&points, 0, f64::INFINITY),
                axis(&points, 1, 0.0),
                axis(&points, 2, 0.0),
            ],
            normals: (!normals.is_empty()).then(|| [axis(normals, 1, 0.0), axis(normals, 2, 0.0)]),
            within_width,
        }
    }

    /// Raises `best` to the highest of all points; returns how many were evaluated.
    fn search(&self, simd: Token, cutter: &Cutter, pose: &Pose, best: &mut Best) -> u64 {
        let all = 0..self.at[0].len() - LANES;
        with_simd!(simd, simd => self.search_by(simd, cutter, pose, all, best))
    }

    /// The same for the points at `places`.
    #[inline(always)]
    pub fn search_by<S: Simd>(
        &self,
        simd: S,
        cutter: &Cutter,
        pose: &Pose,
        places: Range<usize>,
        best: &mut Best,
    ) -> u64 {
        let culled = self.within_width || self.normals.is_some();
        let mut evaluated = if culled { 0 } else { places.len() as u64 };
        let nowhere = f64x8::splat(simd, f64::NEG_INFINITY);
        let mut high = nowhere;
        let mut place = f64x8::splat(simd, 0.0);
        let lanes = f64x8::from_fn(simd, |i| i as f64);
        let end = places.end as f64;
        let mut first = places.start;
        while first < places.end {
            let eight = first..first + LANES;
            let x = f64x8::from_slice(simd, &self.at[0][eight.clone()]);
            let y = f64x8::from_slice(simd, &self.at[1][eight.clone()]);
            let z = f64x8::from_slice(simd, &self.at[2][eight.clone()]);
            let index = lanes + first as f64;
            first += LANES;
            let mut wanted = index.simd_lt(end);
            if culled {
                if self.within_width {
                    wanted &= (x - pose.x).abs().simd_le(cutter.half_width());
                }
                if let Some([ny, nz]) = &self.normals {
                    let ny = f64x8::from_slice(simd, &ny[eight.clone()]);
                    let nz = f64x8::from_slice(simd, &nz[eight]);
                    wanted &= (ny * pose.cos - nz * pose.sin).simd_ge(0.0);
                }
                let kept = wanted.to_bitmask().count_ones();
                evaluated += u64::from(kept);
                if kept == 0 {
                    continue;
                }
            }
            let all = wanted.select(heights(simd, cutter, pose, [x, y, z]), nowhere);
            let above = all.simd_gt(high);
            high = above.select(all, high);
            place = above.select(index, place);
        }
        for lane in 0..LANES {
            if high[lane] > f64::NEG_INFINITY && high[lane] >= best.height {
                let at = place[lane] as usize;
                let contact = [self.at[0][at], self.at[1][at], self.at[2][at]];
                let height = high[lane];
                best.raise(Touch { height, contact }, self.number(at));
            }
        }
        evaluated
    }

    /// The number in the part of the point at a place.
    fn number(&self, place: usize) -> u64 {
        let (first, start) = self.rows[self.rows.partition_point(|&(_, s)| s <= place) - 1];
        first + (place - start) as u64
    }
}

/// The highest of all points for each of some poses.
pub(crate) fn run(
    simd: Token,
    cutter: &Cutter,
    sweep: &Sweep,
    poses: impl Iterator<Item = Pose>,
) -> (Vec<Option<Touch>>, Counters) {
    let mut counters = Counters::default();
    let touch = |pose: Pose| {
        let mut best = Best::above(f64::NEG_INFINITY);
        counters.evaluations += sweep.search(simd, cutter, &pose, &mut best);
        best.touch()
    };
    (poses.map(touch).collect(), counters)
}

/// The facets of rows, with their numbers in the part.
#[derive(Debug)]
pub(crate) struct AllFacets(Vec<(u64, [Point; 3])>);

impl AllFacets {
    pub fn new(rows: &[Row]) -> Self {
        let points: Vec<Point> = rows.iter().flat_map(|r| r.points.iter().copied()).collect();
        let facet = |f: Facet| {
            let id = rows[f.row].candidate(f.number);
            (id, f.corners.map(|c| points[c as usize]))
        };
        Self(facets(rows).map(facet).collect())
    }

    /// The highest of all facets for each of some poses.
    pub fn run(
        &self,
        cutter: &Cutter,
        poses: impl Iterator<Item = Pose>,
    ) -> (Vec<Option<Touch>>, Counters) {
        let mut counters = Counters::default();
        let touch = |pose: Pose| {
            let mut best = Best::above(f64::NEG_INFINITY);
            for &(id, corners) in &self.0 {
                if let Some(touch) = touch_facet(cutter, &pose, corners) {
                    best.raise(touch, id);
                }
            }
            counters.evaluations += self.0.len() as u64;
            best.touch()
        };
        (poses.map(touch).collect(), counters)
    }
}
