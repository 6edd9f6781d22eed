//! Slices as vectors: four of their numbers at a time, also where less than four are left.

use fearless_simd::{Simd, f64x4, prelude::*};

/// Numbers at a time.
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
pub(crate) fn four_points<S: Simd>(simd: S, [x, y, z]: [&[f64]; 3], at: usize) -> Four<S> {
    [four(simd, x, at), four(simd, y, at), four(simd, z, at)]
}

#[inline(always)]
pub(crate) fn sub4<S: Simd>(a: Four<S>, b: Four<S>) -> Four<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn dot4<S: Simd>(a: Four<S>, b: Four<S>) -> f64x4<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross4<S: Simd>(a: Four<S>, b: Four<S>) -> Four<S> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
