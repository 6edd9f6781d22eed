//! Slices as vectors: four or eight of their numbers at a time, also where less are left.

use fearless_simd::{Simd, f64x4, f64x8, prelude::*};

use crate::lanes::LANES;

/// Points, a coordinate at a time.
pub(crate) type Axes<'a> = [&'a [f64]; 3];

/// Numbers in a vector of four.
pub(crate) const FOUR: usize = 4;

/// Four points or vectors.
pub(crate) type Four<S> = [f64x4<S>; 3];

/// Four numbers from `at` on; the last one again for those that are not there.
#[inline(always)]
fn four<S: Simd>(simd: S, from: &[f64], at: usize) -> f64x4<S> {
    match from.get(at..at + FOUR) {
        Some(all) => f64x4::from_slice(simd, all),
        None => {
            let mut some = [from[from.len() - 1]; FOUR];
            some[..from.len() - at].copy_from_slice(&from[at..]);
            f64x4::from_slice(simd, &some)
        }
    }
}

/// Four points from `at` on, of points a coordinate at a time.
#[inline(always)]
pub(crate) fn four_points<S: Simd>(simd: S, [x, y, z]: Axes, at: usize) -> Four<S> {
    [four(simd, x, at), four(simd, y, at), four(simd, z, at)]
}

/// Where to begin with eight points at a time: at most at the last eight.
#[inline(always)]
pub(crate) fn eights([x, ..]: Axes) -> impl Iterator<Item = usize> {
    let last = x.len().saturating_sub(LANES);
    (0..x.len()).step_by(LANES).map(
        #[inline(always)]
        move |at| at.min(last),
    )
}

/// Eight points from `at` on, x counted from `origin`; if there are not so many, some again.
#[inline(always)]
pub(crate) fn eight<S: Simd>(simd: S, points: Axes, at: usize, origin: f64) -> [f64x8<S>; 3] {
    let all = points[0].len();
    let mut some = [[0.0; LANES]; 3];
    for (some, from) in some.iter_mut().zip(points) {
        match from.get(at..at + LANES) {
            Some(from) => some.copy_from_slice(from),
            None => (0..LANES).for_each(|i| some[i] = from[i % all]),
        }
    }
    let [x, y, z] = some;
    [
        f64x8::from_slice(simd, &x) - origin,
        f64x8::from_slice(simd, &y),
        f64x8::from_slice(simd, &z),
    ]
}
