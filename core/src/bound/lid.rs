//! Lids: pieces of the part as the hierarchy bounds them, eight at a time, for one position or for several
//! that are close to each other.

use fearless_simd::{Simd, f32x8, f64x8, mask32x8, prelude::*};

use super::fit::{axes, few, paraboloid};
use super::{Eight, Slopes, load, turn};
use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::LANES;
use crate::simd::Set;
use crate::slices::{Axes, eight, eights};
use crate::vector::{Interval, Point, add_scaled, dot, length, sub};

/// Where the lids of a tree are: what rounding has to be measured by.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    /// The middle of the part along x, from which their x is counted, mm.
    origin: f64,
    /// Largest magnitude of a coordinate counted from there, mm.
    size: f64,
}

impl Frame {
    /// That of points within `x`, of which the outermost is `across` from the spindle.
    pub fn new(x: Interval, across: f64) -> Self {
        Self {
            origin: (x.low + x.high) / 2.0,
            size: across.max((x.high - x.low) / 2.0),
        }
    }
}

/// Lids of eight pieces of the part, in single precision. A piece lies over a rectangle of half-axes u
/// and v, the second square to the spindle; along its normal it stays under a paraboloid, which follows
/// its curvature, and over a floor: for `s`, `t` in [−1, 1]
/// `p = middle + s·u + t·v + w·normal`, `−below ≤ w ≤ above − a·s² − b·t²`.
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
        let axes = axes(few.iter().copied());
        let [mut low, mut high] =
            [f64::INFINITY, f64::NEG_INFINITY].map(|end| [f64x8::splat(simd, end); 3]);
        for part in points.clone() {
            for at in eights(part) {
                let p = eight(simd, part, at, frame.origin);
                for k in 0..3 {
                    let along = project(p, axes[k]);
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
        let (a, b) = paraboloid(few.iter().map(|&[x, y, z]| {
            let r = sub([x - frame.origin, y, z], middle);
            let (s, t) = (dot(r, axes[0]) * inverse[0], dot(r, axes[1]) * inverse[1]);
            (s * s, t * t, dot(r, axes[2]))
        }));
        let none = f64x8::splat(simd, 0.0);
        let (mut above, mut along, mut square) =
            (f64x8::splat(simd, f64::NEG_INFINITY), none, none);
        for part in points {
            for at in eights(part) {
                let [x, y, z] = eight(simd, part, at, frame.origin);
                let r = [x - middle[0], y - middle[1], z - middle[2]];
                let s = project(r, axes[0]) * inverse[0];
                let t = project(r, axes[1]) * inverse[1];
                let w = project(r, axes[2]);
                above = above.max(w + s * s * a + t * t * b);
                along = along.max(r[0].abs());
                square = square.max(r[1] * r[1] + r[2] * r[2]);
            }
        }
        let (above, along, square) = (above.reduce_max(), along.reduce_max(), square.reduce_max());
        // Rounding to single precision moves the middle, turns the axes and shortens them.
        let size = length(middle) + half[0] + half[1] + half[2] + a.abs() + b.abs();
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

/// A position as the bounds of lids see it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    x: f32,
    cos: f32,
    sin: f32,
    /// What the rounding of a length is proportional to, times the unit of single precision, mm.
    rounding: f32,
}

impl View {
    /// Of lids that lie within `frame`.
    #[inline(always)]
    pub fn new(frame: &Frame, cutter: &Cutter, pose: &Pose) -> Self {
        let x = pose.x - frame.origin;
        let size = frame.size + x.abs() + cutter.max_radius() + cutter.half_width();
        Self {
            x: x as f32,
            cos: pose.cos as f32,
            sin: pose.sin as f32,
            // Some ten roundings of half a unit each at most, and as much again.
            rounding: f32::EPSILON * 8.0 * size as f32,
        }
    }
}

/// Upper bounds of F under lids, minus infinity where nothing can be in reach. `place` is where on the
/// cutter, `(d, z)`, the highest touch is expected.
#[inline(always)]
pub(crate) fn lid_bounds<S: Set>(
    simd: S,
    cutter: &Cutter,
    view: &View,
    place: [f32; 2],
    lids: &Lids,
) -> f32x8<S> {
    simd.piece(
        #[inline(always)]
        || Under::new(simd, cutter, view, place, lids).bounds(simd),
    )
}

/// How far up to eight positions are from one of them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Swing {
    /// The longest chord of the angles between them, and the longest travel, mm.
    most: [f32; 2],
}

impl Swing {
    /// Of these poses.
    #[inline(always)]
    pub fn new(from: &Pose, poses: impl Iterator<Item = Pose>) -> Self {
        let mut most = [0.0_f64; 2];
        for to in poses {
            let (c, s) = (to.cos - from.cos, to.sin - from.sin);
            most[0] = most[0].max(c * c + s * s);
            most[1] = most[1].max((to.x - from.x).abs());
        }
        Self {
            most: [most[0].sqrt() as f32, most[1] as f32],
        }
    }
}

/// Upper bounds of F under lids for each of several positions, by the tangent planes of one of them: each
/// sees the lids turned over the same planes, which F falls below where they have moved away.
#[inline(always)]
pub(crate) fn swung_lid_bounds<S: Set>(
    simd: S,
    cutter: &Cutter,
    views: &[View; LANES],
    from: usize,
    swing: &Swing,
    place: [f32; 2],
    lids: &Lids,
) -> [f32x8<S>; LANES] {
    simd.piece(
        #[inline(always)]
        || {
            let under = Under::new(simd, cutter, &views[from], place, lids);
            under.swung_bounds(simd, views, swing, lids)
        },
    )
}

/// Lids as one position sees them.
struct Under<'a, S: Simd> {
    cutter: &'a Cutter,
    rounding: f32,
    middle: Eight<S>,
    along: f32x8<S>,
    radius: f32x8<S>,
    slopes: Slopes<S>,
    /// How high the tangent plane is over them, at most.
    tangent: f32x8<S>,
    /// Of which this much is for rounding.
    lost: f32x8<S>,
}

