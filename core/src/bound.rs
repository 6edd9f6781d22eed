//! Upper bounds: how high the cutter can be touched anywhere within a piece of the part.
//!
//! F is concave, so its tangent plane at any place within the reach lies above it everywhere. Taken
//! near the piece, where the cutter is tangent to it, the bound's slack is of second order in the
//! piece's size; taken at the highest touch so far, it rules out whatever lies behind that touch. Out
//! of reach a cylinder around the cutter bounds, to first order. Bounds decide only what is skipped:
//! they need to be safe, not the same everywhere, so they make do with single precision, multiply and add in
//! one step where there is an instruction for it, and have a slack for both.

mod dome;
mod fit;
mod lid;

use fearless_simd::{Simd, f32x8, prelude::*};

use crate::cutter::Cutter;
use crate::lanes::{LANES, slopes};
use crate::tolerance::WELL_WITHIN;

pub(crate) use dome::{Dome, NearDome, Spots};
pub(crate) use lid::{Frame, Lids, Swing, View, lid_bounds};

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

/// Tangent planes of G(d, z) = √(m(d)² − z²), at eight places well within the reach.
struct Slopes<S: Simd> {
    d: f32x8<S>,
    z: f32x8<S>,
    rise: f32x8<S>,
    by_d: f32x8<S>,
    by_z: f32x8<S>,
}

impl<S: Simd> Slopes<S> {
    /// At the places nearest to points seen from the cutter.
    #[inline(always)]
    fn at(simd: S, cutter: &Cutter, [d, _, z]: [f32x8<S>; 3]) -> Self {
        let inside = WELL_WITHIN as f32;
        let w = cutter.half_width() as f32 * inside;
        let d = d.max(-w).min(w);
        // One division for both slopes: √(m² − z²) and, of a torus, √(r² − d²) have a common multiple.
        let (m, root, by_root) = slopes(simd, cutter, d);
        let edge = m * inside;
        let z = z.max(-edge).min(edge);
        let rise = ((m - z) * (m + z)).sqrt();
        let share = f32x8::splat(simd, 1.0) / (root * rise);
        Self {
            d,
            z,
            rise,
            by_d: m * by_root * share,
            by_z: -z * root * share,
        }
    }

    /// The plane's slopes together, the attack axis's own included.
    #[inline(always)]
    fn steep(&self) -> f32x8<S> {
        self.by_d.abs() + self.by_z.abs() + 1.0
    }
}

/// Eight points or vectors.
type Eight<S> = [f32x8<S>; 3];

#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, axes: &[[f32; LANES]; 3]) -> Eight<S> {
    [
        f32x8::from_slice(simd, &axes[0]),
        f32x8::from_slice(simd, &axes[1]),
        f32x8::from_slice(simd, &axes[2]),
    ]
}

/// Scalar products.
#[inline(always)]
fn dot<S: Simd>(a: Eight<S>, b: Eight<S>) -> f32x8<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// Turned about the spindle, then moved.
#[inline(always)]
fn turn<S: Simd>([x, y, z]: Eight<S>, cos: f32, sin: f32, by: [f32; 3]) -> Eight<S> {
    [
        x + by[0],
        y.mul_add(cos, z.mul_add(-sin, f32x8::splat(y.simd, by[1]))),
        y.mul_add(sin, z.mul_add(cos, f32x8::splat(y.simd, by[2]))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Pose;
    use proptest::prelude::*;

    pub(super) fn cutter(which: usize) -> Cutter {
        let cutters = [
            Cutter::torus(40.0, 8.0),
            Cutter::ball(5.0),
            Cutter::cylinder(10.0, 6.0),
            Cutter::cone(10.0, 20.0, 45.0),
        ];
        cutters[which].clone().expect("valid")
    }

    pub(super) fn pose(x: f64, degrees: f64) -> Pose {
        let angle = degrees.to_radians();
        Pose {
            x,
            cos: libm::cos(angle),
            sin: libm::sin(angle),
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
