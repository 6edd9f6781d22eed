//! Contact: at which height the cutter touches one point or one facet.
//!
//! Seen from the cutter, a part point at axial distance d and at y′, z′ is touched when the cutter's
//! centre stands at `F = y′ + √(m(d)² − z′²)` (eqs. 1, 2 and 5 of the 2001 paper, read as heights).
//! The cutter is convex, so F is concave over its reach, and the touch on a facet is where the
//! cutter's support point for the facet's normal falls, else on an edge, else at a corner.
//!
//! A height is one fixed sequence of + − × ÷ √ of the facet's corners and the position; nothing here
//! may depend on who else is searched. `bound` holds what may.

mod edge;

use self::edge::touch_edge;
use crate::cutter::Cutter;
use crate::path::Touch;
use crate::tolerance::{BOUND_SLACK, WELL_WITHIN};
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

/// The height at which the cutter touches point `p`, or `None` out of reach: what `lanes` computes for
/// eight.
#[cfg(test)]
pub fn touch_point(cutter: &Cutter, pose: &Pose, p: Point) -> Option<Touch> {
    let [d, y, z] = pose.face(p);
    let m = cutter.profile(d)?;
    (z.abs() <= m).then(|| Touch {
        height: y + ((m - z) * (m + z)).sqrt(),
        contact: p,
    })
}

/// A height that the cutter is surely touched at or above, given a place on the part, or minus infinity.
#[inline(always)]
pub fn least_height(cutter: &Cutter, pose: &Pose, contact: Point) -> f64 {
    let seen = pose.face(contact);
    // Rounding has put the contact beside its facet, which matters where F is steep.
    height_well_within(cutter, seen).map_or(f64::NEG_INFINITY, |height| {
        let size = cutter.max_radius() + seen[1].abs() + pose.x.abs();
        height - FLOOR_SLACK * size
    })
}

/// The height of a point seen from the cutter that is well within its reach, where F is smooth; `None` for others.
#[inline(always)]
pub fn height_well_within(cutter: &Cutter, [d, y, z]: Point) -> Option<f64> {
    let m = cutter.profile(d)?;
    let within = d.abs() <= WELL_WITHIN * cutter.half_width() && z.abs() <= WELL_WITHIN * m;
    within.then(|| y + ((m - z) * (m + z)).sqrt())
}

/// What rounding may take from the height at a contact, relative to the lengths involved.
const FLOOR_SLACK: f64 = 64.0 * BOUND_SLACK;

/// The greatest height over a facet, or `None` if no point of it is in reach.
pub fn touch_facet(cutter: &Cutter, pose: &Pose, corners: [Point; 3]) -> Option<Touch> {
    let seen = corners.map(|p| pose.face(p));
    touch_seen(cutter, corners, seen, f64::NEG_INFINITY).map(|(touch, _)| touch)
}

/// What of a facet is touched, its corners told by their places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spot {
    Corner(usize),
    /// Between two corners.
    Edge(usize, usize),
    Inside,
}

/// The same, and what of the facet is touched, given how the cutter sees the corners; also `None` if that is
/// surely below `floor`.
#[inline]
pub fn touch_seen(
    cutter: &Cutter,
    corners: [Point; 3],
    seen: [Point; 3],
    floor: f64,
) -> Option<(Touch, Spot)> {
    let weights = weights_of_support(cutter, seen);
    if let Some([_, s, t]) = weights.filter(|w| w.iter().all(|&w| w >= 0.0)) {
        let at =
            |c: [Point; 3]| add_scaled(add_scaled(c[0], s, sub(c[1], c[0])), t, sub(c[2], c[0]));
        let touch = Touch {
            height: height_within(cutter, at(seen)),
            contact: at(corners),
        };
        return Some((touch, Spot::Inside));
    }
    let mut best: Option<(Touch, Spot)> = None;
    for (opposite, i, j) in [(2, 0, 1), (0, 1, 2), (1, 2, 0)] {
        // F rises towards the support point, so that only edges which face it can be touched.
        if weights.is_some_and(|w| w[opposite] > FACING) {
            continue;
        }
        // Both facets beside an edge go along it the same way, and find the same.
        let (i, j) = if corners[i] < corners[j] {
            (i, j)
        } else {
            (j, i)
        };
        let Some((t, height)) = touch_edge(cutter, seen[i], seen[j], floor) else {
            continue;
        };
        if best.is_none_or(|(b, _)| height > b.height) {
            let contact = along(corners[i], corners[j], t);
            let spot = if t == 0.0 {
                Spot::Corner(i)
            } else if t == 1.0 {
                Spot::Corner(j)
            } else {
                Spot::Edge(i, j)
            };
            best = Some((Touch { height, contact }, spot));
        }
    }
    best
}