impl<'a, S: Simd> Under<'a, S> {
    #[inline(always)]
    fn new(simd: S, cutter: &'a Cutter, view: &View, place: [f32; 2], lids: &Lids) -> Self {
        let middle = load(simd, &lids.middle);
        let u = load(simd, &lids.u);
        let vy = f32x8::from_slice(simd, &lids.v[0]);
        let vz = f32x8::from_slice(simd, &lids.v[1]);
        let [d, y, z] = turn(middle, view.cos, view.sin, [-view.x, 0.0, 0.0]);
        // The tangent plane where the box comes nearest to the highest touch: away from that touch F
        // falls, and the plane with it.
        let half_d = u[0].abs();
        let half_z =
            (u[1] * view.sin + u[2] * view.cos).abs() + (vy * view.sin + vz * view.cos).abs();
        let near_d = (d - half_d).max(place[0]).min(d + half_d);
        let near_z = (z - half_z).max(place[1]).min(z + half_z);
        let slopes = Slopes::at(simd, cutter, [near_d, y, near_z]);
        let over = slopes.rise_over(simd, view, lids);
        let away_d = slopes.by_d * (d - slopes.d);
        let away_z = slopes.by_z * (z - slopes.z);
        let tangent = y + slopes.rise + away_d + away_z + over;
        let lost = slopes.steep() * view.rounding
            + (away_d.abs() + away_z.abs() + over.abs()) * (8.0 * f32::EPSILON);
        Self {
            cutter,
            rounding: view.rounding,
            middle: [d, y, z],
            along: f32x8::from_slice(simd, &lids.along),
            radius: f32x8::from_slice(simd, &lids.radius),
            slopes,
            tangent: tangent + lost,
            lost,
        }
    }

    /// Upper bounds for that position.
    #[inline(always)]
    fn bounds(&self, simd: S) -> f32x8<S> {
        let circle = self.circle(self.radius);
        let near = self.near(self.radius, self.middle[2], 0.0);
        let nothing = f32x8::splat(simd, f32::NEG_INFINITY);
        near.select(self.tangent.min(circle), nothing)
    }

