//! Contact with an edge of a facet: where a concave function of one variable is greatest, over the part of the
//! edge that is within the cutter's reach.

use std::mem;

use super::{along, height_within};
use crate::cutter::Cutter;
use crate::tolerance::{BOUND_SLACK, EDGE_SEARCH};
use crate::vector::{Point, sub};

/// Where on the edge from `a` to `b`, seen from the cutter, its height is greatest, from 0 to 1, and
/// that height; also `None` if that is surely below `floor`.
#[inline]
pub(super) fn touch_edge(cutter: &Cutter, a: Point, b: Point, floor: f64) -> Option<(f64, f64)> {
    let step = sub(b, a);
    let rise = |t: f64| Rise::at(cutter, along(a, b, t), step);
    let height = |t: f64| height_within(cutter, along(a, b, t));
    let ends = [rise(0.0), rise(1.0)];
    let (low, high, [at_low, at_high]) = if ends[0].within && ends[1].within {
        (0.0, 1.0, ends)
    } else {
        let (low, high) = within_reach(cutter, a, step)?;
        (low, high, [rise(low), rise(high)])
    };
    // At a cone's apex the sign vanishes with the radius; a hair further in it does not.
    let hair = HAIR * (high - low);
    let rising = match at_low.sign {
        0.0 => rise(low + hair).sign,
        sign => sign,
    };
    if rising <= 0.0 {
        // Along the very end of the reach the sign tells nothing: it is 0 throughout.
        return Some(
            match at_high.height > at_low.height && height(high) > height(low) {
                true => (high, height(high)),
                false => (low, height(low)),
            },
        );
    }
    let falling = match at_high.sign {
        0.0 => rise(high - hair).sign,
        sign => sign,
    };
    if falling >= 0.0 {
        return Some((high, height(high)));
    }
    let t = maximum((low, rising), (high, falling), rise, floor)?;
    Some((t, height(t)))
}

/// F along an edge, at one place of it.
struct Rise {
    /// F's slope times a scale: it stays finite at the end of the reach, and does not vanish there with
    /// the radius of a ball.
    sign: f64,
    /// That scale, or 0 where the height is not sure.
    scale: f64,
    height: f64,
    /// Whether the place is within the cutter's reach.
    within: bool,
}

/// Share of a rounding's radius up to which its flank counts as close to the rim.
const CLOSE: f64 = 0.1;

impl Rise {
    /// At a point seen from the cutter, along `step`.
    #[inline(always)]
    fn at(cutter: &Cutter, [d, y, z]: Point, step: Point) -> Self {
        match *cutter {
            Cutter::Torus {
                major_radius,
                minor_radius,
            } => {
                let square = (minor_radius - d) * (minor_radius + d);
                let root = square.max(0.0).sqrt();
                let m = major_radius + root;
                let rise = ((m - z) * (m + z)).max(0.0).sqrt();
                let height = y + rise;
                let within = square >= 0.0 && z.abs() <= m;
                // Close to the rim [`Cutter::profile`] is rounded otherwise, and heights with it.
                let sure = if root > CLOSE * minor_radius {
                    1.0
                } else {
                    0.0
                };
                if step[0] == 0.0 {
                    return Self {
                        sign: step[1] * rise - z * step[2],
                        scale: sure * rise,
                        height,
                        within,
                    };
                }
                let share = if m > 0.0 { root / m } else { 1.0 };
                Self {
                    sign: step[1] * rise * share - d * step[0] - z * step[2] * share,
                    scale: sure * rise * share,
                    height,
                    within,
                }
            }
            Cutter::Cone {
                radius,
                width,
                slope,
                ..
            } => {
                let m = radius + d * slope;
                let rise = ((m - z) * (m + z)).max(0.0).sqrt();
                Self {
                    sign: step[1] * rise + m * slope * step[0] - z * step[2],
                    scale: rise,
                    height: y + rise,
                    within: d.abs() <= width / 2.0 && z.abs() <= m,
                }
            }
        }
    }

    /// Whether F, being concave, stays surely below `floor` as far as `reach` along the edge.
    #[inline(always)]
    fn stays_below(&self, floor: f64, reach: f64) -> bool {
        // Multiplied by the scale; where that vanishes nothing is sure.
        let missing = (floor - self.height) * self.scale;
        let gain = self.sign.abs() * reach;
        let rounding = BOUND_SLACK * ((floor.abs() + self.height.abs()) * self.scale + gain);
        missing > gain * (1.0 + 1.0e-9) + 64.0 * rounding
    }
}

/// Where a concave function is greatest between a place where it rises and one where it falls, each with its
/// slope: the slope's zero by inverse quadratic interpolation, and by halving where that would not do
/// (Chandrupatla's method, begun by a false position). `None` if it is surely below `floor`.
#[inline(always)]
fn maximum(
    mut rising: (f64, f64),
    mut falling: (f64, f64),
    rise: impl Fn(f64) -> Rise,
    floor: f64,
) -> Option<f64> {
    let span = falling.0 - rising.0;
    let mut t = rising.0 + span * (rising.1 / (rising.1 - falling.1));
    loop {
        let here = rise(t);
        let newest = (t, here.sign);
        let (before, other) = if here.sign > 0.0 {
            (mem::replace(&mut rising, newest), falling)
        } else if here.sign < 0.0 {
            (mem::replace(&mut falling, newest), rising)
        } else {
            return Some(t);
        };
        let left = falling.0 - rising.0;
        if here.stays_below(floor, left) {
            return None;
        }
        let next = interpolated(newest, other, before);
        let settled = here.sign.abs() <= SETTLED * before.1.abs().min(other.1.abs());
        let enough = EDGE_SEARCH * span;
        let last = settled && (next - t).abs() <= enough;
        // Where the part within reach is short, rounding ends the search.
        if last || next == t || left <= SETTLED * enough {
            return Some(next);
        }
        t = next;
    }
}

