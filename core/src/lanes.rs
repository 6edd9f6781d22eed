//! Contact with points, eight at a time.
//!
//! The same sequence of + − × ÷ √ as `touch_point` in `contact`, lane by lane, so that the heights
//! are the same bits. Nothing is multiplied and added in one step, and nothing depends on the other
//! lanes.

use fearless_simd::{Simd, f64x8, mask64x8, prelude::*};

use crate::contact::Pose;
use crate::cutter::Cutter;

/// Lanes of a vector.
pub(crate) const LANES: usize = 8;

/// Some lanes of a vector, or of several side by side: a bit for each.
pub(crate) type Lanes = u64;

/// Their numbers, the lowest first.
#[inline(always)]
pub(crate) fn lanes(mut some: Lanes) -> impl Iterator<Item = usize> {
    std::iter::from_fn(
        #[inline(always)]
        move || {
            let lane = (some != 0).then(|| some.trailing_zeros() as usize);
            some &= some.wrapping_sub(1);
            lane
        },
    )
}

/// m(d) of eight distances, and which of them are within the width.
#[inline(always)]
fn radii<S: Simd>(simd: S, cutter: &Cutter, d: f64x8<S>) -> (f64x8<S>, mask64x8<S>) {
    match *cutter {
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let q = f64x8::splat(simd, minor_radius * minor_radius) - d * d;
            (q.sqrt() + major_radius, q.simd_ge(0.0))
        }
        Cutter::Cone {
            radius,
            width,
            slope,
            ..
        } => (d * slope + radius, d.abs().simd_le(width / 2.0)),
    }
}

/// Heights at which the cutter touches eight points; minus infinity out of reach.
#[inline(always)]
pub(crate) fn heights<S: Simd>(
    simd: S,
    cutter: &Cutter,
    pose: &Pose,
    [x, y, z]: [f64x8<S>; 3],
) -> f64x8<S> {
    let d = x - pose.x;
    let across = y * pose.sin + z * pose.cos;
    let (m, within) = radii(simd, cutter, d);
    let rise = ((m - across) * (m + across)).sqrt();
    let height = (y * pose.cos - z * pose.sin) + rise;
    let reached = within & across.abs().simd_le(m);
    reached.select(height, f64x8::splat(simd, f64::NEG_INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::touch_point;
    use crate::simd::{Simd as Level, with_simd};
    use crate::vector::Point;
    use proptest::prelude::*;

    #[inline(always)]
    fn eight<S: Simd>(simd: S, cutter: &Cutter, pose: &Pose, points: &[Point; 8]) -> [f64; 8] {
        let axis = |k: usize| f64x8::from_fn(simd, |i| points[i][k]);
        *heights(simd, cutter, pose, [axis(0), axis(1), axis(2)])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn eight_heights_are_the_bits_of_one_each(
            points in prop::array::uniform8(prop::array::uniform3(-60.0..60.0_f64)),
            x in -40.0..40.0_f64,
            degrees in 0..360_i32,
            which in 0..4_usize,
        ) {
            let cutter = [
                Cutter::torus(40.0, 8.0),
                Cutter::ball(15.0),
                Cutter::cylinder(30.0, 36.0),
                Cutter::cone(10.0, 20.0, 45.0),
            ][which].clone().expect("valid");
            let angle = f64::from(degrees).to_radians();
            let pose = Pose { x, cos: libm::cos(angle), sin: libm::sin(angle) };
            for level in Level::available() {
                let all = with_simd!(level.token(), simd => eight(simd, &cutter, &pose, &points));
                for (p, height) in points.iter().zip(all) {
                    let one = touch_point(&cutter, &pose, *p).map_or(f64::NEG_INFINITY, |t| t.height);
                    prop_assert_eq!(one.to_bits(), height.to_bits());
                }
            }
        }
    }
}