    /// Upper bounds for others that are no further away than `swing` says.
    #[inline(always)]
    fn swung_bounds(
        &self,
        simd: S,
        views: &[View; LANES],
        swing: &Swing,
        lids: &Lids,
    ) -> [f32x8<S>; LANES] {
        let [_, y, z] = self.middle;
        let [chord, travel] = swing.most;
        let radius = self.radius + (y.abs() + z.abs()) * chord;
        let circle = self.circle(radius);
        let near = self.near(radius, z, travel);
        let bend = 0.5 * self.cutter.least_bend() as f32;
        let middle = load(simd, &lids.middle);
        let nothing = f32x8::splat(simd, f32::NEG_INFINITY);
        let mut bounds = [nothing; LANES];
        for (bound, view) in bounds.iter_mut().zip(views) {
            let seen = turn(middle, view.cos, view.sin, [-view.x, 0.0, 0.0]);
            let over = self.slopes.over(seen) + self.slopes.rise_over(simd, view, lids);
            let away = ((seen[2] - self.slopes.z).abs() - self.radius).max(0.0);
            let tangent = over - away * away * bend;
            // As much again is for the rounding of these few.
            *bound = near.select((tangent + self.lost * 2.0).min(circle), nothing);
        }
        bounds
    }

    /// Whether the cutter may reach what is within a radius about the middles, seen along the spindle,
    /// from up to `travel` away.
    #[inline(always)]
    fn near(&self, radius: f32x8<S>, z: f32x8<S>, travel: f32) -> mask32x8<S> {
        let w = self.cutter.half_width() as f32 + self.rounding + travel;
        let around = radius + (self.cutter.max_radius() as f32 + 2.0 * self.rounding);
        self.middle[0].abs().simd_le(self.along + w) & z.abs().simd_le(around)
    }

    /// How high the cutter's largest circle is over what is within a radius about the middles.
    #[inline(always)]
    fn circle(&self, radius: f32x8<S>) -> f32x8<S> {
        let [_, y, z] = self.middle;
        let around = radius + (self.cutter.max_radius() as f32 + self.rounding);
        y + ((around - z) * (around + z)).max(0.0).sqrt() + self.rounding
    }
}

impl<S: Simd> Slopes<S> {
    /// How far the planes rise over the middles of lids, at most, as a position sees them.
    #[inline(always)]
    fn rise_over(&self, simd: S, view: &View, lids: &Lids) -> f32x8<S> {
        let u = load(simd, &lids.u);
        let vy = f32x8::from_slice(simd, &lids.v[0]);
        let vz = f32x8::from_slice(simd, &lids.v[1]);
        let normal = load(simd, &lids.normal);
        let above = f32x8::from_slice(simd, &lids.above);
        let below = f32x8::from_slice(simd, &lids.below);
        // Turned back into the part's frame, the plane's slopes tell how far it rises under a lid.
        let slope = [
            self.by_d,
            self.by_z * view.sin + view.cos,
            self.by_z * view.cos - view.sin,
        ];
        let by_w = dot(slope, normal);
        let outward = by_w.max(0.0);
        let along_u = rise(
            simd,
            dot(slope, u).abs(),
            outward * f32x8::from_slice(simd, &lids.a),
        );
        let by_v = (slope[1] * vy + slope[2] * vz).abs();
        let along_v = rise(simd, by_v, outward * f32x8::from_slice(simd, &lids.b));
        along_u + along_v + (by_w * above).max(-by_w * below)
    }
}

