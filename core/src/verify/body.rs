//! The cutter as a solid: how far a point is from it, along its normal and along the attack axis.
//!
//! Points come as seen from the cutter's centre, `[d, y, z]`: d along the spindle, y towards the
//! cutter along the attack axis, z across. Both measures are convex functions of the point because
//! the body is convex, so a tangent plane at any point bounds them from below everywhere; that is
//! all a search needs. Clearances are what is reported and doubles; tangents only bound, and are
//! singles. Written apart from `contact`, so that one can be held against the other, and for the
//! torus without branches, so that a compiler can take several points at once.

use crate::vector::Point;

/// How much of the reach a tangent of the attack clearance keeps to: at its rim the slope is
/// infinite.
const RIM: f32 = 1.0 - 1.0e-4;

/// Below this distance from a corner of the profile, relative to the cutter's size, the direction
/// from the corner is rounding noise.
const CORNER_NOISE: f64 = 1.0e-9;

/// Keeps a quotient of lengths finite, mm; far below any of them, and its square a normal single.
const TINY: f32 = 1.0e-15;

/// A function that is nowhere greater than the one it touches: `value + slope · offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    /// At the point it was asked for, mm.
    pub value: f32,
    /// By d, y and z.
    pub slope: [f32; 3],
}

/// A function of d and z that is nowhere less than the half chord `√(m(d)² − z²)`, which is concave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ChordPlane {
    /// d and z of where the two touch.
    pub at: [f32; 2],
    /// The half chord there, mm.
    pub value: f32,
    /// Slopes by d and z.
    pub slope: [f32; 2],
}

/// A cutter's body.
pub(super) trait Solid: Sync {
    /// Half the width along the spindle, mm.
    fn half_width(&self) -> f64;
    /// Largest radius, mm.
    fn max_radius(&self) -> f64;
    /// Normal clearance, mm: the signed distance from the point to the body, negative inside.
    fn normal_clearance(&self, seen: Point) -> f64;
    /// A tangent plane of the normal clearance.
    fn normal_plane(&self, seen: [f32; 3]) -> Plane;
    /// Attack clearance, mm: how far the cutter can advance along the attack axis until it touches
    /// the point, negative if it would have had to stop before; infinite if it never touches it.
    fn attack_clearance(&self, seen: Point) -> f64;
    /// A tangent plane of the half chord, at a point of the reach near the middle of an interval of
    /// d, which meets the width, and one of z.
    fn chord_plane(&self, d: [f32; 2], z: [f32; 2]) -> ChordPlane;
}

/// A torus wheel or a ball: a disc of radius R swept by a ball of radius r, so that the signed
/// distance is the one to the disc, less r, and that inside the body too.
#[derive(Debug, Clone, Copy)]
pub(super) struct Torus {
    /// R, mm.
    pub major_radius: f64,
    /// r, mm.
    pub minor_radius: f64,
}

impl Solid for Torus {
    fn half_width(&self) -> f64 {
        self.minor_radius
    }

    fn max_radius(&self) -> f64 {
        self.major_radius + self.minor_radius
    }

    #[inline(always)]
    fn normal_clearance(&self, [d, y, z]: Point) -> f64 {
        let beyond = positive((y * y + z * z).sqrt() - self.major_radius);
        (d * d + beyond * beyond).sqrt() - self.minor_radius
    }

    #[inline(always)]
    fn normal_plane(&self, [d, y, z]: [f32; 3]) -> Plane {
        let rho = (y * y + z * z).sqrt();
        let beyond = positive(rho - self.major_radius as f32);
        let distance = (d * d + beyond * beyond).sqrt();
        let rho = rho + TINY;
        let scale = 1.0 / ((distance + TINY) * rho);
        let across = beyond * scale;
        Plane {
            value: distance - self.minor_radius as f32,
            slope: [d * rho * scale, across * y, across * z],
        }
    }

    #[inline(always)]
    fn attack_clearance(&self, [d, y, z]: Point) -> f64 {
        let r = self.minor_radius;
        let square = r * r - d * d;
        let m = self.major_radius + positive(square).sqrt();
        let advance = -(y + positive((m - z) * (m + z)).sqrt());
        if (square >= 0.0) & (z.abs() <= m) {
            advance
        } else {
            f64::INFINITY
        }
    }

    #[inline(always)]
    fn chord_plane(&self, d: [f32; 2], z: [f32; 2]) -> ChordPlane {
        let r = self.minor_radius as f32;
        let at_d = within(0.5 * (d[0] + d[1]), RIM * r);
        let root = ((r - at_d) * (r + at_d)).sqrt();
        let m = self.major_radius as f32 + root;
        let at_z = within(0.5 * (larger(z[0], -m) + smaller(z[1], m)), RIM * m);
        let half = ((m - at_z) * (m + at_z)).sqrt();
        let scale = 1.0 / (root * half);
        ChordPlane {
            at: [at_d, at_z],
            value: half,
            slope: [-at_d * m * scale, -at_z * root * scale],
        }
    }
}

/// A cone or cylinder, by its profile in the half plane of axial distance d and radius ρ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cone {
    half: f64,
    radius: f64,
    slope: f64,
    /// 1/√(1 + slope²).
    cos: f64,
}

