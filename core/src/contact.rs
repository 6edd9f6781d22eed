//! Contact: at which height the cutter touches one point or one facet.
//!
//! Seen from the cutter, a part point at axial distance d and at y′, z′ is touched when the cutter's
//! centre stands at `F = y′ + √(m(d)² − z′²)` (eqs. 1, 2 and 5 of the 2001 paper, read as heights).
//! The cutter is convex, so F is concave over its reach, and the touch on a facet is where the
//! cutter's support point for the facet's normal falls, else on an edge, else at a corner.
//!
//! A height is one fixed sequence of + − × ÷ √ of the facet's corners and the position; nothing here
//! may depend on who else is searched. `bound` holds what may.

use crate::cutter::Cutter;
use crate::path::Touch;
use crate::tolerance::EDGE_SEARCH;
use crate::vector::{Point, add_scaled, cross, length, sub};

/// Where part and cutter stand at one position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Travel, mm.
    pub x: f64,
    /// cos θ.
    pub cos: f64,
    /// sin θ.
    pub sin: f64,
}

impl Pose {
    /// A part point seen from the cutter: `[d, y′, z′]`, turned from the original point.
    #[inline(always)]
    pub fn face(&self, p: Point) -> Point {
        [
            p[0] - self.x,
            p[1] * self.cos - p[2] * self.sin,
            p[1] * self.sin + p[2] * self.cos,
        ]
    }
}

/// The height at which the cutter touches point `p`, or `None` out of reach.
#[inline(always)]
pub fn touch_point(cutter: &Cutter, pose: &Pose, p: Point) -> Option<Touch> {
    let [d, y, z] = pose.face(p);
    let m = cutter.profile(d)?;
    (z.abs() <= m).then(|| Touch {
        height: y + ((m - z) * (m + z)).sqrt(),
        contact: p,
    })
}

/// The greatest height over a facet, or `None` if no point of it is in reach.
pub fn touch_facet(cutter: &Cutter, pose: &Pose, corners: [Point; 3]) -> Option<Touch> {
    let seen = corners.map(|p| pose.face(p));
    if let Some((s, t)) = support_on(cutter, seen) {
        let at =
            |c: [Point; 3]| add_scaled(add_scaled(c[0], s, sub(c[1], c[0])), t, sub(c[2], c[0]));
        return Some(Touch {
            height: height_within(cutter, at(seen)),
            contact: at(corners),
        });
    }
    let mut best: Option<Touch> = None;
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let Some((t, height)) = touch_edge(cutter, seen[i], seen[j]) else {
            continue;
        };
        if best.is_none_or(|b| height > b.height) {
            let contact = along(corners[i], corners[j], t);
            best = Some(Touch { height, contact });
        }
    }
    best
}

/// Where on the facet, as weights of the edges from its first corner, the cutter's support point
/// for the facet's normal falls; `None` if it falls beside it or if the facet stands upright.
#[inline(always)]
fn support_on(cutter: &Cutter, [a, b, c]: [Point; 3]) -> Option<(f64, f64)> {
    let (ab, ac) = (sub(b, a), sub(c, a));
    let n = cross(ab, ac);
    // An upright facet is touched along its edges alone; with a tilt below this the weights would
    // be noise.
    if n[1].abs() <= 1.0e-9 * length(n) {
        return None;
    }
    let up = if n[1] > 0.0 { n } else { [-n[0], -n[1], -n[2]] };
    let (d, z) = support(cutter, up);
    let (d, z) = (d - a[0], z - a[2]);
    let s = (z * ac[0] - d * ac[2]) / n[1];
    let t = (d * ab[2] - z * ab[0]) / n[1];
    (s >= 0.0 && t >= 0.0 && s + t <= 1.0).then_some((s, t))
}

