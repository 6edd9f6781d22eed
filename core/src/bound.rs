//! Upper bounds: how high the cutter can be touched anywhere within a piece of the part.
//!
//! F is concave, so its tangent plane at any place within the reach lies above it everywhere. Taken
//! near the piece, where the cutter is tangent to it, the bound's slack is of second order in the
//! piece's size; taken at the highest touch so far, it rules out whatever lies behind that touch. Out
//! of reach a cylinder around the cutter bounds, to first order. Bounds decide only what is skipped:
//! they need to be safe, not the same everywhere, so they make do with single precision and
//! a slack for it.

use fearless_simd::{Simd, f32x8, mask32x8, prelude::*};
use nalgebra::{Matrix3, Vector3};

use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::lanes::{LANES, slopes, supports};
use crate::tolerance::{BOUND_SLACK, WELL_WITHIN};
use crate::vector::{Interval, Point, add_scaled, cross, dot, length, sub, unit};

/// A plane that F nowhere exceeds, as a linear function of the part's points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plane {
    /// Its slopes along x, y and z of the part.
    pub slope: Point,
    /// Its height at the origin, mm.
    pub height: f64,
}

impl Plane {
    /// The tangent plane at a place on the cutter, `(d, z)`.
    #[inline(always)]
    pub fn at(cutter: &Cutter, pose: &Pose, [d, z]: [f64; 2]) -> Self {
        let t = Tangent::near(cutter, d, z);
        Self {
            slope: [
                t.by_d,
                pose.cos + pose.sin * t.by_z,
                pose.cos * t.by_z - pose.sin,
            ],
            height: t.rise - t.by_d * (pose.x + t.d) - t.by_z * t.z,
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
#[derive(Debug, Clone, Copy)]
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

    /// Puts a snug lid around points into a lane.
    pub fn set(&mut self, lane: usize, frame: &Frame, points: &[Point]) {
        let origin = [frame.origin, 0.0, 0.0];
        // A few points tell the axes and the curvature well; that the lid holds all is for the rest.
        let some = || points.iter().copied().step_by(points.len().div_ceil(FIT));
        let axes = axes(some());
        let mut ranges = [Interval::EMPTY; 3];
        for &p in points {
            for (range, &axis) in ranges.iter_mut().zip(&axes) {
                let along = dot(sub(p, origin), axis);
                range.low = range.low.min(along);
                range.high = range.high.max(along);
            }
        }
        let half = ranges.map(|r| (r.high - r.low) / 2.0);
        let mut middle = [0.0; 3];
        for (range, &axis) in ranges.iter().zip(&axes) {
            middle = add_scaled(middle, (range.low + range.high) / 2.0, axis);
        }
        let inverse = half.map(|h| if h > 0.0 { 1.0 / h } else { 0.0 });
        let local = |p: Point| {
            let r = sub(sub(p, origin), middle);
            let (s, t) = (dot(r, axes[0]) * inverse[0], dot(r, axes[1]) * inverse[1]);
            (s * s, t * t, dot(r, axes[2]), r)
        };
        let (a, b) = paraboloid(some().map(|p| {
            let (s, t, w, _) = local(p);
            (s, t, w)
        }));
        let (mut above, mut along, mut square) = (f64::NEG_INFINITY, 0.0_f64, 0.0_f64);
        for &p in points {
            let (s, t, w, [x, y, z]) = local(p);
            above = above.max(w + a * s + b * t);
            along = along.max(x.abs());
            square = square.max(y * y + z * z);
        }
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

/// Points that a lid is fitted to.
const FIT: usize = 64;

/// The curvatures a and b of the paraboloid `w₀ − a·s² − b·t²` that fits points `(s², t², w)` best.
fn paraboloid(points: impl Iterator<Item = (f64, f64, f64)>) -> (f64, f64) {
    let mut n = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (s, t, w) in points {
        let row = Vector3::new(1.0, s, t);
        n += row * row.transpose();
        right += row * w;
    }
    // A single line of points has no curvature across it.
    n += Matrix3::identity() * (1.0e-6 * n[(0, 0)]);
    let fit = n.try_inverse().map(|inverse| inverse * right);
    fit.filter(|f| f.iter().all(|c| c.is_finite()))
        .map_or((0.0, 0.0), |f| (-f[1], -f[2]))
}

/// Axes that fit points: a direction that leans towards the spindle, one that is square to the spindle,
/// and the normal, away from the spindle.
fn axes(points: impl Iterator<Item = Point> + Clone) -> [Point; 3] {
    let (mut count, mut sum) = (0.0, [0.0; 3]);
    for p in points.clone() {
        count += 1.0;
        sum = add_scaled(sum, 1.0, p);
    }
    let mean = sum.map(|s| s / count);
    // Second moments, as the six numbers of a symmetric matrix.
    let mut m = [0.0; 6];
    for p in points {
        let [x, y, z] = sub(p, mean);
        m = [
            m[0] + x * x,
            m[1] + x * y,
            m[2] + x * z,
            m[3] + y * y,
            m[4] + y * z,
            m[5] + z * z,
        ];
    }
    let normal = flattest(m);
    let outward = normal[1] * mean[1] + normal[2] * mean[2] >= 0.0;
    let normal = if outward { normal } else { normal.map(|c| -c) };
    let x = [1.0, 0.0, 0.0];
    let u = unit(add_scaled(x, -normal[0], normal)).unwrap_or([0.0, 1.0, 0.0]);
    let v = cross(normal, u);
    // Square to the spindle but for rounding; the box has no room for more.
    match unit([0.0, v[1], v[2]]) {
        Some(v) => [cross(v, normal), v, normal],
        None => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    }
}

/// The direction in which points with these second moments extend least; any if there is no such.
fn flattest(m: [f64; 6]) -> Point {
    // The adjugate's greatest direction is the matrix's least, and squaring makes it prevail.
    let mut a = m;
    for round in 0..5 {
        let size = a[0].abs().max(a[3].abs()).max(a[5].abs());
        if !(size > 0.0 && size.is_finite()) {
            return [0.0, 1.0, 0.0];
        }
        let [xx, xy, xz, yy, yz, zz] = a.map(|c| c / size);
        a = if round == 0 {
            [
                yy * zz - yz * yz,
                xz * yz - xy * zz,
                xy * yz - xz * yy,
                xx * zz - xz * xz,
                xy * xz - xx * yz,
                xx * yy - xy * xy,
            ]
        } else {
            [
                xx * xx + xy * xy + xz * xz,
                xx * xy + xy * yy + xz * yz,
                xx * xz + xy * yz + xz * zz,
                xy * xy + yy * yy + yz * yz,
                xy * xz + yy * yz + yz * zz,
                xz * xz + yz * yz + zz * zz,
            ]
        };
    }
    let [xx, xy, xz, yy, yz, zz] = a;
    let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let longest = if xx >= yy && xx >= zz {
        0
    } else if yy >= zz {
        1
    } else {
        2
    };
    unit(columns[longest]).unwrap_or([0.0, 1.0, 0.0])
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
pub(crate) fn lid_bounds<S: Simd>(
    simd: S,
    cutter: &Cutter,
    view: &View,
    place: [f32; 2],
    lids: &Lids,
) -> f32x8<S> {
    let under = Under::new(simd, cutter, view, place, lids);
    let z = under.middle[2];
    let circle = under.circle(under.radius);
    let near = under.near(under.radius, z, 0.0);
    near.select(
        under.tangent.min(circle),
        f32x8::splat(simd, f32::NEG_INFINITY),
    )
}

/// How up to eight positions differ from the first of them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Swing {
    /// Of the angle between them the sine, 1 less the cosine and the chord, and the travel, mm.
    by: [[f32; 4]; LANES],
    /// The longest chord and the longest travel.
    most: [f32; 2],
}

impl Swing {
    /// Of these poses.
    #[inline(always)]
    pub fn new(poses: impl Iterator<Item = Pose> + Clone) -> Self {
        let mut swing = Self {
            by: [[0.0; 4]; LANES],
            most: [0.0; 2],
        };
        let Some(from) = poses.clone().next() else {
            return swing;
        };
        for (by, to) in swing.by.iter_mut().zip(poses) {
            let sin = to.sin * from.cos - to.cos * from.sin;
            let (c, s) = (to.cos - from.cos, to.sin - from.sin);
            let square = c * c + s * s;
            let travel = to.x - from.x;
            *by = [sin, 0.5 * square, square.sqrt(), travel].map(|n| n as f32);
            swing.most = [swing.most[0].max(by[2]), swing.most[1].max(by[3].abs())];
        }
        swing
    }
}

/// Upper bounds of F under lids for each of several positions, from what the first of them sees: its
/// tangent planes are as good for the others, to which the lids are turned.
#[inline(always)]
pub(crate) fn swung_lid_bounds<S: Simd>(
    simd: S,
    cutter: &Cutter,
    view: &View,
    swing: &Swing,
    place: [f32; 2],
    lids: &Lids,
) -> [f32x8<S>; LANES] {
    let under = Under::new(simd, cutter, view, place, lids);
    let [_, y, z] = under.middle;
    let [chord, travel] = swing.most;
    let radius = under.radius + (y.abs() + z.abs()) * chord;
    let circle = under.circle(radius);
    let near = under.near(radius, z, travel);
    let Slopes { by_d, by_z, .. } = under.slopes;
    // Turned by δ, a middle rises over its plane by sin δ·forth − (1 − cos δ)·back, and whatever is about
    // it by a chord of δ times its radius more, at most.
    let forth = by_z * y - z;
    let back = by_z * z + y;
    let about = (by_z.abs() + 1.0) * under.radius;
    let nothing = f32x8::splat(simd, f32::NEG_INFINITY);
    let mut bounds = [nothing; LANES];
    for (bound, by) in bounds.iter_mut().zip(&swing.by) {
        let &[sin, versine, chord, travel] = by;
        let tangent =
            under.tangent + (forth * sin - back * versine - by_d * travel + about * chord);
        // As much again is for the rounding of these few.
        *bound = near.select((tangent + under.lost).min(circle), nothing);
    }
    bounds
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
        let normal = load(simd, &lids.normal);
        let above = f32x8::from_slice(simd, &lids.above);
        let below = f32x8::from_slice(simd, &lids.below);
        let [d, y, z] = turn(middle, view.cos, view.sin, [-view.x, 0.0, 0.0]);
        // The tangent plane where the box comes nearest to the highest touch: away from that touch F
        // falls, and the plane with it.
        let half_d = u[0].abs();
        let half_z =
            (u[1] * view.sin + u[2] * view.cos).abs() + (vy * view.sin + vz * view.cos).abs();
        let near_d = (d - half_d).max(place[0]).min(d + half_d);
        let near_z = (z - half_z).max(place[1]).min(z + half_z);
        let slopes = Slopes::at(simd, cutter, [near_d, y, near_z]);
        // Turned back into the part's frame, the plane's slopes tell how far it rises under a lid.
        let slope = [
            slopes.by_d,
            slopes.by_z * view.sin + view.cos,
            slopes.by_z * view.cos - view.sin,
        ];
        let by_w = dot3(slope, normal);
        let outward = by_w.max(0.0);
        let along_u = rise(
            simd,
            dot3(slope, u).abs(),
            outward * f32x8::from_slice(simd, &lids.a),
        );
        let by_v = (slope[1] * vy + slope[2] * vz).abs();
        let along_v = rise(simd, by_v, outward * f32x8::from_slice(simd, &lids.b));
        let over = along_u + along_v + (by_w * above).max(-by_w * below);
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

/// The most of `by·s − bend·s²` for s in [0, 1].
#[inline(always)]
fn rise<S: Simd>(simd: S, by: f32x8<S>, bend: f32x8<S>) -> f32x8<S> {
    let s = (by / (bend + bend).max(1.0e-30)).min(1.0);
    // What bends outward is highest at its end, even where it starts out level and `s` would be 0.
    let s = bend.simd_lt(0.0).select(f32x8::splat(simd, 1.0), s);
    s * (by - bend * s)
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

/// Turned about the spindle, then moved.
#[inline(always)]
fn turn<S: Simd>([x, y, z]: Eight<S>, cos: f32, sin: f32, by: [f32; 3]) -> Eight<S> {
    [
        x + by[0],
        y * cos - z * sin + by[1],
        y * sin + z * cos + by[2],
    ]
}

#[inline(always)]
fn sub3<S: Simd>(a: Eight<S>, b: Eight<S>) -> Eight<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot3<S: Simd>(a: Eight<S>, b: Eight<S>) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + s·b`.
#[inline(always)]
fn add3<S: Simd>(a: Eight<S>, s: f32x8<S>, b: Eight<S>) -> Eight<S> {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// Facets that lie together as their bounds see them: from a middle on, and heights from a base on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Near {
    cos: f32,
    sin: f32,
    middle: [f32; 3],
    rounding: f32,
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
    /// How high above the base it is over the highest corner of each of eight facets.
    #[inline(always)]
    pub fn above<S: Simd>(&self, _: S, corners: [[f32x8<S>; 3]; 3]) -> f32x8<S> {
        let [a, b, c] = self.slope;
        let [p, q, r] = corners;
        let p = p[0] * a + p[1] * b + p[2] * c;
        let q = q[0] * a + q[1] * b + q[2] * c;
        let r = r[0] * a + r[1] * b + r[2] * c;
        p.max(q).max(r) + self.height
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
    corners: [[f32x8<S>; 3]; 3],
) -> f32x8<S> {
    let a = turn(corners[0], near.cos, near.sin, near.middle);
    let b = turn(corners[1], near.cos, near.sin, near.middle);
    let c = turn(corners[2], near.cos, near.sin, near.middle);
    let (ab, ac) = (sub3(b, a), sub3(c, a));
    let n = [
        ab[1] * ac[2] - ab[2] * ac[1],
        ab[2] * ac[0] - ab[0] * ac[2],
        ab[0] * ac[1] - ab[1] * ac[0],
    ];
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
    let s = weight(simd, (z * ac[0] - d * ac[2]) * tilt);
    let t = weight(simd, (d * ab[2] - z * ab[0]) * tilt);
    let excess = (s + t - one).max(0.0) * 0.5;
    let s = (s - excess).max(0.0).min(one);
    let t = (t - excess).max(0.0).min(one);
    let start = add3(add3(a, s, ab), t, ac);

    let first = Slopes::at(simd, cutter, start);
    let (over_a, over_b, over_c) = (first.over(a), first.over(b), first.over(c));
    let over_ab = over_a.max(over_b);
    let b_wins = over_b.simd_gt(over_a);
    let c_wins = over_c.simd_gt(over_ab);
    let highest = [
        c_wins.select(c[0], b_wins.select(b[0], a[0])),
        c_wins.select(c[1], b_wins.select(b[1], a[1])),
        c_wins.select(c[2], b_wins.select(b[2], a[2])),
    ];
    // F's slope towards that corner, here and there, tells about where it vanishes.
    let way = sub3(highest, start);
    let here = first.along(way);
    let there = Slopes::at(simd, cutter, highest).along(way);
    let share = here / (here - there);
    let share = share
        .simd_ge(0.0)
        .select(share, f32x8::splat(simd, 0.0))
        .min(one);
    let second = Slopes::at(simd, cutter, add3(start, share, way));

    let first = over_ab.max(over_c) + first.steep() * near.rounding;
    let over = second.over(a).max(second.over(b)).max(second.over(c));
    let second = over + second.steep() * near.rounding;
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

    /// F's upper bound at a point seen from the cutter.
    #[inline(always)]
    fn over(&self, p: [f32x8<S>; 3]) -> f32x8<S> {
        p[1] + self.rise + self.by_d * (p[0] - self.d) + self.by_z * (p[2] - self.z)
    }

    /// The plane's slopes together, the attack axis's own included.
    #[inline(always)]
    fn steep(&self) -> f32x8<S> {
        self.by_d.abs() + self.by_z.abs() + 1.0
    }

    /// F's slope along a way.
    #[inline(always)]
    fn along(&self, way: [f32x8<S>; 3]) -> f32x8<S> {
        way[1] + self.by_d * way[0] + self.by_z * way[2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{touch_facet, touch_point};
    use crate::simd::{Simd as Level, with_simd};
    use proptest::prelude::*;

    #[inline(always)]
    fn lids<S: Simd>(
        simd: S,
        cutter: &Cutter,
        view: &View,
        place: [f32; 2],
        lids: &Lids,
    ) -> [f32; 8] {
        *lid_bounds(simd, cutter, view, place, lids)
    }

    #[inline(always)]
    fn swung<S: Simd>(
        simd: S,
        cutter: &Cutter,
        view: &View,
        swing: &Swing,
        place: [f32; 2],
        lids: &Lids,
    ) -> [[f32; 8]; LANES] {
        let mut bounds = [[0.0; 8]; LANES];
        let all = swung_lid_bounds(simd, cutter, view, swing, place, lids);
        for (one, all) in bounds.iter_mut().zip(all) {
            *one = *all;
        }
        bounds
    }

    #[inline(always)]
    fn facets<S: Simd>(
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
        *facet_bounds(simd, cutter, near, corners)
    }

    fn cutter(which: usize) -> Cutter {
        let cutters = [
            Cutter::torus(40.0, 8.0),
            Cutter::ball(5.0),
            Cutter::cylinder(10.0, 6.0),
            Cutter::cone(10.0, 20.0, 45.0),
        ];
        cutters[which].clone().expect("valid")
    }

    fn pose(x: f64, degrees: i32) -> Pose {
        let angle = f64::from(degrees).to_radians();
        Pose {
            x,
            cos: libm::cos(angle),
            sin: libm::sin(angle),
        }
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
            let most = with_simd!(level, simd => rises(simd, by, bend));
            for i in 0..=100 {
                let s = i as f32 / 100.0;
                for lane in 0..8 {
                    let at = by[lane] * s - bend[lane] * s * s;
                    assert!(at <= most[lane] + 1.0e-6, "{level}, lane {lane} at {s}");
                }
            }
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
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.1), Just(0.001), Just(0.0)],
            place in prop::array::uniform2(-20.0..20.0_f32),
        ) {
            let cutter = cutter(which);
            let pose = pose(x + far, degrees);
            let points: Vec<Point> = points
                .iter()
                .map(|p| add_scaled(points[0], shrink, sub(*p, points[0])))
                .map(|p| [p[0] + far, p[1], p[2]])
                .collect();
            let across = points.iter().map(|p| p[1].hypot(p[2])).fold(0.0, f64::max);
            let frame = Frame::new(Interval::of(points.iter().map(|p| p[0])), across);
            let mut held = Lids::EMPTY;
            held.set(3, &frame, &points);
            let view = View::new(&frame, &cutter, &pose);
            for level in Level::available() {
                let bounds = with_simd!(level, simd => lids(simd, &cutter, &view, place, &held));
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
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.1), Just(0.001), Just(0.0)],
            place in prop::array::uniform2(-20.0..20.0_f32),
        ) {
            let cutter = cutter(which);
            let poses: [Pose; LANES] = std::array::from_fn(|k| {
                let angle = (f64::from(degrees) + by * k as f64).to_radians();
                let x = x + far + step * k as f64;
                Pose { x, cos: libm::cos(angle), sin: libm::sin(angle) }
            });
            let points: Vec<Point> = points
                .iter()
                .map(|p| add_scaled(points[0], shrink, sub(*p, points[0])))
                .map(|p| [p[0] + far, p[1], p[2]])
                .collect();
            let across = points.iter().map(|p| p[1].hypot(p[2])).fold(0.0, f64::max);
            let frame = Frame::new(Interval::of(points.iter().map(|p| p[0])), across);
            let mut held = Lids::EMPTY;
            held.set(3, &frame, &points);
            let view = View::new(&frame, &cutter, &poses[0]);
            let swing = Swing::new(poses.into_iter());
            for level in Level::available() {
                let bounds = with_simd!(level, simd => swung(simd, &cutter, &view, &swing, place, &held));
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
            let pose = pose(x, degrees);
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
                let bounds = with_simd!(level, simd => facets(simd, &cutter, &near, &lanes));
                let under = with_simd!(level, simd => {
                    let corners = [load(simd, &lanes[0]), load(simd, &lanes[1]), load(simd, &lanes[2])];
                    *roof.above(simd, corners)
                });
                prop_assert!(base + f64::from(bounds[5]) >= touch.height, "{level}");
                prop_assert!(base + f64::from(under[5]) >= touch.height, "{level}");
            }
        }
    }
}