/// What of the profile lies nearest.
enum Nearest {
    /// Its side, or the inside of the body.
    Face,
    /// An end.
    End,
    /// The corner of side and end, at d and ρ.
    Corner(f64, f64),
}

impl Cone {
    /// Of the radius in the middle of the width and the slope tan φ; lengths in mm.
    pub fn new(radius: f64, width: f64, slope: f64) -> Self {
        Self {
            half: 0.5 * width,
            radius,
            slope,
            cos: 1.0 / (1.0 + slope * slope).sqrt(),
        }
    }

    /// Signed distance to the line of the side.
    #[inline(always)]
    fn side(&self, d: f64, rho: f64) -> f64 {
        (rho - (self.radius + d * self.slope)) * self.cos
    }

    #[inline(always)]
    fn nearest(&self, d: f64, rho: f64) -> Nearest {
        let end = if self.side(d, rho) > 0.0 {
            // Where the foot of the perpendicular falls on the side, from its middle.
            let foot = d + self.slope * (rho - self.radius);
            let limit = self.half * (1.0 + self.slope * self.slope);
            if foot.abs() <= limit {
                return Nearest::Face;
            }
            self.half.copysign(foot)
        } else {
            if d.abs() <= self.half {
                return Nearest::Face;
            }
            self.half.copysign(d)
        };
        let corner = self.radius + end * self.slope;
        if rho <= corner {
            Nearest::End
        } else {
            Nearest::Corner(end, corner)
        }
    }
}

impl Solid for Cone {
    fn half_width(&self) -> f64 {
        self.half
    }

    fn max_radius(&self) -> f64 {
        self.radius + self.slope.abs() * self.half
    }

    #[inline(always)]
    fn normal_clearance(&self, [d, y, z]: Point) -> f64 {
        let rho = (y * y + z * z).sqrt();
        match self.nearest(d, rho) {
            Nearest::Face => {
                let side = self.side(d, rho);
                if side > 0.0 {
                    side
                } else {
                    side.max(d.abs() - self.half)
                }
            }
            Nearest::End => d.abs() - self.half,
            Nearest::Corner(x, r) => ((d - x) * (d - x) + (rho - r) * (rho - r)).sqrt(),
        }
    }

    #[inline(always)]
    fn normal_plane(&self, [d, y, z]: [f32; 3]) -> Plane {
        let length = (y * y + z * z).sqrt();
        let plane = |value: f64, by_d: f64, by_rho: f64| {
            let across = by_rho as f32 / (length + TINY);
            Plane {
                value: value as f32,
                slope: [by_d as f32, across * y, across * z],
            }
        };
        let (d, rho) = (f64::from(d), f64::from(length));
        if let Nearest::Corner(x, r) = self.nearest(d, rho) {
            let distance = ((d - x) * (d - x) + (rho - r) * (rho - r)).sqrt();
            if distance > CORNER_NOISE * (self.half + self.radius) {
                return plane(distance, (d - x) / distance, (rho - r) / distance);
            }
        }
        // The body lies behind the planes of its side and its ends.
        let (side, end) = (self.side(d, rho), d.abs() - self.half);
        if side >= end {
            plane(side, -self.slope * self.cos, self.cos)
        } else {
            plane(end, 1.0_f64.copysign(d), 0.0)
        }
    }

    #[inline(always)]
    fn attack_clearance(&self, [d, y, z]: Point) -> f64 {
        let m = self.radius + d * self.slope;
        if (d.abs() <= self.half) & (z.abs() <= m) {
            -(y + positive((m - z) * (m + z)).sqrt())
        } else {
            f64::INFINITY
        }
    }

    #[inline(always)]
    fn chord_plane(&self, d: [f32; 2], z: [f32; 2]) -> ChordPlane {
        let slope = self.slope as f32;
        let at_d = within(0.5 * (d[0] + d[1]), RIM * self.half as f32);
        let m = self.radius as f32 + at_d * slope;
        let at_z = within(0.5 * (larger(z[0], -m) + smaller(z[1], m)), RIM * m);
        let half = ((m - at_z) * (m + at_z)).sqrt();
        ChordPlane {
            at: [at_d, at_z],
            value: half,
            slope: [m * slope / half, -at_z / half],
        }
    }
}

// One instruction each, where `max`, `min` and `clamp` also deal with what is not a number.

#[inline(always)]
pub(super) fn larger<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn smaller<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

#[inline(always)]
fn positive<T: PartialOrd + Default>(a: T) -> T {
    larger(a, T::default())
}