/// `(d, z)` of the point where the cutter, coming down, first meets a plane whose normal is `n`,
/// `n[1] > 0`.
#[inline(always)]
fn support(cutter: &Cutter, n: Point) -> (f64, f64) {
    let rho = (n[1] * n[1] + n[2] * n[2]).sqrt();
    match *cutter {
        // A disc of radius R swept by a ball of radius r: the two supports add up.
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let share = minor_radius / length(n);
            (-share * n[0], -(share + major_radius / rho) * n[2])
        }
        // One of the two rims, or both and the line between them.
        Cutter::Cone {
            radius,
            width,
            slope,
            ..
        } => {
            let lean = rho * slope - n[0];
            let d = if lean > 0.0 {
                width / 2.0
            } else if lean < 0.0 {
                -width / 2.0
            } else {
                0.0
            };
            (d, -(radius + d * slope) * n[2] / rho)
        }
    }
}

/// The height of a point seen from the cutter that is in reach but for rounding.
#[inline(always)]
fn height_within(cutter: &Cutter, [d, y, z]: Point) -> f64 {
    let w = cutter.half_width();
    let m = cutter.profile(d.clamp(-w, w)).unwrap_or(0.0);
    y + ((m - z) * (m + z)).max(0.0).sqrt()
}

#[inline(always)]
fn along(a: Point, b: Point, t: f64) -> Point {
    if t == 0.0 {
        a
    } else if t == 1.0 {
        b
    } else {
        add_scaled(a, t, sub(b, a))
    }
}

/// Where on the edge from `a` to `b`, seen from the cutter, its height is greatest, from 0 to 1, and
/// that height.
fn touch_edge(cutter: &Cutter, a: Point, b: Point) -> Option<(f64, f64)> {
    let step = sub(b, a);
    let (low, high) = within_reach(cutter, a, step)?;
    let slope = |t: f64| slope_sign(cutter, along(a, b, t), step);
    let height = |t: f64| height_within(cutter, along(a, b, t));
    let t = maximum(low, high, slope);
    if t != low {
        return Some((t, height(t)));
    }
    // Along the very end of the reach the slope's sign tells nothing: it is 0 throughout.
    let (at_low, at_high) = (height(low), height(high));
    Some(if at_high > at_low {
        (high, at_high)
    } else {
        (low, at_low)
    })
}

/// A number with the sign of F's slope along `step`: the slope times the roots in its denominators,
/// less what they have in common with the radius, so that it stays finite at the end of the reach
/// and does not vanish there with the radius of a ball.
#[inline(always)]
fn slope_sign(cutter: &Cutter, [d, _, z]: Point, step: Point) -> f64 {
    match *cutter {
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let root = ((minor_radius - d) * (minor_radius + d)).max(0.0).sqrt();
            let m = major_radius + root;
            let rise = ((m - z) * (m + z)).max(0.0).sqrt();
            if step[0] == 0.0 {
                return step[1] * rise - z * step[2];
            }
            let share = if m > 0.0 { root / m } else { 1.0 };
            step[1] * rise * share - d * step[0] - z * step[2] * share
        }
        Cutter::Cone { radius, slope, .. } => {
            let m = radius + d * slope;
            let rise = ((m - z) * (m + z)).max(0.0).sqrt();
            step[1] * rise + m * slope * step[0] - z * step[2]
        }
    }
}

/// Where in `[low, high]` a concave function is greatest, given the sign of its slope: a false
/// position search (the Illinois variant) for the slope's zero.
#[inline(always)]
fn maximum(mut low: f64, mut high: f64, slope: impl Fn(f64) -> f64) -> f64 {
    let span = high - low;
    let mut at_low = slope(low);
    if at_low == 0.0 {
        // At a cone's apex the sign vanishes with the radius; a hair further in it does not.
        at_low = slope(low + HAIR * span);
    }
    if at_low <= 0.0 {
        return low;
    }
    let mut at_high = slope(high);
    if at_high == 0.0 {
        at_high = slope(high - HAIR * span);
    }
    if at_high >= 0.0 {
        return high;
    }
    let enough = EDGE_SEARCH * span;
    let mut moved_low = None;
    let mut last = f64::NAN;
    while high - low > enough {
        let t = low + (high - low) * (at_low / (at_low - at_high));
        let value = slope(t);
        if value == 0.0 || (t - last).abs() <= enough {
            return t;
        }
        last = t;
        if value > 0.0 {
            (low, at_low) = (t, value);
            if moved_low == Some(true) {
                at_high *= 0.5;
            }
            moved_low = Some(true);
        } else {
            (high, at_high) = (t, value);
            if moved_low == Some(false) {
                at_low *= 0.5;
            }
            moved_low = Some(false);
        }
    }
    low + (high - low) * 0.5
}

