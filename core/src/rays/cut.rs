//! The part as machined: where rays from the spindle first meet a cutter of a path.
//!
//! Cutters lie in lots by the direction from which they come; a ray looks into the lots around its own, the
//! nearest first, and passes by what is surely behind what it has met.

use std::ops::Range;

use fearless_simd::{f64x8, prelude::*};
use rayon::prelude::*;

use super::Rays;
use crate::cutter::Cutter;
use crate::lanes::LANES;
use crate::simd::{Simd, with_simd};
use crate::verify::{INTERMEDIATE, Position};

/// A cutter where it stands, as the part sees it.
#[derive(Debug, Clone, Copy)]
struct Stand {
    x: f64,
    /// From the spindle, mm, never negative.
    height: f64,
    /// Its centre in part coordinates, mm.
    y: f64,
    z: f64,
}

/// Lots of a revolution.
const LOTS: usize = 720;

/// Lots on one side of a ray beyond which nothing is met: a quarter, and one for the ray's own place in its lot.
const REACH: usize = LOTS / 4 + 2;

/// Eight cutters as a row of rays sees them: discs, y and z of their centres in part coordinates. Where there is
/// none, its radius is negative.
struct Discs {
    radius: [f64; LANES],
    y: [f64; LANES],
    z: [f64; LANES],
}

/// The discs of each lot that a row of rays may meet, lot after lot.
struct Row {
    discs: Vec<Discs>,
    lots: Vec<Lot>,
    /// How near to the spindle the nearest of all comes, mm.
    gap: f64,
}

struct Lot {
    discs: Range<usize>,
    /// How near to the spindle the nearest of them comes, mm.
    gap: f64,
}

/// Slack for rounding of a bound, mm.
const SLACK: f64 = 1.0e-9;

/// Where each ray first meets a cutter.
pub(super) fn cut(
    cutter: &Cutter,
    positions: &[Position],
    rays: &Rays,
    simd: Simd,
) -> Vec<Option<f64>> {
    let lots = lots(positions);
    let directions = rays.rings().directions();
    let row = |row: u32| {
        let row = Row::new(cutter, &lots, rays.from + rays.step * f64::from(row));
        if row.gap <= 0.0 {
            // It is in the spindle's way: nothing is left.
            return vec![Some(0.0); directions.len()];
        }
        if row.gap == f64::INFINITY {
            return vec![None; directions.len()];
        }
        let bounds = bounds(row.gap, cutter.max_radius());
        with_simd!(simd.token(), simd => row.met(simd, &bounds, &directions))
    };
    let rows: Vec<_> = (0..rays.rows).into_par_iter().map(row).collect();
    rows.concat()
}

impl Row {
    /// What the rays at travel `x` may meet.
    fn new(cutter: &Cutter, lots: &[Vec<Stand>], x: f64) -> Self {
        let width = cutter.half_width();
        let mut row = Self {
            discs: Vec::new(),
            lots: Vec::with_capacity(lots.len()),
            gap: f64::INFINITY,
        };
        for lot in lots {
            let from = lot.partition_point(|s| s.x < x - width);
            let to = lot.partition_point(|s| s.x <= x + width);
            let first = row.discs.len();
            let mut gap = f64::INFINITY;
            for stands in lot[from..to].chunks(LANES) {
                let mut discs = Discs {
                    radius: [-1.0; LANES],
                    y: [0.0; LANES],
                    z: [0.0; LANES],
                };
                for (lane, stand) in stands.iter().enumerate() {
                    if let Some(radius) = cutter.profile(x - stand.x) {
                        discs.radius[lane] = radius;
                        discs.y[lane] = stand.y;
                        discs.z[lane] = stand.z;
                        gap = gap.min(stand.height - radius);
                    }
                }
                row.discs.push(discs);
            }
            row.lots.push(Lot {
                discs: first..row.discs.len(),
                gap,
            });
            row.gap = row.gap.min(gap);
        }
        row
    }

