//! Lids: pieces of the part as the hierarchy bounds them, eight at a time.

mod fit;
mod slopes;
mod under;
mod view;

use fearless_simd::{Simd, f32x8, f64x8, prelude::*};

use self::fit::{Shape, few};
use crate::lanes::LANES;
use crate::slices::{Axes, eight, eights};
use crate::vector::{Interval, Point, add_scaled, length};

pub(crate) use under::lid_bounds;
pub(crate) use view::{Swing, View};

/// Eight points or vectors.
type Eight<S> = [f32x8<S>; 3];

/// Where the lids of a tree are: what rounding has to be measured by.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    /// The middle of the part along x, from which their x is counted, mm.
    origin: f64,
    /// Largest magnitude of a coordinate counted from there, mm.
    size: f64,
    /// Largest distance from the spindle, mm.
    across: f64,
}

impl Frame {
    /// That of points within `x`, of which the outermost is `across` from the spindle.
    pub fn new(x: Interval, across: f64) -> Self {
        Self {
            origin: (x.low + x.high) / 2.0,
            size: across.max((x.high - x.low) / 2.0),
            across,
        }
    }
}

/// Lids of eight pieces of the part, in single precision. A piece lies over a parallelogram of half-axes u
/// and v, the second square to the spindle; along its normal it stays under a paraboloid, which follows
/// its curvature, and over a floor: for `s`, `t` in [−1, 1]
/// `p = middle + s·u + t·v + w·normal`, `−below ≤ w ≤ above − a·s² − b·t²`. Since `a` and `b` are not negative,
/// what lies between points of the piece is under its lid as well.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(crate) struct Lids {
    middle: [[f32; LANES]; 3],
    u: [[f32; LANES]; 3],
    v: [[f32; LANES]; 2],
    normal: [[f32; LANES]; 3],
    a: [f32; LANES],
    b: [f32; LANES],
    above: [f32; LANES],
    below: [f32; LANES],
    /// Half the extent along the spindle.
    along: [f32; LANES],
    /// Radius about the middle, seen along the spindle.
    radius: [f32; LANES],
}

impl Lids {
    /// Nothing in any lane.
    pub const EMPTY: Self = Self {
        middle: [[f32::INFINITY; LANES], [0.0; LANES], [0.0; LANES]],
        u: [[0.0; LANES]; 3],
        v: [[0.0; LANES]; 2],
        normal: [[0.0; LANES]; 3],
        a: [0.0; LANES],
        b: [0.0; LANES],
        above: [0.0; LANES],
        below: [0.0; LANES],
        along: [0.0; LANES],
        radius: [0.0; LANES],
    };

    /// Puts a snug lid around points, at least one of them, into a lane.
    #[inline(always)]
    pub fn set<'a, S: Simd>(
        &mut self,
        simd: S,
        lane: usize,
        frame: &Frame,
        points: impl Iterator<Item = Axes<'a>> + Clone,
    ) {
        // A few points tell the axes and the curvature well; that the lid holds all is for the rest.
        let (few, count) = few(points.clone());
        let few = &few[..count];
        let Shape { axes, parts, bends } = Shape::of(few);
        let [mut low, mut high] =
            [f64::INFINITY, f64::NEG_INFINITY].map(|end| [f64x8::splat(simd, end); 3]);
        for part in points.clone() {
            for at in eights(part) {
                let p = eight(simd, part, at, frame.origin);
                for k in 0..3 {
                    let along = project(p, parts[k]);
                    (low[k], high[k]) = (low[k].min(along), high[k].max(along));
                }
            }
        }
        let mut middle = [0.0; 3];
        let mut half = [0.0; 3];
        for k in 0..3 {
            let (low, high) = (low[k].reduce_min(), high[k].reduce_max());
            half[k] = (high - low) / 2.0;
            middle = add_scaled(middle, (low + high) / 2.0, axes[k]);
        }
        let inverse = half.map(|h| if h > 0.0 { 1.0 / h } else { 0.0 });
        let [a, b] = [0, 1].map(|k| bends[k] * half[k] * half[k]);
        let none = f64x8::splat(simd, 0.0);
        let (mut above, mut along, mut square) =
            (f64x8::splat(simd, f64::NEG_INFINITY), none, none);
        for part in points {
            for at in eights(part) {
                let [x, y, z] = eight(simd, part, at, frame.origin);
                let r = [x - middle[0], y - middle[1], z - middle[2]];
                let s = project(r, parts[0]) * inverse[0];
                let t = project(r, parts[1]) * inverse[1];
                let w = project(r, parts[2]);
                above = above.max(w + s * s * a + t * t * b);
                along = along.max(r[0].abs());
                square = square.max(r[1] * r[1] + r[2] * r[2]);
            }
        }
        let (above, along, square) = (above.reduce_max(), along.reduce_max(), square.reduce_max());
        // Rounding to single precision moves the middle, turns the axes and shortens them.
        let size = length(middle) + half[0] * length(axes[0]) + half[1] + half[2] + a + b;
        let lost = f64::from(8.0 * f32::EPSILON) * size;
        for k in 0..3 {
            self.middle[k][lane] = middle[k] as f32;
            self.u[k][lane] = (axes[0][k] * half[0]) as f32;
            self.normal[k][lane] = axes[2][k] as f32;
        }
        for k in 0..2 {
            self.v[k][lane] = (axes[1][k + 1] * half[1]) as f32;
        }
        self.a[lane] = a as f32;
        self.b[lane] = b as f32;
        self.above[lane] = (above + lost) as f32;
        self.below[lane] = (half[2] + lost) as f32;
        self.along[lane] = (along + lost) as f32;
        self.radius[lane] = (square.sqrt() + lost) as f32;
    }
}

