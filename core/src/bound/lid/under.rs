//! Upper bounds of F under lids, for one position or for several that are close to each other.

use fearless_simd::{Simd, f32x8, mask32x8, prelude::*};

use super::slopes::Slopes;
use super::{Eight, Lids, Swing, View};
use crate::bound::load;
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes, lanes};
use crate::simd::Set;

/// Upper bounds of F under lids for each of `some` positions, minus infinity where nothing can be in reach.
///
/// All take the tangent planes of the one in the middle: each sees the lids turned over these planes, moved to
/// where its own touch is expected.
#[inline(always)]
pub(crate) fn lid_bounds<S: Set>(
    simd: S,
    cutter: &Cutter,
    views: &[View; LANES],
    some: Lanes,
    swing: Swing,
    lids: &Lids,
) -> [f32x8<S>; LANES] {
    simd.piece(
        #[inline(always)]
        || {
            let mut bounds = [f32x8::splat(simd, f32::NEG_INFINITY); LANES];
            let Some(middle) = lanes(some).nth(some.count_ones() as usize / 2) else {
                return bounds;
            };
            let under = Under::new(simd, cutter, &views[middle], swing, lids);
            for lane in lanes(some) {
                bounds[lane] = under.bounds(simd, &views[lane], lids);
            }
            bounds
        },
    )
}

/// Paraboloids over lids that F is nowhere above: `rise + y + by_d·δ + by_z·ζ − bends·(δ², ζ²)/2`, where δ and ζ
/// are counted from where they touch F.
struct Under<S: Simd> {
    slopes: Slopes<S>,
    bends: [f32; 2],
    /// Half the extent of the lids across the cutter's axis.
    half_z: f32x8<S>,
    /// How much F bends down along u, halved.
    bend: f32x8<S>,
    /// What that leaves out.
    loose: f32x8<S>,
    /// How high the cutter's largest circle is over what is within the lids' radii, for all positions.
    circle: f32x8<S>,
    /// Whether the cutter may reach that from any of them.
    near: mask32x8<S>,
}

impl<S: Simd> Under<S> {
    /// That touch F where lids, as `view` has them, come nearest to the highest touch: away from that touch F
    /// falls, and they with it.
    #[inline(always)]
    fn new(simd: S, cutter: &Cutter, view: &View, swing: Swing, lids: &Lids) -> Self {
        let [d, y, z] = view.see(simd, lids);
        let u: Eight<S> = load(simd, &lids.u);
        let vy = f32x8::from_slice(simd, &lids.v[0]);
        let vz = f32x8::from_slice(simd, &lids.v[1]);
        let below = f32x8::from_slice(simd, &lids.below);
        let normal = f32x8::from_slice(simd, &lids.normal[0]);
        let half_d = u[0].abs();
        let half_z =
            (u[1] * view.sin + u[2] * view.cos).abs() + (vy * view.sin + vz * view.cos).abs();
        let near_d = (d - half_d).max(view.place[0]).min(d + half_d);
        let near_z = (z - half_z).max(view.place[1]).min(z + half_z);
        let bends = swing.bends;

        let radius = f32x8::from_slice(simd, &lids.radius) + (y.abs() + z.abs()) * swing.chord;
        let along = f32x8::from_slice(simd, &lids.along) + (swing.travel + view.rounding);
        let around = radius + (cutter.max_radius() as f32 + 2.0 * view.rounding);
        let within = d.abs().simd_le(along + cutter.half_width() as f32);
        Self {
            slopes: Slopes::at(simd, cutter, [near_d, y, near_z]),
            bends,
            half_z,
            // The square of the way along u, without what the way along the normal adds to it.
            bend: half_d * half_d * (0.5 * bends[0]),
            loose: half_d * (below * normal.abs()) * bends[0],
            circle: y + ((around - z) * (around + z)).max(0.0).sqrt() + view.rounding,
            near: within & z.abs().simd_le(around),
        }
    }