    /// Where each of the rays first meets a disc. What the ray before met is looked at first, for the next ray
    /// meets the same or what is beside it.
    #[inline(always)]
    fn met<S: fearless_simd::Simd>(
        &self,
        simd: S,
        bounds: &[Bound],
        directions: &[(f64, f64)],
    ) -> Vec<Option<f64>> {
        let mut aside = 0;
        let mut all = Vec::with_capacity(directions.len());
        for (column, &direction) in directions.iter().enumerate() {
            let home = column * LOTS / directions.len();
            let mut met = aside;
            let lot = |away: usize| &self.lots[(home + away) % LOTS];
            let mut first = nearest(simd, &self.discs[lot(aside).discs.clone()], direction);
            for (away, bound) in bounds.iter().enumerate() {
                if bound.soonest >= first {
                    break;
                }
                let sides = [away, LOTS - away];
                for side in &sides[..if away == 0 { 1 } else { 2 }] {
                    let lot = lot(*side);
                    if bound.soonest + bound.slope * (lot.gap - self.gap) < first {
                        let nearest = nearest(simd, &self.discs[lot.discs.clone()], direction);
                        if nearest < first {
                            (first, met) = (nearest, *side);
                        }
                    }
                }
            }
            aside = met;
            all.push(first.is_finite().then_some(first));
        }
        all
    }
}

/// How far out a ray goes at least before it meets anything of a lot so far away.
struct Bound {
    /// If that comes as near to the spindle as anything, mm.
    soonest: f64,
    /// And how much further for each mm that it does not.
    slope: f64,
}

/// The bounds of lots 0, 1, 2 … away, up to the last that a ray can meet, over discs of at most radius `most` that
/// come no nearer to the spindle than `gap`. Of all discs with centres at least some angle off the ray the one of
/// radius `most`, at `gap`, and at that angle is met first: it holds any smaller one with the same nearest
/// point, and turning a disc away or moving it out only delays the ray. The delay is convex in how far it is moved
/// out, so that its slope at `gap` holds beyond.
fn bounds(gap: f64, most: f64) -> Vec<Bound> {
    let height = gap + most;
    let bound = |away: usize| {
        let angle = std::f64::consts::TAU * away.saturating_sub(1) as f64 / LOTS as f64;
        let (sin, cos) = libm::sincos(angle);
        let aside = height * sin;
        if aside > most + SLACK {
            return None;
        }
        let root = ((most - aside) * (most + aside)).max(0.0).sqrt();
        Some(Bound {
            soonest: height * cos - root - SLACK,
            slope: (cos + height * sin * sin / root.max(SLACK)).min(STEEPEST),
        })
    };
    (0..=REACH).map_while(bound).collect()
}

/// A slope that no bound needs to exceed: a product of it and a length stays far from overflow and rounding.
const STEEPEST: f64 = 1.0e3;

/// Where a ray first meets one of these discs; infinity if it meets none.
#[inline(always)]
fn nearest<S: fearless_simd::Simd>(simd: S, discs: &[Discs], (cos, sin): (f64, f64)) -> f64 {
    let never = f64x8::splat(simd, f64::INFINITY);
    let mut nearest = never;
    for discs in discs {
        let radius = f64x8::from_slice(simd, &discs.radius);
        let y = f64x8::from_slice(simd, &discs.y);
        let z = f64x8::from_slice(simd, &discs.z);
        // The centres along the ray and square to it.
        let along = y * cos - z * sin;
        let aside = y * sin + z * cos;
        let met = along - ((radius - aside) * (radius + aside)).sqrt();
        let meets = along.simd_gt(0.0) & aside.abs().simd_le(radius);
        nearest = nearest.min(meets.select(met, never));
    }
    let lanes: [f64; LANES] = *nearest;
    lanes.into_iter().fold(f64::INFINITY, f64::min)
}