/// Eight scalar products.
#[inline(always)]
fn project<S: Simd>([x, y, z]: [f64x8<S>; 3], axis: Point) -> f64x8<S> {
    x * axis[0] + y * axis[1] + z * axis[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bound::tests::{cutter, pose};
    use crate::contact::Pose;
    use crate::contact::{touch_facet, touch_point};
    use crate::cutter::Cutter;
    use crate::lanes::{Lanes, lanes};
    use crate::simd::{Set, Simd as Level, with_simd};
    use crate::vector::sub;
    use proptest::prelude::*;

    #[inline(always)]
    fn bounds<S: Set>(
        simd: S,
        cutter: &Cutter,
        views: &[View; LANES],
        some: Lanes,
        swing: Swing,
        lids: &Lids,
    ) -> [[f32; 8]; LANES] {
        let mut bounds = [[0.0; 8]; LANES];
        let all = lid_bounds(simd, cutter, views, some, swing, lids);
        for (one, all) in bounds.iter_mut().zip(all) {
            *one = *all;
        }
        bounds
    }

    /// Points drawn together and moved along the spindle, and a lid over them in the fourth lane.
    fn under_a_lid(points: &[Point], shrink: f64, far: f64) -> (Vec<Point>, Frame, Lids) {
        let points: Vec<Point> = points
            .iter()
            .map(|p| add_scaled(points[0], shrink, sub(*p, points[0])))
            .map(|p| [p[0] + far, p[1], p[2]])
            .collect();
        let across = points.iter().map(|p| p[1].hypot(p[2])).fold(0.0, f64::max);
        let frame = Frame::new(Interval::of(points.iter().map(|p| p[0])), across);
        let axes = [0, 1, 2].map(|k| points.iter().map(|p| p[k]).collect::<Vec<f64>>());
        let parts = std::iter::once(axes.each_ref().map(|axis| &axis[..]));
        let held = Level::available().into_iter().map(|level| {
            let mut held = Lids::EMPTY;
            with_simd!(level.token(), simd => held.set(simd, 3, &frame, parts.clone()));
            held
        });
        let held: Vec<Lids> = held.collect();
        assert!(
            held.iter().all(|h| *h == held[0]),
            "a lid is the same at each level"
        );
        (points, frame, held[0])
    }

    /// What lies on a twisted paraboloid is bounded as closely as if it were level there: within a twentieth of how
    /// far it falls off.
    #[test]
    fn a_lid_is_snug_over_a_twisted_paraboloid() {
        let steps = (-8..=8).map(|i| f64::from(i) / 4.0);
        let across = steps
            .clone()
            .flat_map(|x| steps.clone().map(move |z| [x, z]));
        let fall = |x: f64, z: f64| 0.02 * x * x + 0.03 * z * z + 0.008 * x * z;
        let points: Vec<Point> = across.map(|[x, z]| [x, 30.0 - fall(x, z), z]).collect();
        let (_, frame, held) = under_a_lid(&points, 1.0, 0.0);
        let cutter = cutter(0);
        let views = [View::new(&frame, &cutter, &pose(0.0, 0.0), [0.0; 2]); LANES];
        let swing = Swing::new(&cutter, std::iter::empty());
        let most = 30.0 + cutter.max_radius();
        for level in Level::available() {
            let all =
                with_simd!(level.token(), simd => bounds(simd, &cutter, &views, 1, swing, &held));
            let slack = f64::from(all[0][3]) - most;
            assert!(
                (0.0..fall(2.0, 2.0) / 20.0).contains(&slack),
                "{level}: {slack}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn nothing_under_a_lid_is_touched_above_its_bound(
            points in prop::collection::vec(prop::array::uniform3(-30.0..30.0_f64), 1..20),
            far in prop_oneof![Just(0.0), Just(1.0e3), Just(1.0e5)],
            x in -40.0..40.0_f64,
            degrees in 0..360_i32,
            by in prop_oneof![Just(0.0), Just(0.1), Just(1.0), Just(25.0)],
            step in prop_oneof![Just(0.0), Just(0.005), Just(2.0)],
            some in 1_u64..256,
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.1), Just(0.001), Just(0.0)],
            places in prop::array::uniform8(prop::array::uniform2(-20.0..20.0_f64)),
        ) {
            let cutter = cutter(which);
            let poses: [Pose; LANES] = std::array::from_fn(|k| {
                pose(x + far + step * k as f64, f64::from(degrees) + by * k as f64)
            });
            let (points, frame, held) = under_a_lid(&points, shrink, far);
            let views = std::array::from_fn(|k| View::new(&frame, &cutter, &poses[k], places[k]));
            let swing = Swing::new(&cutter, poses.into_iter());
            for level in Level::available() {
                let all = with_simd!(level.token(), simd => bounds(simd, &cutter, &views, some, swing, &held));
                for lane in lanes(some) {
                    let pose = &poses[lane];
                    let alone = with_simd!(level.token(), simd => {
                        bounds(simd, &cutter, &views, 1 << lane, swing.alone(), &held)
                    });
                    let bound = f64::from(all[lane][3].min(alone[lane][3]));
                    for &p in &points {
                        if let Some(touch) = touch_point(&cutter, pose, p) {
                            prop_assert!(bound >= touch.height, "{level}");
                        }
                    }
                    for corners in points.windows(3) {
                        let corners = [corners[0], corners[1], corners[2]];
                        if let Some(touch) = touch_facet(&cutter, pose, corners) {
                            prop_assert!(bound >= touch.height, "{level}, a facet");
                        }
                    }
                    prop_assert_eq!(all[lane][2], f32::NEG_INFINITY, "nothing is there");
                }
            }
        }
    }
}