/// Greatest weight of the opposite corner with which an edge counts as facing the support point: above
/// the rounding of a weight.
const FACING: f64 = 1.0e-3;

/// Where the cutter's support point for the facet's normal falls in the facet's plane, as weights of
/// its corners; `None` if the facet stands upright.
#[inline(always)]
fn weights_of_support(cutter: &Cutter, [a, b, c]: [Point; 3]) -> Option<[f64; 3]> {
    let (ab, ac) = (sub(b, a), sub(c, a));
    let n = cross(ab, ac);
    // An upright facet is touched along its edges alone; with a tilt below this the weights would
    // be noise.
    let size = length(n);
    if n[1].abs() <= UPRIGHT * size {
        return None;
    }
    let up = 1.0_f64.copysign(n[1]);
    let (d, z) = support(cutter, n.map(|c| up * c), size);
    let (d, z) = (d - a[0], z - a[2]);
    let share = 1.0 / n[1];
    let s = (z * ac[0] - d * ac[2]) * share;
    let t = (d * ab[2] - z * ab[0]) * share;
    Some([1.0 - s - t, s, t])
}

/// Tilt of a facet, as the share of its normal along the attack axis, below which it stands upright.
const UPRIGHT: f64 = 1.0e-6;

/// `(d, z)` of the point where the cutter, coming down, first meets a plane whose normal is `n`,
/// `n[1] > 0`, of length `size`.
#[inline(always)]
fn support(cutter: &Cutter, n: Point, size: f64) -> (f64, f64) {
    let rho = (n[1] * n[1] + n[2] * n[2]).sqrt();
    match *cutter {
        // A disc of radius R swept by a ball of radius r: the two supports add up.
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let share = minor_radius / size;
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
            // Where a facet meets the reach in a single point of its edge, rounding alone decides: across
            // the axis, and along it where a torus rises straight up from its end.
            let width = match cutter {
                Cutter::Torus { minor_radius, .. } => minor_radius - 1.0e-9,
                Cutter::Cone { width, .. } => width / 2.0,
            };
            let inside = |p: Point| {
                let [d, _, z] = pose.face(p);
                let m = cutter.profile(d).filter(|_| d.abs() <= width);
                m.is_some_and(|m| z.abs() <= m - 1.0e-9)
            };
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
                    let touch = touch_point(&cutter, &pose, p).filter(|_| inside(p));
                    sampled = sampled.max(touch.map_or(f64::NEG_INFINITY, |t| t.height));
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

    #[test]
    fn an_edge_from_afar_is_not_touched_out_of_reach() {
        let pose = Pose {
            x: 0.0,
            cos: 1.0,
            sin: 0.0,
        };
        for (long, radius) in [(300.0, 8.0), (1.0e4, 8.0), (1.0e4, 0.5), (1.0e5, 0.5)] {
            let ball = Cutter::ball(radius).expect("valid");
            for degree in 0..360 {
                let angle = f64::from(degree).to_radians();
                let (u, v) = (libm::cos(angle), libm::sin(angle));
                let at = |r: f64, y: f64| [r * u, y, r * v];
                for gap in [1.0e-9, 1.0e-8] {
                    let tip = at(radius + gap, 10.0);
                    let corners = [tip, at(long, 0.0), at(long, -5.0)];
                    let touch = touch_facet(&ball, &pose, corners);
                    assert_eq!(touch, None, "{long}, {radius}, {degree}");
                }
            }
        }
    }
}