    /// Upper bounds for a position.
    #[inline(always)]
    fn bounds(&self, simd: S, view: &View, lids: &Lids) -> f32x8<S> {
        let [d, y, z] = view.see(simd, lids);
        // The paraboloid's tangent plane over the middles along the axis, and across it where the lids come
        // nearest to the highest touch.
        let near_z = (z - self.half_z).max(view.place[1]).min(z + self.half_z);
        let [off_d, off_z] = [d - self.slopes.d, near_z - self.slopes.z];
        let [fall_d, fall_z] = [off_d * self.bends[0], off_z * self.bends[1]];
        let plane = Slopes {
            by_d: self.slopes.by_d - fall_d,
            by_z: self.slopes.by_z - fall_z,
            ..self.slopes
        };
        let away_d = off_d * fall_d.mul_add(0.5, plane.by_d);
        let away_z = (off_z * 0.5).mul_add(fall_z, plane.by_z * (z - self.slopes.z));
        let over = plane.rise_over(simd, view, lids, self.bend) + self.loose;
        let size = away_d.abs() + away_z.abs() + over.abs();
        let lost = size.mul_add(8.0 * f32::EPSILON, plane.steep() * view.rounding);
        let bound = (y + plane.rise) + (away_d + away_z) + (over + lost);
        let nothing = f32x8::splat(simd, f32::NEG_INFINITY);
        self.near.select(bound.min(self.circle), nothing)
    }
}

impl<S: Simd> Slopes<S> {
    /// How far the planes rise over the middles of lids, at most, as a position sees them, where F bends down
    /// along u by twice `bend`.
    #[inline(always)]
    fn rise_over(&self, simd: S, view: &View, lids: &Lids, bend: f32x8<S>) -> f32x8<S> {
        let u: Eight<S> = load(simd, &lids.u);
        let vy = f32x8::from_slice(simd, &lids.v[0]);
        let vz = f32x8::from_slice(simd, &lids.v[1]);
        let normal: Eight<S> = load(simd, &lids.normal);
        let above = f32x8::from_slice(simd, &lids.above);
        let below = f32x8::from_slice(simd, &lids.below);
        // Turned back into the part's frame, the plane's slopes tell how far it rises under a lid.
        let cos = f32x8::splat(simd, view.cos);
        let slope = [
            self.by_d,
            self.by_z.mul_add(view.sin, cos),
            self.by_z * view.cos - view.sin,
        ];
        let by_w = dot(slope, normal);
        let outward = by_w.max(0.0);
        let by_u = dot(slope, u).abs();
        let by_v = slope[1].mul_add(vy, slope[2] * vz).abs();
        let along_u = rise(
            by_u,
            outward.mul_add(f32x8::from_slice(simd, &lids.a), bend),
        );
        let along_v = rise(by_v, outward * f32x8::from_slice(simd, &lids.b));
        along_u + along_v + (by_w * above).max(-by_w * below)
    }
}

/// The most of `by·s − bend·s²` for s in [0, 1]; neither is negative.
#[inline(always)]
fn rise<S: Simd>(by: f32x8<S>, bend: f32x8<S>) -> f32x8<S> {
    let s = (by / (bend + bend).max(1.0e-30)).min(1.0);
    s * (-bend).mul_add(s, by)
}

/// Scalar products.
#[inline(always)]
fn dot<S: Simd>(a: Eight<S>, b: Eight<S>) -> f32x8<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Simd as Level, with_simd};

    #[inline(always)]
    fn rises<S: Simd>(simd: S, by: [f32; 8], bend: [f32; 8]) -> [f32; 8] {
        let [by, bend] = [by, bend].map(|v| f32x8::from_slice(simd, &v));
        *rise(by, bend)
    }

    #[test]
    fn a_rise_is_nowhere_exceeded() {
        let by = [0.0, 0.0, 1.0e-35, 1.0e-6, 1.0, 1.0, 3.0, 3.0];
        let bend = [0.0, 2.0, 1.0e-3, 1.0, 2.0, 0.5, 0.0, 1.0e-35];
        for level in Level::available() {
            let most = with_simd!(level.token(), simd => rises(simd, by, bend));
            for i in 0..=100 {
                let s = i as f32 / 100.0;
                for lane in 0..8 {
                    let at = by[lane] * s - bend[lane] * s * s;
                    assert!(at <= most[lane] + 1.0e-6, "{level}, lane {lane} at {s}");
                }
            }
        }
    }
}
