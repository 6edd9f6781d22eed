//! Contact with an edge of a facet: where a concave function of one variable is greatest, over the part of the
//! edge that is within the cutter's reach.

use super::{along, height_within};
use crate::cutter::Cutter;
use crate::tolerance::{BOUND_SLACK, EDGE_SEARCH};
use crate::vector::{Point, sub};

/// Where on the edge from `a` to `b`, seen from the cutter, its height is greatest, from 0 to 1, and
/// that height; also `None` if that is surely below `floor`.
#[inline]
pub(super) fn touch_edge(cutter: &Cutter, a: Point, b: Point, floor: f64) -> Option<(f64, f64)> {
    let step = sub(b, a);
    let (low, high) = if in_reach(cutter, a) && in_reach(cutter, b) {
        (0.0, 1.0)
    } else {
        within_reach(cutter, a, step)?
    };
    let rise = |t: f64| Rise::at(cutter, along(a, b, t), step);
    let t = maximum(low, high, rise, floor)?;
    let height = |t: f64| height_within(cutter, along(a, b, t));
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

/// Whether a point seen from the cutter is within its reach.
#[inline(always)]
fn in_reach(cutter: &Cutter, [d, _, z]: Point) -> bool {
    cutter.profile(d).is_some_and(|m| z.abs() <= m)
}

/// F along an edge, at one place of it.
struct Rise {
    /// F's slope times a scale: it stays finite at the end of the reach, and does not vanish there with
    /// the radius of a ball.
    sign: f64,
    /// That scale, or 0 where the height is not sure.
    scale: f64,
    height: f64,
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
                let root = ((minor_radius - d) * (minor_radius + d)).max(0.0).sqrt();
                let m = major_radius + root;
                let rise = ((m - z) * (m + z)).max(0.0).sqrt();
                // Close to the rim [`Cutter::profile`] is rounded otherwise, and heights with it.
                let sure = if root > CLOSE * minor_radius {
                    1.0
                } else {
                    0.0
                };
                let height = y + rise;
                if step[0] == 0.0 {
                    return Self {
                        sign: step[1] * rise - z * step[2],
                        scale: sure * rise,
                        height,
                    };
                }
                let share = if m > 0.0 { root / m } else { 1.0 };
                Self {
                    sign: step[1] * rise * share - d * step[0] - z * step[2] * share,
                    scale: sure * rise * share,
                    height,
                }
            }
            Cutter::Cone { radius, slope, .. } => {
                let m = radius + d * slope;
                let rise = ((m - z) * (m + z)).max(0.0).sqrt();
                Self {
                    sign: step[1] * rise + m * slope * step[0] - z * step[2],
                    scale: rise,
                    height: y + rise,
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

/// Where in `[low, high]` a concave function is greatest, given its slope: a false position search
/// (the Illinois variant) for the slope's zero. `None` if it is surely below `floor`.
#[inline(always)]
fn maximum(mut low: f64, mut high: f64, rise: impl Fn(f64) -> Rise, floor: f64) -> Option<f64> {
    let span = high - low;
    let slope = |t: f64| rise(t).sign;
    let mut at_low = slope(low);
    if at_low == 0.0 {
        // At a cone's apex the sign vanishes with the radius; a hair further in it does not.
        at_low = slope(low + HAIR * span);
    }
    if at_low <= 0.0 {
        return Some(low);
    }
    let mut at_high = slope(high);
    if at_high == 0.0 {
        at_high = slope(high - HAIR * span);
    }
    if at_high >= 0.0 {
        return Some(high);
    }
    let enough = EDGE_SEARCH * span;
    let mut moved_low = None;
    let mut last = f64::NAN;
    while high - low > enough {
        let t = low + (high - low) * (at_low / (at_low - at_high));
        if (t - last).abs() <= enough {
            return Some(t);
        }
        let here = rise(t);
        let value = here.sign;
        if value == 0.0 {
            return Some(t);
        }
        last = t;
        let reach = if value > 0.0 { high - t } else { t - low };
        if here.stays_below(floor, reach) {
            return None;
        }
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
    Some(low + (high - low) * 0.5)
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
