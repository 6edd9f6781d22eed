//! Paraboloids that F nowhere exceeds, and how high they are over facets, sixteen at a time.
//!
//! F lies below its tangent plane by no less than the cutter bends, so a paraboloid that bends as much bounds it
//! far closer than the plane does. It is seen from the middle of a leaf, and heights are counted from
//! about where they matter: so single precision loses no more than a share of the leaf's size.

use fearless_simd::{Simd, f32x16, prelude::*};

use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::tolerance::{BOUND_SLACK, WELL_WITHIN};
use crate::vector::{Point, dot};

/// A paraboloid that touches F at one place on the cutter.
///
/// Over a way `(δ, ζ)` from there F lies below its tangent plane by [`Cutter::least_bends`] of a torus. A cone's
/// G = √(m² − z²) lies below its own, T = (m₀·m − z₀·z)/G₀, by (T² − G²)/(T + G). There T² − G² is the square
/// of w = (m₀·ζ − z₀·m′·δ)/G₀, G is no more than the largest radius, and T no more than (m₀ + |z₀|)/G₀ times that.
/// For a torus w is ζ.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Dome {
    /// How the tangent plane slopes along x, y and z of the part, and its height at the origin, mm.
    slope: Point,
    height: f64,
    /// Where it touches F along the spindle, and across the cutter's axis.
    at: [f64; 2],
    /// w as its parts of δ and ζ.
    w: [f64; 2],
    /// What the squares of δ and w are multiplied by.
    bends: [f64; 2],
}

impl Dome {
    /// The place is `(d, z)`.
    #[inline(always)]
    pub fn at(cutter: &Cutter, pose: &Pose, [d, z]: [f64; 2]) -> Self {
        let t = Tangent::near(cutter, d, z);
        let x = pose.x + t.d;
        let (w, bends) = match *cutter {
            Cutter::Torus { .. } => {
                let [along, across] = cutter.least_bends();
                ([0.0, 1.0], [0.5 * along, 0.5 * across])
            }
            Cutter::Cone { radius, slope, .. } => {
                let m = radius + t.d * slope;
                let most = cutter.max_radius() * (1.0 + (m + t.z.abs()) / t.rise);
                ([-t.z * slope / t.rise, m / t.rise], [0.0, 1.0 / most])
            }
        };
        Self {
            slope: [
                t.by_d,
                pose.cos + pose.sin * t.by_z,
                pose.cos * t.by_z - pose.sin,
            ],
            height: t.rise - t.by_d * x - t.by_z * t.z,
            at: [x, t.z],
            w,
            bends,
        }
    }

    /// As it is seen from a middle, which no point that is asked for is further from than `size` along any axis, and
    /// from a base height on.
    #[inline(always)]
    pub fn near(&self, pose: &Pose, middle: Point, size: f32, base: f64) -> NearDome {
        let [x, y, z] = middle;
        let across = y * pose.sin + z * pose.cos;
        let [by_d, by_z] = self.w;
        let off_d = x - self.at[0];
        let off_w = by_d * off_d + by_z * (across - self.at[1]);
        let height = dot(self.slope, middle) + self.height - base;

        let [a, b, c] = self.slope.map(f64::abs);
        let far = a * x.abs() + b * y.abs() + c * z.abs() + self.height.abs() + base.abs();
        let size = f64::from(size);
        let d = off_d.abs() + size;
        let w = off_w.abs() + (by_d.abs() + 2.0 * by_z) * size;
        let bent = self.bends[0] * d * d + self.bends[1] * w * w;
        let near = (a + b + c) * size + height.abs() + bent;
        let lost = BOUND_SLACK * far + f64::from(16.0 * f32::EPSILON) * near;
        NearDome {
            slope: self.slope.map(|c| c as f32),
            height: (height + lost) as f32,
            off: [off_d as f32, off_w as f32],
            w: [by_d, by_z * pose.sin, by_z * pose.cos].map(|c| c as f32),
            bends: self.bends.map(|b| b as f32),
        }
    }
}

/// The tangent plane of G(d, z) = √(m(d)² − z²).
struct Tangent {
    d: f64,
    z: f64,
    rise: f64,
    by_d: f64,
    by_z: f64,
}

impl Tangent {
    /// At the place nearest to `(d, z)` that is well within the reach, where the slopes are finite.
    #[inline(always)]
    fn near(cutter: &Cutter, d: f64, z: f64) -> Self {
        let w = cutter.half_width();
        let d = d.clamp(-WELL_WITHIN * w, WELL_WITHIN * w);
        let (m, growth) = match *cutter {
            Cutter::Torus {
                major_radius,
                minor_radius,
            } => {
                let root = ((minor_radius - d) * (minor_radius + d)).sqrt();
                (major_radius + root, -d / root)
            }
            Cutter::Cone { radius, slope, .. } => (radius + d * slope, slope),
        };
        let z = z.clamp(-WELL_WITHIN * m, WELL_WITHIN * m);
        let rise = ((m - z) * (m + z)).sqrt();
        Self {
            d,
            z,
            rise,
            by_d: m * growth / rise,
            by_z: -z / rise,
        }
    }
}

