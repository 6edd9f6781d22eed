//! Brute force over points: Algorithm 1 of the 2001 paper, with vectors of its own.
//!
//! All points of all rows in one long array for each coordinate, swept from end to end for every
//! position. No bound is used here, so that it checks what the bounds skip.

use fearless_simd::{Simd, f64x8, prelude::*};

use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::{LANES, heights};
use crate::leaf::Best;
use crate::path::Touch;
use crate::row::Row;
use crate::vector::Point;

/// The points of rows, in order of their numbers.
#[derive(Debug)]
pub(crate) struct Sweep {
    at: [Vec<f64>; 3],
    /// Ids of the rows and the places at which their points end.
    rows: Vec<(u32, usize)>,
    count: usize,
}

impl Sweep {
    pub fn new(rows: &[Row]) -> Self {
        let points = || rows.iter().flat_map(|r| &r.points);
        let count = points().count();
        let padded = count.next_multiple_of(LANES);
        let axis = |k: usize, filler: f64| {
            let mut axis: Vec<f64> = points().map(|p| p[k]).collect();
            axis.resize(padded, filler);
            axis
        };
        let mut end = 0;
        let ends = rows.iter().map(|r| {
            end += r.points.len();
            (r.id, end)
        });
        Self {
            rows: ends.collect(),
            at: [axis(0, f64::INFINITY), axis(1, 0.0), axis(2, 0.0)],
            count,
        }
    }

    /// The highest of all points, and how many they are.
    #[inline(always)]
    pub fn search<S: Simd>(&self, simd: S, cutter: &Cutter, pose: &Pose, best: &mut Best) -> u64 {
        let mut high = f64x8::splat(simd, f64::NEG_INFINITY);
        let mut place = f64x8::splat(simd, 0.0);
        let mut index = f64x8::from_fn(simd, |i| i as f64);
        let [xs, ys, zs] = &self.at;
        let chunks = xs
            .chunks_exact(LANES)
            .zip(ys.chunks_exact(LANES))
            .zip(zs.chunks_exact(LANES));
        for ((x, y), z) in chunks {
            let load = |axis: &[f64]| f64x8::from_slice(simd, axis);
            let all = heights(simd, cutter, pose, [load(x), load(y), load(z)]);
            let above = all.simd_gt(high);
            high = above.select(all, high);
            place = above.select(index, place);
            index += LANES as f64;
        }
        for lane in 0..LANES {
            let touch = |place: usize| Touch {
                height: high[lane],
                contact: self.point(place),
            };
            if high[lane] > f64::NEG_INFINITY {
                let at = place[lane] as usize;
                best.raise(touch(at), self.number(at));
            }
        }
        self.count as u64
    }

    fn point(&self, place: usize) -> Point {
        [self.at[0][place], self.at[1][place], self.at[2][place]]
    }

    fn number(&self, place: usize) -> u64 {
        let row = self.rows.partition_point(|&(_, end)| end <= place);
        let begin = row.checked_sub(1).map_or(0, |before| self.rows[before].1);
        u64::from(self.rows[row].0) << 32 | (place - begin) as u64
    }
}
