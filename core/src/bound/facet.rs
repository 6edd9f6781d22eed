//! Facets that lie together, bounded eight at a time by planes that touch the cutter near each of them.

use fearless_simd::{Simd, f32x8, prelude::*};

use super::{Plane, Slopes, add_scaled, cross, turn};
use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::supports;
use crate::tolerance::BOUND_SLACK;
use crate::vector::{Point, dot, length, sub};

/// Facets that lie together as their bounds see them: from a middle on, and heights from a base on.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Near {
    cos: f32,
    sin: f32,
    middle: [f32; 3],
    /// What single precision may take from a height, or add to it, where the planes are level, mm.
    pub rounding: f32,
}

impl Near {
    /// Around a middle seen from the cutter, whose height is counted from the base; no facet extends
    /// further from it than `size` along any axis.
    #[inline(always)]
    pub fn new(cutter: &Cutter, pose: &Pose, middle: Point, size: f32) -> Self {
        let far = cutter.max_radius() + middle[1].abs() + cutter.half_width();
        Self {
            cos: pose.cos as f32,
            sin: pose.sin as f32,
            middle: middle.map(|c| c as f32),
            rounding: 8.0 * f32::EPSILON * (far as f32 + 2.0 * size),
        }
    }

    /// A plane that F does not exceed, from the base on.
    #[inline(always)]
    pub fn roof(&self, plane: &Plane, pose: &Pose, middle: Point, base: f64) -> Roof {
        let height = dot(plane.slope, middle) + plane.height - base;
        let [a, b, c] = plane.slope;
        let steep = a.abs() + b.abs() + c.abs();
        let size = length(middle) + pose.x.abs();
        let lost = BOUND_SLACK * (steep * size + plane.height.abs() + base.abs());
        Roof {
            slope: plane.slope.map(|c| c as f32),
            height: height as f32
                + self.rounding * steep as f32
                + f32::EPSILON * height.abs() as f32
                + lost as f32,
        }
    }
}

/// A [`Plane`] as the bounds of facets see it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Roof {
    slope: [f32; 3],
    height: f32,
}

impl Roof {
    /// How high above the base it is, at most, over a corner of each of eight facets.
    #[inline(always)]
    pub fn over<S: Simd>(&self, _: S, corner: [f32x8<S>; 3]) -> f32x8<S> {
        let [a, b, c] = self.slope;
        let [x, y, z] = corner;
        x.mul_add(a, y.mul_add(b, z.mul_add(c, self.height)))
    }
}

/// Upper bounds of F over eight facets, from the base on, minus infinity where nothing can be in reach.
/// Each is the tangent plane where the facet comes nearest to the cutter: it is highest at a corner, and
/// so the place is moved once towards that corner.
#[inline(always)]
pub(crate) fn facet_bounds<S: Simd>(
    simd: S,
    cutter: &Cutter,
    near: &Near,
    corners: &[[f32x8<S>; 3]; 3],
) -> f32x8<S> {
    let a = turn(corners[0], near.cos, near.sin, near.middle);
    let b = turn(corners[1], near.cos, near.sin, near.middle);
    let c = turn(corners[2], near.cos, near.sin, near.middle);
    let (ab, ac) = (sub(b, a), sub(c, a));
    let n = cross(ab, ac);
    let down = n[1].simd_lt(0.0);
    let up = [
        down.select(-n[0], n[0]),
        n[1].abs(),
        down.select(-n[2], n[2]),
    ];
    let (d, z) = supports(simd, cutter, up);
    // Where the support point falls, as weights of the edges, moved to the facet if it is beside it.
    let (d, z) = (d - a[0], z - a[2]);
    let one = f32x8::splat(simd, 1.0);
    let tilt = one / n[1];
    let s = weight(simd, z.mul_sub(ac[0], d * ac[2]) * tilt);
    let t = weight(simd, d.mul_sub(ab[2], z * ab[0]) * tilt);
    let excess = (s + t - one).max(0.0) * 0.5;
    let s = (s - excess).max(0.0).min(one);
    let t = (t - excess).max(0.0).min(one);
    let start = add_scaled(add_scaled(a, s, ab), t, ac);

    let first = Slopes::at(simd, cutter, start);
    let [over_a, over_b, over_c] = first.over([a, b, c]);
    let over_ab = over_a.max(over_b);
    let b_wins = over_b.simd_gt(over_a);
    let c_wins = over_c.simd_gt(over_ab);
    let highest = [
        c_wins.select(c[0], b_wins.select(b[0], a[0])),
        c_wins.select(c[1], b_wins.select(b[1], a[1])),
        c_wins.select(c[2], b_wins.select(b[2], a[2])),
    ];
    // F's slope towards that corner, here and there, tells about where it vanishes.
    let way = sub(highest, start);
    let here = first.along(way);
    let there = Slopes::at(simd, cutter, highest).along(way);
    let share = here / (here - there);
    let share = share
        .simd_ge(0.0)
        .select(share, f32x8::splat(simd, 0.0))
        .min(one);
    let second = Slopes::at(simd, cutter, add_scaled(start, share, way));

    let first = first.steep().mul_add(near.rounding, over_ab.max(over_c));
    let [over_a, over_b, over_c] = second.over([a, b, c]);
    let over = over_a.max(over_b).max(over_c);
    let second = second.steep().mul_add(near.rounding, over);
    let w = cutter.half_width() as f32 + near.rounding;
    let low = a[0].min(b[0]).min(c[0]);
    let high = a[0].max(b[0]).max(c[0]);
    let within = low.simd_le(w) & high.simd_ge(-w);
    within.select(first.min(second), f32x8::splat(simd, f32::NEG_INFINITY))
}

