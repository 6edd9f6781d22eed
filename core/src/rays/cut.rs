//! The part as machined: where rays from the spindle first meet a cutter of a path.
//!
//! Cutters lie in lots by the direction from which they come; a ray looks into the lots around its own, the
//! nearest first, and passes by what is surely behind what it has met.

use rayon::prelude::*;

use super::Rays;
use crate::cutter::Cutter;
use crate::verify::{INTERMEDIATE, Position};

/// A cutter where it stands, as the part sees it.
#[derive(Debug, Clone, Copy)]
struct Stand {
    x: f64,
    /// From the spindle, mm, never negative.
    height: f64,
    cos: f64,
    sin: f64,
}

/// Lots of a revolution.
const LOTS: usize = 360;

/// A cutter as a row of rays sees it: a disc, its centre this far from the spindle.
#[derive(Debug, Clone, Copy)]
struct Disc {
    radius: f64,
    height: f64,
    cos: f64,
    sin: f64,
}

/// The discs of a lot that a row of rays may meet.
struct Discs {
    discs: Vec<Disc>,
    /// How near to the spindle the nearest of them comes, mm.
    gap: f64,
}

/// Slack for rounding of a bound, mm.
const SLACK: f64 = 1.0e-9;

/// Where each ray first meets a cutter.
pub(super) fn cut(cutter: &Cutter, positions: &[Position], rays: &Rays) -> Vec<Option<f64>> {
    let lots = lots(positions);
    let directions = rays.rings().directions();
    let most = cutter.max_radius();
    let turn = std::f64::consts::TAU / LOTS as f64;
    // The least angle between a ray and what lies so many lots away, as far as anything can be met.
    let least: Vec<(f64, f64)> = (0..=LOTS / 4 + 1)
        .map(|away: usize| (away.saturating_sub(1) as f64 * turn).sin_cos())
        .collect();
    let row = |row: u32| {
        let x = rays.from + rays.step * f64::from(row);
        let near: Vec<Discs> = lots.iter().map(|lot| discs(cutter, lot, x)).collect();
        let gap = near.iter().map(|n| n.gap).fold(f64::INFINITY, f64::min);
        if gap <= 0.0 {
            // It is in the spindle's way: nothing is left.
            return vec![Some(0.0); directions.len()];
        }
        let ray = |(column, &direction): (usize, &(f64, f64))| {
            let home = column * LOTS / directions.len();
            let mut first = f64::INFINITY;
            for (away, &angle) in least.iter().enumerate() {
                if soonest(gap, most, angle) >= first {
                    break;
                }
                let sides = [home + away, home + LOTS - away];
                for side in &sides[..if away == 0 { 1 } else { 2 }] {
                    let lot = &near[side % LOTS];
                    if soonest(lot.gap, most, angle) < first {
                        first = first_met(&lot.discs, direction, first);
                    }
                }
            }
            first.is_finite().then_some(first)
        };
        directions.iter().enumerate().map(ray).collect::<Vec<_>>()
    };
    let rows: Vec<_> = (0..rays.rows).into_par_iter().map(row).collect();
    rows.concat()
}

/// The discs of a lot at travel `x`.
fn discs(cutter: &Cutter, lot: &[Stand], x: f64) -> Discs {
    let width = cutter.half_width();
    let from = lot.partition_point(|s| s.x < x - width);
    let to = lot.partition_point(|s| s.x <= x + width);
    let disc = |stand: &Stand| {
        Some(Disc {
            radius: cutter.profile(x - stand.x)?,
            height: stand.height,
            cos: stand.cos,
            sin: stand.sin,
        })
    };
    let discs: Vec<Disc> = lot[from..to].iter().filter_map(disc).collect();
    let gaps = discs.iter().map(|d| d.height - d.radius);
    Discs {
        gap: gaps.fold(f64::INFINITY, f64::min),
        discs,
    }
}

/// How far out a ray goes at least before it meets a disc of at most radius `most` that comes no nearer to the
/// spindle than `gap`, and whose centre is at least this angle off the ray. Of all such discs the one of radius
/// `most`, at `gap`, and at that angle is met first: it holds any smaller one with the same nearest point, and
/// turning a disc away or moving it out only delays the ray.
fn soonest(gap: f64, most: f64, (sin, cos): (f64, f64)) -> f64 {
    let height = gap + most;
    let aside = height * sin;
    if cos <= 0.0 || aside > most + SLACK || gap == f64::INFINITY {
        return f64::INFINITY;
    }
    height * cos - ((most - aside) * (most + aside)).max(0.0).sqrt() - SLACK
}

/// All poses of a path: lots by the direction from which they come, each in order of travel.
fn lots(positions: &[Position]) -> Vec<Vec<Stand>> {
    let mut lots = vec![Vec::new(); LOTS];
    let mut add = |x: f64, angle: f64, height: f64| {
        // From below the spindle is from above on the other side.
        let angle = if height < 0.0 { angle + 180.0 } else { angle };
        let degrees = angle.rem_euclid(360.0);
        let radians = degrees.to_radians();
        let lot = &mut lots[((degrees / 360.0 * LOTS as f64) as usize).min(LOTS - 1)];
        lot.push(Stand {
            x,
            height: height.abs(),
            cos: libm::cos(radians),
            sin: libm::sin(radians),
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

/// The lesser of `first` and where a ray first meets one of these discs.
fn first_met(discs: &[Disc], (cos, sin): (f64, f64), mut first: f64) -> f64 {
    for disc in discs {
        // The centre along the ray and square to it.
        let along = disc.height * (disc.cos * cos + disc.sin * sin);
        if along - disc.radius >= first {
            continue;
        }
        let aside = disc.height * (disc.sin * cos - disc.cos * sin);
        if along > 0.0 && aside.abs() <= disc.radius {
            let within = (disc.radius - aside) * (disc.radius + aside);
            first = first.min(along - within.sqrt());
        }
    }
    first
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
        let found = cut(&cutter, &path, &rays);
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
            for (ray, radius) in cut(&cutter, &path, &rays).into_iter().enumerate() {
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