/// Where a slope vanishes between its newest place and the `other` side of the zero, given also the place `before`
/// on its own side.
#[inline(always)]
fn interpolated((a, at_a): (f64, f64), (b, at_b): (f64, f64), (c, at_c): (f64, f64)) -> f64 {
    let (way, whole_way, rest_way) = (a - b, c - b, c - a);
    let (change, whole_change, rest_change) = (at_a - at_b, at_c - at_b, at_c - at_a);
    // The parabola through all three is followed if it is steep enough at both its ends, which is that the
    // squares of shares of the change are below those shares of the way.
    let (way_square, change_square) = (whole_way * whole_way, whole_change * whole_change);
    let smooth = change * change * way_square < way * whole_way * change_square
        && rest_change * rest_change * way_square < rest_way * whole_way * change_square;
    if smooth {
        let (newest, whole) = (way / change, whole_way / whole_change);
        a - at_a * (newest + at_b * (newest - whole) / rest_change)
    } else {
        a - way / 2.0
    }
}

/// How small a slope is beside those on both sides when what remains of a search is but its last step.
const SETTLED: f64 = 1.0e-3;

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
    if square == 0.0 {
        let within = p[0] * p[0] + p[1] * p[1] <= r * r;
        return if within { EVERYWHERE } else { NOWHERE };
    }
    let half = p[0] * s[0] + p[1] * s[1];
    // How far the line passes from the origin, times its length: `half² − square·c` would be the same,
    // but of an edge that comes from afar nothing would be left of it, and rows out of reach are not
    // searched everywhere.
    let apart = p[0] * s[1] - p[1] * s[0];
    let discriminant = square * (r * r) - apart * apart;
    if discriminant < 0.0 {
        return NOWHERE;
    }
    let root = discriminant.sqrt();
    ((-half - root) / square, (-half + root) / square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{add_scaled, length};
    use proptest::prelude::*;

    /// The greatest of a concave function over an interval, by golden section.
    fn greatest(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
        let mut most = f(low).max(f(high));
        for _ in 0..100 {
            let [a, b] = [0.381_966, 0.618_034].map(|share| low + (high - low) * share);
            let (at_a, at_b) = (f(a), f(b));
            most = most.max(at_a).max(at_b);
            if at_a < at_b {
                low = a;
            } else {
                high = b;
            }
        }
        most
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Edges about tangent to the cutter, from far shorter than it is wide to far longer, are touched as high as
        /// golden section says, to a tenth of a nanometre and a little.
        #[test]
        fn an_edge_is_touched_where_golden_section_says(
            which in 0..7_usize,
            place in prop::array::uniform2(-1.0..1.0_f64),
            way in prop::array::uniform2(-0.5..0.5_f64),
            tilt in prop_oneof![Just(1.0), 0.0..1.0_f64],
            size in prop_oneof![Just(0.1), Just(0.5), Just(2.0), Just(10.0), Just(50.0), Just(300.0)],
            share in 0.01..1.0_f64,
            before in 0.0..1.0_f64,
        ) {
            let cutter = [
                Cutter::torus(40.0, 8.0),
                Cutter::torus(2.0, 0.5),
                Cutter::torus(1.0e-9, 8.0),
                Cutter::ball(8.0),
                Cutter::cylinder(30.0, 36.0),
                Cutter::cone(10.0, 20.0, 45.0),
                Cutter::cone(20.0, 8.0, -60.0),
            ][which].clone().expect("valid");
            let d = place[0] * cutter.half_width();
            let height = |d: f64, z: f64| height_within(&cutter, [d, 0.0, z]);
            let z = place[1] * cutter.profile(d).expect("within the width");
            let middle = [d, 3.0 - height(d, z), z];
            const FAR: f64 = 1.0e-6;
            let by_d = (height(d + FAR, z) - height(d - FAR, z)) / (2.0 * FAR);
            let by_z = (height(d, z + FAR) - height(d, z - FAR)) / (2.0 * FAR);
            let way = [way[0], -tilt * (way[0] * by_d + way[1] * by_z), way[1]];
            let long = size * share / length(way);
            prop_assume!(long.is_finite());
            let a = add_scaled(middle, -before * long, way);
            let b = add_scaled(middle, (1.0 - before) * long, way);

            let step = sub(b, a);
            let within = |p: Point| Rise::at(&cutter, p, step).within;
            let (low, high) = match within(a) && within(b) {
                true => (0.0, 1.0),
                false => match within_reach(&cutter, a, step) {
                    Some(part) => part,
                    None => return Ok(()),
                },
            };
            let most = greatest(low, high, |t| height_within(&cutter, along(a, b, t)));
            let (t, found) = touch_edge(&cutter, a, b, f64::NEG_INFINITY).expect("in reach");
            prop_assert!((low..=high).contains(&t));
            prop_assert!(found >= most - 2.0e-10, "{} below", most - found);
            prop_assert!(found <= most + 2.0e-10, "{} above", found - most);
            // What is surely below a floor is below it.
            if touch_edge(&cutter, a, b, most).is_none() {
                prop_assert!(found <= most);
            }
            prop_assert!(touch_edge(&cutter, a, b, most - 1.0e-9).is_some());
        }
    }
}
