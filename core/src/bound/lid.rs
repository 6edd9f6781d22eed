//! Lids: pieces of the part as the hierarchy bounds them, eight at a time, for one position or for several
//! that are close to each other.

use fearless_simd::{Simd, f32x8, f64x8, mask32x8, prelude::*};

use super::fit::{Shape, few};
use super::{Eight, Slopes, dot, load, turn};
use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes, lanes};
use crate::simd::Set;
use crate::slices::{Axes, eight, eights};
use crate::vector::{Interval, Point, add_scaled, length};

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

/// A position as the bounds of lids see it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    x: f32,
    cos: f32,
    sin: f32,
    /// Where on the cutter, `(d, z)`, the highest touch is expected.
    place: [f32; 2],
    /// What the rounding of a length is proportional to, times the unit of single precision, mm.
    rounding: f32,
}

impl View {
    /// Of lids that lie within `frame`.
    #[inline(always)]
    pub fn new(frame: &Frame, cutter: &Cutter, pose: &Pose, place: [f64; 2]) -> Self {
        let x = pose.x - frame.origin;
        let size = frame.size + x.abs() + cutter.max_radius() + cutter.half_width();
        Self {
            x: x as f32,
            cos: pose.cos as f32,
            sin: pose.sin as f32,
            place: place.map(|c| c as f32),
            // Some ten roundings of half a unit each at most, and as much again.
            rounding: f32::EPSILON * 8.0 * size as f32,
        }
    }

    /// The highest touch is here by now, `(d, z)` on the cutter.
    #[inline(always)]
    pub fn expect(&mut self, place: [f64; 2]) {
        self.place = place.map(|c| c as f32);
    }
}

/// How far positions are from each other, at most, and how their cutter bends between them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Swing {
    /// The longest chord of the angles between them.
    chord: f32,
    /// The longest travel, mm.
    travel: f32,
    /// [`Cutter::least_bends`], which is asked once for all lids.
    bends: [f32; 2],
}

/// How far small lids may move between positions that share their bounds, as a share of the cutter's radii: beyond
/// that one's planes lose more for the others than sharing them saves.
const CLOSE: f32 = 0.5;

impl Swing {
    /// Of some positions.
    #[inline(always)]
    pub fn new(cutter: &Cutter, poses: impl Iterator<Item = Pose>) -> Self {
        let [mut chord, mut travel] = [0.0_f64; 2];
        let mut first = None;
        for pose in poses {
            let from = first.get_or_insert(pose);
            let (c, s) = (pose.cos - from.cos, pose.sin - from.sin);
            chord = chord.max(c * c + s * s);
            travel = travel.max((pose.x - from.x).abs());
        }
        // No two are further apart than both from the first.
        Self {
            chord: 2.0 * chord.sqrt() as f32,
            travel: 2.0 * travel as f32,
            bends: cutter.least_bends().map(|b| b as f32),
        }
    }

    /// Of one of them by itself.
    #[inline(always)]
    pub fn alone(self) -> Self {
        Self {
            chord: 0.0,
            travel: 0.0,
            ..self
        }
    }

    /// Whether positions are close enough for the cutter to share the bounds of small lids.
    #[inline(always)]
    pub fn is_close(self, frame: &Frame) -> bool {
        let [along, across] = self.bends;
        let moved = self.travel * along;
        let turned = self.chord * frame.across as f32 * across;
        // A cutter that does not bend leaves one's planes where they are for all.
        across > 0.0 && moved.max(turned) < CLOSE
    }
}

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
        let u = load(simd, &lids.u);
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

impl View {
    /// The middles of lids, seen from the cutter.
    #[inline(always)]
    fn see<S: Simd>(&self, simd: S, lids: &Lids) -> Eight<S> {
        let middle = load(simd, &lids.middle);
        turn(middle, self.cos, self.sin, [-self.x, 0.0, 0.0])
    }
}

impl<S: Simd> Slopes<S> {
    /// How far the planes rise over the middles of lids, at most, as a position sees them, where F bends down
    /// along u by twice `bend`.
    #[inline(always)]
    fn rise_over(&self, simd: S, view: &View, lids: &Lids, bend: f32x8<S>) -> f32x8<S> {
        let u = load(simd, &lids.u);
        let vy = f32x8::from_slice(simd, &lids.v[0]);
        let vz = f32x8::from_slice(simd, &lids.v[1]);
        let normal = load(simd, &lids.normal);
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

#[cfg(test)]
mod tests {
    use super::super::tests::{cutter, pose};
    use super::*;
    use crate::contact::{touch_facet, touch_point};
    use crate::simd::{Simd as Level, with_simd};
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