/// A [`Dome`] as points around a middle see it, all that rounding may take added to it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct NearDome {
    slope: [f32; 3],
    height: f32,
    /// δ and w of the middle.
    off: [f32; 2],
    /// w as its parts of x, y and z.
    w: [f32; 3],
    /// What the squares of δ and w are multiplied by.
    bends: [f32; 2],
}

/// Sixteen points under a dome: how high it is over each, and their δ and w.
pub(crate) struct Spots<S: Simd> {
    pub height: f32x16<S>,
    pub d: f32x16<S>,
    pub w: f32x16<S>,
}

impl NearDome {
    /// Whether it is level along one direction, as a cone is along its rulings: so it does not fall off beyond the
    /// cutter's ends, and over a facet it is highest on an edge.
    #[inline(always)]
    pub fn is_level(&self) -> bool {
        self.bends[0] == 0.0
    }

    /// Sixteen points under it, and how high the tangent plane is over each.
    #[inline(always)]
    pub fn over<S: Simd>(&self, simd: S, [x, y, z]: [f32x16<S>; 3]) -> (Spots<S>, f32x16<S>) {
        let [a, b, c] = self.slope;
        let plane = x.mul_add(
            a,
            y.mul_add(b, z.mul_add(c, f32x16::splat(simd, self.height))),
        );
        let d = x + self.off[0];
        let [a, b, c] = self.w;
        let w = x.mul_add(
            a,
            y.mul_add(b, z.mul_add(c, f32x16::splat(simd, self.off[1]))),
        );
        let height = plane - self.bend(d, w);
        (Spots { height, d, w }, plane)
    }

    /// How far it bends down over a way.
    #[inline(always)]
    fn bend<S: Simd>(&self, d: f32x16<S>, w: f32x16<S>) -> f32x16<S> {
        (d * self.bends[0]).mul_add(d, w * w * self.bends[1])
    }

    /// How much higher than over its corners it can be over a facet, the squares of whose edges along the spindle
    /// and across it are at most these.
    #[inline(always)]
    pub fn sag(&self, [along, across]: [f32; 2]) -> f32 {
        let [a, b, c] = self.w;
        // Twice the squares of the two parts are no less than that of their sum.
        let parts = if a == 0.0 { 1.0 } else { 2.0 };
        let w = parts * (a * a * along + (b * b + c * c) * across);
        SAG * (self.bends[0] * along + self.bends[1] * w)
    }

    /// How high it is over each of sixteen facets at most, given their corners.
    #[inline(always)]
    pub fn summits<S: Simd>(&self, simd: S, [a, b, c]: &[Spots<S>; 3]) -> f32x16<S> {
        let ab = self.bend(b.d - a.d, b.w - a.w);
        let ac = self.bend(c.d - a.d, c.w - a.w);
        let bc = self.bend(c.d - b.d, c.w - b.w);
        let edges = crest(a.height, b.height, ab).max(crest(a.height, c.height, ac));
        let edges = edges.max(crest(b.height, c.height, bc));
        if self.is_level() {
            return edges;
        }
        // From corner a it is a + s·g + t·h − s²·ab − t²·ac − s·t·k, which is highest where its slopes vanish.
        let (g, h) = (b.height - a.height + ab, c.height - a.height + ac);
        let k = ab + ac - bc;
        let (two_ab, two_ac) = (ab + ab, ac + ac);
        let square = two_ab * two_ac;
        let whole = square - k * k;
        let share = f32x16::splat(simd, 1.0) / whole;
        let s = two_ac.mul_sub(g, k * h) * share;
        let t = two_ab.mul_sub(h, k * g) * share;
        let along_s = s * (-ab).mul_add(s, g);
        let along_t = t * (-ac).mul_add(t, (-k).mul_add(s, h));
        let top = a.height + along_s + along_t;
        // Beside the facet that is still above all of it, so that rounding may take it for inside.
        let inside = s.min(t).simd_ge(-0.01) & (s + t).simd_le(1.01);
        let exact = inside.select(edges.max(top), edges);
        // Seen along an edge a facet has no inside that can be told.
        let corners = a.height.max(b.height).max(c.height);
        let rough = ab.max(ac).max(bc).mul_add(SAG, corners);
        let told = whole.simd_gt(square * 1.0e-3);
        told.select(exact, rough)
    }
}

/// Between corners with weights u, v and w a paraboloid is u·v·ab + u·w·ac + v·w·bc above the plane through it
/// over these, ab, ac and bc being how far it bends down over the edges: a third of the most, and a little for
/// rounding.
const SAG: f32 = 0.334;