/// The part `[low, high]` of `[0, 1]` for which `a + t·step` is within the cutter's reach.
#[inline(always)]
fn within_reach(cutter: &Cutter, a: Point, step: Point) -> Option<(f64, f64)> {
    let (p, s) = ([a[0], a[2]], [step[0], step[2]]);
    let (low, high) = match *cutter {
        // Seen along Y, the torus is a capsule: a rectangle between two discs.
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let strip = meet(
                band(p[0], s[0], minor_radius),
                band(p[1], s[1], major_radius),
            );
            let upper = disc([p[0], p[1] - major_radius], s, minor_radius);
            let lower = disc([p[0], p[1] + major_radius], s, minor_radius);
            [strip, upper, lower]
                .into_iter()
                .filter(|i| i.0 <= i.1)
                .reduce(|i, j| (i.0.min(j.0), i.1.max(j.1)))?
        }
        Cutter::Cone {
            radius,
            width,
            slope,
            ..
        } => {
            let (m, growth) = (radius + p[0] * slope, s[0] * slope);
            let upper = below(p[1] - m, s[1] - growth);
            let lower = below(-p[1] - m, -s[1] - growth);
            meet(band(p[0], s[0], width / 2.0), meet(upper, lower))
        }
    };
    let (low, high) = (low.max(0.0), high.min(1.0));
    (low <= high).then_some((low, high))
}

/// How far from an end a sign is looked for that the end does not give, as a fraction.
const HAIR: f64 = 1.0e-6;

const NOWHERE: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);
const EVERYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

#[inline(always)]
fn meet(i: (f64, f64), j: (f64, f64)) -> (f64, f64) {
    (i.0.max(j.0), i.1.min(j.1))
}

/// Where `p + t·s ≤ 0`.
#[inline(always)]
fn below(p: f64, s: f64) -> (f64, f64) {
    if s > 0.0 {
        (f64::NEG_INFINITY, -p / s)
    } else if s < 0.0 {
        (-p / s, f64::INFINITY)
    } else if p <= 0.0 {
        EVERYWHERE
    } else {
        NOWHERE
    }
}

/// Where `|p + t·s| ≤ h`.
#[inline(always)]
fn band(p: f64, s: f64, h: f64) -> (f64, f64) {
    meet(below(p - h, s), below(-p - h, -s))
}