/// A weight that may be anything where a facet stands upright.
#[inline(always)]
fn weight<S: Simd>(simd: S, w: f32x8<S>) -> f32x8<S> {
    let third = f32x8::splat(simd, 1.0 / 3.0);
    w.abs().simd_le(1.0e9).select(w, third).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::super::tests::{cutter, pose};
    use super::*;
    use crate::contact::touch_facet;
    use crate::simd::{Set, Simd as Level, with_simd};
    use crate::vector::{add_scaled, sub};
    use proptest::prelude::*;

    #[inline(always)]
    fn facets<S: Set>(
        simd: S,
        cutter: &Cutter,
        near: &Near,
        corners: &[[[f32; 8]; 3]; 3],
    ) -> [f32; 8] {
        let corners = [
            load(simd, &corners[0]),
            load(simd, &corners[1]),
            load(simd, &corners[2]),
        ];
        simd.piece(
            #[inline(always)]
            || *facet_bounds(simd, cutter, near, &corners),
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn a_facet_is_not_touched_above_its_bound(
            corners in prop::array::uniform3(prop::array::uniform3(-30.0..30.0_f64)),
            x in -40.0..40.0_f64,
            degrees in 0..360_i32,
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.01), Just(0.0)],
            above in -5.0..5.0_f64,
        ) {
            let cutter = cutter(which);
            let pose = pose(x, f64::from(degrees));
            let corners = corners.map(|p| add_scaled(corners[0], shrink, sub(p, corners[0])));
            let Some(touch) = touch_facet(&cutter, &pose, corners) else {
                return Ok(());
            };
            let base = touch.height + above;
            let middle = corners[1];
            let size = corners.iter().flat_map(|&p| sub(p, middle)).fold(0.0, |a: f64, c| a.max(c.abs()));
            let [d, y, z] = pose.face(middle);
            let near = Near::new(&cutter, &pose, [d, y - base, z], size as f32);
            let plane = Plane::at(&cutter, &pose, [above, 2.0 * above]);
            let roof = near.roof(&plane, &pose, middle, base);
            let lanes = corners.map(|p| sub(p, middle).map(|c| [c as f32; 8]));
            for level in Level::available() {
                let bounds = with_simd!(level.token(), simd => facets(simd, &cutter, &near, &lanes));
                let over = lanes.map(|lanes| {
                    let over = with_simd!(level.token(), simd => *roof.over(simd, load(simd, &lanes)));
                    base + f64::from(over[5])
                });
                prop_assert!(base + f64::from(bounds[5]) >= touch.height, "{level}");
                prop_assert!(over.iter().any(|&over| over >= touch.height), "{level}");
            }
        }
    }
}