/// The most of a parabola between its values at two ends, if it bends down by `bend` from one end to the other.
#[inline(always)]
fn crest<S: Simd>(a: f32x16<S>, b: f32x16<S>, bend: f32x16<S>) -> f32x16<S> {
    let rise = (bend - (a - b).abs()).max(0.0);
    rise * rise / (bend * 4.0).max(1.0e-30) + a.max(b)
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

    /// Bounds of sixteen facets: by their summits, by their corners and a sag, and by the plane.
    #[inline(always)]
    fn bounds<S: Set>(
        simd: S,
        near: &NearDome,
        corners: &[[[f32; 16]; 3]; 3],
        edge: [f32; 2],
    ) -> [[f32; 16]; 3] {
        simd.piece(
            #[inline(always)]
            || {
                let [(a, over_a), (b, over_b), (c, over_c)] = [
                    near.over(simd, load(simd, &corners[0])),
                    near.over(simd, load(simd, &corners[1])),
                    near.over(simd, load(simd, &corners[2])),
                ];
                let highest = a.height.max(b.height).max(c.height);
                let sagged = highest + near.sag(edge);
                let plane = over_a.max(over_b).max(over_c);
                [*near.summits(simd, &[a, b, c]), *sagged, *plane]
            },
        )
    }

    /// Where a wheel is level, small facets are bounded to a few nanometres: over their inside, an edge and a corner.
    #[test]
    fn a_summit_is_close() {
        let cutter = cutter(0);
        let pose = pose(0.0, 0.0);
        let dome = Dome::at(&cutter, &pose, [0.0; 2]);
        for [x, z] in [[-0.1, -0.1], [-0.2, 0.0], [0.01, 0.01]] {
            let corners = [[x, 10.0, z], [x + 0.4, 10.0, z], [x, 10.0, z + 0.4]];
            let touch = touch_facet(&cutter, &pose, corners)
                .expect("in reach")
                .height;
            let near = dome.near(&pose, corners[0], 0.4, touch);
            let lanes = corners.map(|p| sub(p, corners[0]).map(|c| [c as f32; 16]));
            for level in Level::available() {
                let all =
                    with_simd!(level.token(), simd => bounds(simd, &near, &lanes, [0.16, 0.16]));
                assert!((0.0..5.0e-6).contains(&all[0][3]), "{level}: {:?}", all[0]);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn a_facet_is_not_touched_above_a_dome(
            corners in prop::array::uniform3(prop::array::uniform3(-30.0..30.0_f64)),
            x in -40.0..40.0_f64,
            degrees in 0..360_i32,
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.1), Just(0.001), Just(0.0)],
            above in -5.0..5.0_f64,
            place in prop::array::uniform2(-20.0..20.0_f64),
        ) {
            let cutter = cutter(which);
            let pose = pose(x, f64::from(degrees));
            let corners = corners.map(|p| add_scaled(corners[0], shrink, sub(p, corners[0])));
            let Some(touch) = touch_facet(&cutter, &pose, corners) else {
                return Ok(());
            };
            let base = touch.height + above;
            let middle = corners[1];
            let ways = [0, 1, 2].map(|k| sub(corners[k], corners[(k + 1) % 3]).map(|c| c as f32));
            let edge = [0, 1].map(|k| {
                let square = |w: [f32; 3]| [w[0] * w[0], w[1] * w[1] + w[2] * w[2]][k];
                ways.map(square).into_iter().fold(0.0, f32::max)
            });
            let all = corners.map(|p| sub(p, middle).map(|c| c as f32));
            let size = all.iter().flatten().fold(0.0, |a: f32, c| a.max(c.abs()));
            let lanes = all.map(|p| p.map(|c| [c; 16]));
            // Where it is touched, and anywhere.
            let [d, _, z] = pose.face(touch.contact);
            for place in [[d, z], place] {
                let near = Dome::at(&cutter, &pose, place).near(&pose, middle, size, base);
                for level in Level::available() {
                    let all = with_simd!(level.token(), simd => bounds(simd, &near, &lanes, edge));
                    let [summits, sagged, plane] = all.map(|a| base + f64::from(a[5]));
                    prop_assert!(summits >= touch.height, "{level}: {}", touch.height - summits);
                    prop_assert!(sagged >= touch.height && plane >= touch.height, "{level}");
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn a_cutter_bends_away_from_its_tangent_planes(
            places in prop::array::uniform2(prop::array::uniform2(-1.0..1.0_f64)),
            which in 0..4_usize,
        ) {
            let cutter = cutter(which);
            let [from, to] = places.map(|[d, z]| {
                let d = d * cutter.half_width();
                let m = cutter.profile(d).expect("within the width");
                (d, z * m, m)
            });
            let t = Tangent::near(&cutter, from.0, from.1);
            let (off_d, off_z) = (to.0 - t.d, to.1 - t.z);
            let plane = t.rise + t.by_d * off_d + t.by_z * off_z;
            let [by_d, by_z] = cutter.least_bends();
            let below = (by_d * off_d * off_d + by_z * off_z * off_z) / 2.0;
            let (_, z, m) = to;
            let rise = ((m - z) * (m + z)).sqrt();
            prop_assert!(rise <= plane - below + 1.0e-9, "{rise} over {plane} - {below}");
        }
    }
}