/// Where `p + t·s` is within `r` of the origin of the plane.
#[inline(always)]
fn disc(p: [f64; 2], s: [f64; 2], r: f64) -> (f64, f64) {
    let square = s[0] * s[0] + s[1] * s[1];
    let c = p[0] * p[0] + p[1] * p[1] - r * r;
    if square == 0.0 {
        return if c <= 0.0 { EVERYWHERE } else { NOWHERE };
    }
    let half = p[0] * s[0] + p[1] * s[1];
    let discriminant = half * half - square * c;
    if discriminant < 0.0 {
        return NOWHERE;
    }
    let root = discriminant.sqrt();
    ((-half - root) / square, (-half + root) / square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cutters() -> impl Strategy<Value = Cutter> {
        let size = 1.0..20.0;
        prop_oneof![
            (0.0..40.0, size.clone()).prop_map(|(a, b)| Cutter::torus(a, b)),
            size.clone().prop_map(Cutter::ball),
            (size.clone(), size.clone()).prop_map(|(a, b)| Cutter::cylinder(a, b)),
            (size, 0.5..4.0, -60.0..60.0).prop_map(|(a, b, c)| Cutter::cone(a + 4.0, b, c)),
            Just(Cutter::torus(1e-9, 8.0)),
            // Down to a point, or to within rounding of one.
            Just(Cutter::cone(10.0, 20.0, 45.0)),
            Just(Cutter::cone(10.0, 20.0, -45.0)),
        ]
        .prop_map(|c| c.expect("valid"))
    }

    fn points() -> impl Strategy<Value = Point> {
        // Coarse numbers make edges along the axes, upright and degenerate facets common.
        prop_oneof![
            prop::array::uniform3(-30.0..30.0_f64),
            prop::array::uniform3(-6..6_i32).prop_map(|p| p.map(|c| f64::from(c) * 4.0)),
            // Longer than any cutter is wide, and through the axis.
            (-60..60_i32, -3..3_i32).prop_map(|(x, y)| [f64::from(x), f64::from(y) * 5.0, 0.0]),
        ]
    }

    fn poses() -> impl Strategy<Value = Pose> {
        let x = prop_oneof![-20.0..20.0, (-5..5_i32).prop_map(|x| f64::from(x) * 4.0)];
        let degrees = prop_oneof![0..360_i32, Just(0), Just(180)];
        (x, degrees).prop_map(|(x, degrees)| Pose {
            x,
            cos: libm::cos(f64::from(degrees).to_radians()),
            sin: libm::sin(f64::from(degrees).to_radians()),
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// No sampled point of the facet is touched earlier than the facet, and the touch is on
        /// the facet and at its height.
        #[test]
        fn a_facet_is_touched_where_dense_sampling_says(
            cutter in cutters(),
            pose in poses(),
            corners in prop::array::uniform3(points()),
        ) {
            let touch = touch_facet(&cutter, &pose, corners);
            let n = 60;
            let mut sampled = f64::NEG_INFINITY;
            for i in 0..=n {
                for j in 0..=n - i {
                    let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                    let p = add_scaled(
                        add_scaled(corners[0], s, sub(corners[1], corners[0])),
                        t,
                        sub(corners[2], corners[0]),
                    );
                    if let Some(touch) = touch_point(&cutter, &pose, p) {
                        sampled = sampled.max(touch.height);
                    }
                }
            }
            match touch {
                None => prop_assert!(sampled == f64::NEG_INFINITY, "missed {sampled}"),
                Some(touch) => {
                    prop_assert!(touch.height >= sampled - 1e-7, "{} < {sampled}", touch.height);
                    let seen = pose.face(touch.contact);
                    let again = height_within(&cutter, seen);
                    prop_assert!((again - touch.height).abs() < 1e-5, "{again} {}", touch.height);
                }
            }
        }
    }

    /// An edge across a ball or a cone with a point, in the plane of the axis, is touched in its
    /// middle: its ends are the ends of the reach, where a slope is hard to tell.
    #[test]
    fn an_edge_through_the_axis_is_touched_where_the_cutter_is_widest() {
        let level = |cutter: Cutter, x: f64| {
            let pose = Pose {
                x,
                cos: 1.0,
                sin: 0.0,
            };
            let corners = [[-50.0, 10.0, 0.0], [50.0, 10.0, 0.0], [0.0, -10.0, 0.0]];
            touch_facet(&cutter, &pose, corners).map(|t| t.height)
        };
        for x in [0.0, 0.1, 7.7, -13.3] {
            let ball = level(Cutter::ball(8.0).expect("valid"), x).expect("in reach");
            assert!((ball - 18.0).abs() < 1e-9, "{ball}");
            for angle in [45.0, -45.0] {
                let cone = Cutter::cone(10.0, 20.0, angle).expect("valid");
                let cone = level(cone, x).expect("in reach");
                assert!((cone - 30.0).abs() < 1e-6, "{cone}");
            }
        }
    }

    #[test]
    fn a_horizontal_facet_is_touched_below_the_centre() {
        let torus = Cutter::torus(40.0, 8.0).expect("valid");
        let pose = Pose {
            x: 0.0,
            cos: 1.0,
            sin: 0.0,
        };
        let corners = [[-50.0, 10.0, -50.0], [50.0, 10.0, -50.0], [0.0, 10.0, 80.0]];
        let touch = touch_facet(&torus, &pose, corners).expect("in reach");
        assert_eq!(touch.height, 58.0);
        assert!(length(sub(touch.contact, [0.0, 10.0, 0.0])) < 1e-12);
    }
}