/// All poses of a path: lots by the direction from which they come, each in order of travel.
fn lots(positions: &[Position]) -> Vec<Vec<Stand>> {
    let mut lots = vec![Vec::new(); LOTS];
    let mut add = |x: f64, angle: f64, height: f64| {
        // From below the spindle is from above on the other side.
        let angle = if height < 0.0 { angle + 180.0 } else { angle };
        let height = height.abs();
        let degrees = angle.rem_euclid(360.0);
        let radians = degrees.to_radians();
        let lot = &mut lots[((degrees / 360.0 * LOTS as f64) as usize).min(LOTS - 1)];
        lot.push(Stand {
            x,
            height,
            y: height * libm::cos(radians),
            z: -height * libm::sin(radians),
        });
    };
    for (k, p) in positions.iter().enumerate() {
        let Some(height) = p.height else { continue };
        add(p.x, p.angle, height);
        let next = positions
            .get(k + 1)
            .and_then(|n| Some((n.x, n.angle, n.height?)));
        let Some((x, angle, then)) = next else {
            continue;
        };
        for pose in 1..=INTERMEDIATE {
            let share = pose as f64 / (INTERMEDIATE + 1) as f64;
            let between = |a: f64, b: f64| a + (b - a) * share;
            add(
                between(p.x, x),
                between(p.angle, angle),
                between(height, then),
            );
        }
    }
    for lot in &mut lots {
        lot.sort_by(|a, b| a.x.total_cmp(&b.x));
    }
    lots
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{Interval, Point};
    use proptest::prelude::*;

    #[test]
    fn a_cutter_on_the_spindle_leaves_nothing() {
        let cutter = Cutter::torus(40.0, 8.0).expect("valid");
        let rays = Rays::over(
            Interval {
                low: 0.0,
                high: 20.0,
            },
            1.0,
            12,
        )
        .expect("few");
        let path = [Position {
            x: 10.0,
            angle: 30.0,
            height: Some(10.0),
        }];
        let found = cut(&cutter, &path, &rays, Simd::best());
        let under = |ray: usize| (rays.position(ray)[0] - 10.0).abs() <= 8.0;
        for (ray, radius) in found.iter().enumerate() {
            assert_eq!(*radius, under(ray).then_some(0.0));
        }
    }

    proptest! {
        /// Against sampling along the ray: up to what was found there is no cutter, and there is one's surface.
        #[test]
        fn a_ray_ends_where_it_first_meets_a_cutter(
            stands in prop::collection::vec((0.0..30.0_f64, -720.0..720.0_f64, 50.0..90.0_f64), 1..12),
            which in 0..3_usize,
        ) {
            let cutter = [
                Cutter::torus(40.0, 8.0),
                Cutter::cylinder(30.0, 16.0),
                Cutter::cone(30.0, 20.0, 30.0),
            ][which].clone().expect("valid");
            // Each alone: no moves.
            let path: Vec<Position> = stands
                .iter()
                .flat_map(|&(x, angle, height)| [Some(height), None].map(|height| Position { x, angle, height }))
                .collect();
            let rays = Rays::over(Interval { low: 0.0, high: 30.0 }, 5.0, 18).expect("few");
            // How deep in the nearest cutter, mm; negative outside of all.
            let depth = |p: Point| {
                let within = stands.iter().filter_map(|&(x, angle, height)| {
                    let (sin, cos) = angle.to_radians().sin_cos();
                    let (y, z) = (p[1] * cos - p[2] * sin, p[1] * sin + p[2] * cos);
                    cutter.profile(p[0] - x).map(|m| m - (y - height).hypot(z))
                });
                within.fold(f64::NEG_INFINITY, f64::max)
            };
            let found = cut(&cutter, &path, &rays, Simd::Scalar);
            for simd in Simd::available() {
                prop_assert_eq!(&cut(&cutter, &path, &rays, simd), &found);
            }
            for (ray, radius) in found.into_iter().enumerate() {
                let free = radius.unwrap_or(150.0);
                for k in 0..200 {
                    let at = free * f64::from(k) / 200.0;
                    prop_assert!(depth(rays.point(ray, at)) <= 1.0e-9, "{at} of {free}");
                }
                if let Some(radius) = radius {
                    let met = depth(rays.point(ray, radius));
                    prop_assert!(met.abs() <= 1.0e-6, "{met}");
                }
            }
        }
    }
}