/// The most of `by·s − bend·s²` for s in [0, 1].
#[inline(always)]
fn rise<S: Simd>(simd: S, by: f32x8<S>, bend: f32x8<S>) -> f32x8<S> {
    let s = (by / (bend + bend).max(1.0e-30)).min(1.0);
    // What bends outward is highest at its end, even where it starts out level and `s` would be 0.
    let s = bend.simd_lt(0.0).select(f32x8::splat(simd, 1.0), s);
    s * (by - bend * s)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{cutter, pose};
    use super::*;
    use crate::contact::touch_point;
    use crate::simd::{Simd as Level, with_simd};
    use proptest::prelude::*;

    #[inline(always)]
    fn lids<S: Set>(
        simd: S,
        cutter: &Cutter,
        view: &View,
        place: [f32; 2],
        lids: &Lids,
    ) -> [f32; 8] {
        *lid_bounds(simd, cutter, view, place, lids)
    }

    #[inline(always)]
    fn swung<S: Set>(
        simd: S,
        cutter: &Cutter,
        views: &[View; LANES],
        from: usize,
        swing: &Swing,
        place: [f32; 2],
        lids: &Lids,
    ) -> [[f32; 8]; LANES] {
        let mut bounds = [[0.0; 8]; LANES];
        let all = swung_lid_bounds(simd, cutter, views, from, swing, place, lids);
        for (one, all) in bounds.iter_mut().zip(all) {
            *one = *all;
        }
        bounds
    }

    #[inline(always)]
    fn rises<S: Simd>(simd: S, by: [f32; 8], bend: [f32; 8]) -> [f32; 8] {
        let [by, bend] = [by, bend].map(|v| f32x8::from_slice(simd, &v));
        *rise(simd, by, bend)
    }

    #[test]
    fn a_rise_is_nowhere_exceeded() {
        let by = [0.0, 0.0, 1.0e-35, 1.0e-6, 1.0, 1.0, 0.0, 3.0];
        let bend = [-2.0, 2.0, -1.0e-3, -1.0, 2.0, -0.5, 0.0, 1.0e-35];
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn nothing_under_a_lid_is_touched_above_its_bound(
            points in prop::collection::vec(prop::array::uniform3(-30.0..30.0_f64), 1..20),
            far in prop_oneof![Just(0.0), Just(1.0e3), Just(1.0e5)],
            x in -40.0..40.0_f64,
            degrees in 0..360_i32,
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.1), Just(0.001), Just(0.0)],
            place in prop::array::uniform2(-20.0..20.0_f32),
        ) {
            let cutter = cutter(which);
            let pose = pose(x + far, f64::from(degrees));
            let (points, frame, held) = under_a_lid(&points, shrink, far);
            let view = View::new(&frame, &cutter, &pose);
            for level in Level::available() {
                let bounds = with_simd!(level.token(), simd => lids(simd, &cutter, &view, place, &held));
                for &p in &points {
                    if let Some(touch) = touch_point(&cutter, &pose, p) {
                        prop_assert!(f64::from(bounds[3]) >= touch.height, "{level}");
                    }
                }
                prop_assert_eq!(bounds[2], f32::NEG_INFINITY, "nothing is there");
            }
        }

        #[test]
        fn nothing_under_a_lid_is_touched_above_its_bound_from_positions_nearby(
            points in prop::collection::vec(prop::array::uniform3(-30.0..30.0_f64), 1..20),
            far in prop_oneof![Just(0.0), Just(1.0e3), Just(1.0e5)],
            x in -40.0..40.0_f64,
            degrees in 0..360_i32,
            by in prop_oneof![Just(0.0), Just(0.1), Just(1.0), Just(25.0)],
            step in prop_oneof![Just(0.0), Just(0.005), Just(2.0)],
            from in 0..LANES,
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.1), Just(0.001), Just(0.0)],
            place in prop::array::uniform2(-20.0..20.0_f32),
        ) {
            let cutter = cutter(which);
            let poses: [Pose; LANES] = std::array::from_fn(|k| {
                pose(x + far + step * k as f64, f64::from(degrees) + by * k as f64)
            });
            let (points, frame, held) = under_a_lid(&points, shrink, far);
            let views = poses.map(|pose| View::new(&frame, &cutter, &pose));
            let swing = Swing::new(&poses[from], poses.into_iter());
            for level in Level::available() {
                let bounds = with_simd!(level.token(), simd => swung(simd, &cutter, &views, from, &swing, place, &held));
                for (pose, bounds) in poses.iter().zip(bounds) {
                    for &p in &points {
                        if let Some(touch) = touch_point(&cutter, pose, p) {
                            prop_assert!(f64::from(bounds[3]) >= touch.height, "{level}");
                        }
                    }
                    prop_assert_eq!(bounds[2], f32::NEG_INFINITY, "nothing is there");
                }
            }
        }
    }
}