/// `a`, but no further from 0 than `limit`.
#[inline(always)]
fn within(a: f32, limit: f32) -> f32 {
    smaller(larger(a, -limit), limit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What singles may be off by at these lengths, mm; a search allows for several times that.
    const SINGLE: f64 = 1.0e-4;

    /// A body with its profile as a function, for sampling.
    type Shaped = (Box<dyn Solid>, Box<dyn Fn(f64) -> f64>);

    fn bodies() -> Vec<Shaped> {
        let torus = |major_radius: f64, minor_radius: f64| -> Shaped {
            let body = Torus {
                major_radius,
                minor_radius,
            };
            let m =
                move |d: f64| major_radius + positive(minor_radius * minor_radius - d * d).sqrt();
            (Box::new(body), Box::new(m))
        };
        let cone = |radius: f64, width: f64, slope: f64| -> Shaped {
            let m = move |d: f64| radius + d * slope;
            (Box::new(Cone::new(radius, width, slope)), Box::new(m))
        };
        vec![
            torus(40.0, 8.0),
            torus(0.0, 10.0),
            torus(3.0, 12.0),
            cone(20.0, 12.0, 0.0),
            cone(5.0, 30.0, 0.0),
            cone(20.0, 12.0, 1.7),
            cone(20.0, 12.0, -0.6),
            cone(10.0, 20.0, 1.0),
            cone(10.0, 20.0, -1.0),
        ]
    }

    /// The distance in the half plane to densely sampled points of side and ends, negative inside.
    fn sampled(body: &dyn Solid, m: &dyn Fn(f64) -> f64, d: f64, rho: f64) -> f64 {
        let (w, n) = (body.half_width(), 4000);
        let mut least = f64::INFINITY;
        for i in 0..=n {
            let share = f64::from(i) / f64::from(n);
            // Denser towards the ends, where a torus is steep.
            let x = -w * libm::cos(std::f64::consts::PI * share);
            least = least.min((d - x).hypot(rho - m(x)));
            for end in [-w, w] {
                least = least.min((d - end).hypot(rho - share * m(end)));
            }
        }
        let inside = d.abs() <= w && rho <= m(d);
        if inside { -least } else { least }
    }

    #[test]
    fn the_signed_distance_is_that_of_the_sampled_boundary() {
        for (number, (body, m)) in bodies().into_iter().enumerate() {
            for i in -24..=24 {
                for j in 0..=24 {
                    let (d, rho) = (f64::from(i) * 1.3, f64::from(j) * 2.9);
                    let expected = sampled(body.as_ref(), &m, d, rho);
                    // Whichever way it points from the axis.
                    for [y, z] in [[rho, 0.0], [-0.6 * rho, 0.8 * rho]] {
                        let found = body.normal_clearance([d, y, z]);
                        assert!(
                            (found - expected).abs() < 2e-3,
                            "body {number} at {d}, {rho}: {found}, but {expected} sampled"
                        );
                    }
                }
            }
        }
    }

    fn anywhere() -> impl Strategy<Value = Point> {
        prop_oneof![
            prop::array::uniform3(-60.0..60.0_f64),
            prop::array::uniform3(-12..12_i32).prop_map(|p| p.map(|c| f64::from(c) * 5.0)),
            // At and about the axis, the rims and the discs.
            (-3..3_i32, -3..3_i32).prop_map(|(d, y)| [
                f64::from(d) * 6.0,
                f64::from(y) * 20.0,
                0.0
            ]),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]

        #[test]
        fn tangents_are_below_the_clearances_everywhere(
            number in 0..9_usize,
            at in anywhere(),
            other in anywhere(),
            half in 0.0..20.0_f64,
        ) {
            let (body, _) = bodies().swap_remove(number);
            let Plane { value, slope } = body.normal_plane(at.map(|c| c as f32));
            let offset: f64 = (0..3).map(|k| f64::from(slope[k]) * (other[k] - at[k])).sum();
            prop_assert!((f64::from(value) - body.normal_clearance(at)).abs() < SINGLE);
            prop_assert!(f64::from(value) + offset <= body.normal_clearance(other) + SINGLE);

            let advance = body.attack_clearance(other);
            let w = body.half_width();
            let reach = [(at[0] - half).max(-w), (at[0] + half).min(w)];
            if advance < f64::INFINITY && reach[0] <= reach[1] {
                let z = [at[2] - half, at[2] + half];
                let chord = body.chord_plane(reach.map(|c| c as f32), z.map(|c| c as f32));
                let [slope, at] = [chord.slope, chord.at].map(|p| p.map(f64::from));
                let above = f64::from(chord.value)
                    + slope[0] * (other[0] - at[0])
                    + slope[1] * (other[2] - at[1]);
                let steep = slope[0].abs() + slope[1].abs();
                prop_assert!(-other[1] - above <= advance + SINGLE * (1.0 + steep));
            }
        }
    }

    /// The two measures agree where the cutter comes at a point straight on, and are far apart
    /// behind it.
    #[test]
    fn clearances_have_the_sign_of_the_side_they_are_seen_from() {
        let torus = Torus {
            major_radius: 40.0,
            minor_radius: 8.0,
        };
        let both = |p| [torus.normal_clearance(p), torus.attack_clearance(p)];
        assert_eq!(both([0.0, -50.0, 0.0]), [2.0, 2.0]);
        assert_eq!(both([0.0, -47.0, 0.0]), [-1.0, -1.0]);
        assert_eq!(both([0.0, 50.0, 0.0]), [2.0, -98.0]);
        assert_eq!(both([9.0, -40.0, 0.0]), [1.0, f64::INFINITY]);
    }
}
