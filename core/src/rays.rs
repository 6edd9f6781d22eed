//! Surfaces by rays: how far from the spindle the part is, as designed and as machined.
//!
//! A ray goes out from the spindle, square to it. The part as machined ends on it where it first meets a
//! cutter of the path; the part as designed where it last meets a facet. What lies behind that on the same
//! ray, an undercut, is not seen, nor a cross-section that does not hold the spindle. The difference is for
//! maps and pictures, which want one number for each place; what a path is held against is
//! [`crate::verify()`], which knows of neither rays nor facets.

mod cut;

use serde::{Deserialize, Serialize};

use crate::cutter::Cutter;
use crate::digitize::Digitizer;
use crate::discretize::Model;
use crate::error::{Error, Result, bounded};
use crate::motion::{MotionKind, Trajectory};
use crate::path::Touch;
use crate::row::Outline;
use crate::simd::Simd;
use crate::vector::{Interval, Point, facing};
use crate::verify::Position;

/// Rays in rows along the spindle, each row once around: column `j` is where the cutter is when the part
/// is turned by `360·j/columns` degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rays {
    /// Travel of the first row, mm.
    pub from: f64,
    /// Travel from row to row, mm.
    pub step: f64,
    /// Number of rows.
    pub rows: u32,
    /// Rays of each row.
    pub columns: u32,
}

/// Most rays: some 200 MB of what is made of them.
const MAX_RAYS: f64 = 4.0e6;

/// Radius of the probe that finds the designed surface, mm: so small that it touches next to nothing but
/// what is on the ray.
const PROBE: f64 = 1.0e-4;

/// How far from where rays end a point may be to be taken for a point of the same surface, mm: across a
/// sharp edge the rays around it end as far apart.
const SAME: f64 = 1.0;

/// A designed surface and what a path makes of it, ray by ray.
#[derive(Debug, Clone, PartialEq)]
pub struct Machined {
    /// The rays; row after row in what follows.
    pub rays: Rays,
    /// Where the designed surface is, mm from the spindle; `None` beyond its ends and where the
    /// spindle is outside of the part.
    pub designed: Vec<Option<f64>>,
    /// Where the machined surface is, mm from the spindle; `None` where no cutter comes.
    pub machined: Vec<Option<f64>>,
    /// How far the machined surface lies outside of the designed one, mm; negative where it was gouged.
    /// Along the designed surface's normal, to first order: the difference on the ray times the cosine of
    /// its angle with the normal. `None` where one of the two is missing.
    pub deviation: Vec<Option<f64>>,
}

/// A place of a machined surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spot {
    /// How far it lies outside of the designed surface, mm; negative where it was gouged.
    pub deviation: f64,
    /// In part coordinates, mm.
    pub point: Point,
    /// Travel at which it faces the cutter, mm.
    pub x: f64,
    /// Angle at which it does, degrees, within one revolution.
    pub angle: f64,
}

impl Machined {
    /// The place of the least deviation: the deepest gouge, if that is negative. Of equal ones the first.
    pub fn deepest(&self) -> Option<Spot> {
        self.extreme(|a, b| a < b)
    }

    /// The place of the greatest deviation.
    pub fn highest(&self) -> Option<Spot> {
        self.extreme(|a, b| a > b)
    }

    /// How far the machined surface lies outside of the designed one at a point of it, mm, between the rays
    /// around it; `None` where these do not end at the point but elsewhere, or tell nothing.
    pub fn at(&self, p: Point) -> Option<f64> {
        let Rays {
            from,
            step,
            rows,
            columns,
        } = self.rays;
        let row = (p[0] - from) / step;
        let angle = libm::atan2(-p[2], p[1]) / std::f64::consts::TAU;
        let column = (angle - angle.floor()) * f64::from(columns);
        if row < 0.0 || row > f64::from(rows - 1) {
            return None;
        }
        let (row, up) = (row.floor(), row.fract());
        let (column, on) = (column.floor(), column.fract());
        let ray = |r: f64, c: f64| {
            let c = c as usize % columns as usize;
            (r.min(f64::from(rows - 1))) as usize * columns as usize + c
        };
        let (mut radius, mut deviation) = (0.0, 0.0);
        for (r, share) in [(row, 1.0 - up), (row + 1.0, up)] {
            for (c, part) in [(column, 1.0 - on), (column + 1.0, on)] {
                let ray = ray(r, c);
                radius += share * part * self.designed[ray]?;
                deviation += share * part * self.deviation[ray]?;
            }
        }
        ((radius - across(p)).abs() <= SAME).then_some(deviation)
    }

    /// The same as a tape of this width along the spindle feels it: everywhere as high as the highest place
    /// beneath it. Places with more than `left`, mm, tell nothing any more.
    #[must_use]
    pub fn bridged(&self, width: f64, left: f64) -> Self {
        let columns = self.rays.columns as usize;
        let wide = (width / (2.0 * self.rays.step)).ceil().clamp(0.0, 1000.0) as usize;
        let known = |ray: usize| self.deviation[ray].filter(|&d| d <= left);
        let highest = |ray: usize| {
            known(ray)?;
            let first = (ray / columns).saturating_sub(wide) * columns + ray % columns;
            let last = ray + wide * columns;
            let beneath = (first..self.deviation.len().min(last + 1)).step_by(columns);
            beneath.filter_map(known).reduce(f64::max)
        };
        Self {
            deviation: (0..self.deviation.len()).map(highest).collect(),
            ..self.clone()
        }
    }

    fn extreme(&self, beyond: impl Fn(f64, f64) -> bool) -> Option<Spot> {
        let mut found: Option<(usize, f64)> = None;
        for (ray, deviation) in self.deviation.iter().enumerate() {
            if let Some(deviation) = *deviation
                && found.is_none_or(|(_, so_far)| beyond(deviation, so_far))
            {
                found = Some((ray, deviation));
            }
        }
        let (ray, deviation) = found?;
        let [x, angle] = self.rays.position(ray);
        Some(Spot {
            deviation,
            point: self.rays.point(ray, self.machined[ray]?),
            x,
            angle,
        })
    }
}

impl Rays {
    /// Rays over a part that extends over `part` along the spindle, about `spacing` mm apart along it, and
    /// `columns` around it.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] for a spacing that is not positive, [`Error::TooManyRays`].
    pub fn over(part: Interval, spacing: f64, columns: u32) -> Result<Self> {
        let ok = spacing > 0.0 && spacing.is_finite();
        bounded("spacing", spacing, ok, "greater than 0 mm and finite")?;
        let steps = ((part.high - part.low).max(0.0) / spacing).ceil().max(1.0);
        let rays = steps * f64::from(columns);
        if rays > MAX_RAYS {
            return Err(Error::TooManyRays {
                rays,
                limit: MAX_RAYS,
            });
        }
        // In the middle of their strips, so that none is at the very end.
        let step = (part.high - part.low) / steps;
        Ok(Self {
            from: part.low + step / 2.0,
            step,
            rows: steps as u32,
            columns,
        })
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.rows as usize * self.columns as usize
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The point on a ray at a distance from the spindle, in part coordinates, mm.
    pub fn point(&self, ray: usize, radius: f64) -> Point {
        let rings = self.rings();
        let ray = ray as u64;
        facing(rings.travel(ray), radius, rings.direction_at(ray, 0.0))
    }

    /// Travel, mm, and angle, degrees, at which a ray faces the cutter.
    pub fn position(&self, ray: usize) -> [f64; 2] {
        let angle = 360.0 * (ray % self.columns as usize) as f64 / f64::from(self.columns);
        [self.rings().travel(ray as u64), angle]
    }

    /// The motion that turns each of them to the cutter.
    fn rings(&self) -> Trajectory {
        Trajectory {
            kind: MotionKind::Rings,
            from: self.from,
            step: self.step,
            points_per_revolution: self.columns,
            positions: self.len() as u64,
        }
    }
}

/// The designed surface of a part, ready for rays.
#[derive(Debug)]
pub struct Designed {
    /// Its extent along the spindle, mm.
    pub along: Interval,
    probe: Digitizer,
}

impl Designed {
    /// That of a model's facets. Runs on the current thread pool.
    pub fn new(model: &Model, simd: Simd) -> Self {
        Self {
            along: Outline::span(&model.outlines),
            probe: Digitizer::over_facets(probe(), &model.rows, simd),
        }
    }

    /// That of the facets of a model that a path was digitized from; `None` if that was not done by the
    /// exact search over them.
    pub fn of(digitizer: Digitizer, model: &Model) -> Option<Self> {
        let along = Outline::span(&model.outlines);
        let probe = digitizer.under(probe())?;
        Some(Self { along, probe })
    }

    /// Where each ray last meets a facet: what a probe touches that comes in along it. Nothing in rows of
    /// which a ray meets none: there the spindle is outside of the part, and rays from it tell nothing.
    fn radii(&self, rays: &Rays) -> Vec<Option<f64>> {
        let mut radii = Vec::with_capacity(rays.len());
        let all = 0..rays.len() as u64;
        self.probe.run_chunks(&rays.rings(), all, |chunk, _| {
            // On the far side of the spindle there is another ray.
            let radius = |t: Touch| (t.height > PROBE).then(|| across(t.contact));
            radii.extend(chunk.touches.into_iter().map(|t| t.and_then(radius)));
            true
        });
        for row in radii.chunks_mut(rays.columns as usize) {
            if row.contains(&None) {
                row.fill(None);
            }
        }
        radii
    }
}

fn probe() -> Cutter {
    Cutter::ball(PROBE).expect("its radius is positive")
}

/// What a path of `cutter` makes of a part. The cutter moves straight from each position to the next; of
/// each move some poses count. Runs on the current thread pool.
///
/// # Errors
/// Those of [`crate::verify()`] for positions.
pub fn machined(
    designed: &Designed,
    cutter: &Cutter,
    positions: &[Position],
    rays: Rays,
    simd: Simd,
) -> Result<Machined> {
    crate::verify::check(positions)?;
    let designed = designed.radii(&rays);
    let machined = cut::cut(cutter, positions, &rays, simd);
    let slant = slants(&rays, &designed);
    let both = designed.iter().zip(&machined).zip(slant);
    let deviation = both
        .map(|((d, m), slant)| Some(((*m)? - (*d)?) * slant))
        .collect();
    Ok(Machined {
        rays,
        designed,
        machined,
        deviation,
    })
}

fn across(p: Point) -> f64 {
    (p[1] * p[1] + p[2] * p[2]).sqrt()
}

/// Cosines of the angles between rays and the surface's normal, from differences to the rays beside them.
fn slants(rays: &Rays, radii: &[Option<f64>]) -> Vec<f64> {
    let columns = rays.columns as usize;
    let turn = std::f64::consts::TAU / f64::from(rays.columns);
    let slope = |here: f64, beside: [Option<usize>; 2], apart: f64| {
        let [before, after] = beside.map(|ray| ray.and_then(|ray| radii[ray]));
        let sides = f64::from(u8::from(before.is_some()) + u8::from(after.is_some()));
        (after.unwrap_or(here) - before.unwrap_or(here)) / (sides.max(1.0) * apart)
    };
    let slant = |ray: usize, here: f64| {
        let (first, column) = (ray - ray % columns, ray % columns);
        let next = Some(ray + columns).filter(|&ray| ray < radii.len());
        let along = slope(here, [ray.checked_sub(columns), next], rays.step);
        let around = [column + columns - 1, column + 1].map(|to| Some(first + to % columns));
        let about = slope(here, around, turn * here);
        1.0 / (1.0 + along * along + about * about).sqrt()
    };
    let radii = radii.iter().enumerate();
    radii
        .map(|(ray, radius)| radius.map_or(1.0, |here| slant(ray, here)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretize::discretize;
    use crate::job::Discretization;
    use crate::part::{Body, Mesh, Part, Shape};

    /// A round bar along the spindle as a mesh.
    fn bar(radius: f64, long: f64, around: u32) -> Designed {
        let mut vertices = Vec::new();
        for end in [0.0, long] {
            for k in 0..around {
                let angle = std::f64::consts::TAU * f64::from(k) / f64::from(around);
                vertices.push([end, radius * angle.cos(), radius * angle.sin()]);
            }
        }
        let triangles = (0..around).flat_map(|k| {
            let (a, b) = (k, (k + 1) % around);
            [[a, b, around + a], [b, around + b, around + a]]
        });
        let mesh = Mesh::new("bar", vertices, triangles.collect()).expect("valid");
        let bodies = vec![Body {
            name: "bar".to_owned(),
            shape: Shape::Mesh(mesh),
        }];
        let model = discretize(&Part { bodies }, Discretization::Tolerance(0.1));
        Designed::new(&model.expect("a model"), Simd::best())
    }

    fn helix(height: impl Fn(usize) -> f64, count: usize) -> Vec<Position> {
        let position = |i: usize| Position {
            x: 0.01 * i as f64,
            angle: 2.0 * i as f64,
            height: Some(height(i)),
        };
        (0..count).map(position).collect()
    }

    /// A bar of 20 mm, turned by a wheel of 48 that stops 0.03 mm away from it: round and 0.03 too thick,
    /// but for where one position is half a millimetre too low.
    #[test]
    fn what_one_low_position_does_is_seen_where_it_was() {
        let designed = bar(20.0, 40.0, 720);
        let cutter = Cutter::torus(40.0, 8.0).expect("valid");
        let low = 2000;
        let path = helix(|i| 68.03 - if i == low { 0.53 } else { 0.0 }, 4001);
        let rays = Rays::over(
            Interval {
                low: 0.0,
                high: 40.0,
            },
            0.25,
            360,
        )
        .expect("few");
        let found = machined(&designed, &cutter, &path, rays, Simd::best()).expect("valid");
        let deepest = found.deepest().expect("some");
        assert!((deepest.x - path[low].x).abs() <= rays.step, "{deepest:?}");
        assert_eq!(deepest.angle, path[low].angle % 360.0);
        assert!((deepest.deviation + 0.5).abs() < 0.002, "{deepest:?}");
        // A revolution further the cutter has moved on by 1.8 mm.
        let turned = found
            .deviation
            .iter()
            .filter(|d| d.is_some_and(|d| d > 0.0))
            .count();
        assert!(turned > rays.len() * 9 / 10, "{turned} of {}", rays.len());
        // Of 1.8 mm from revolution to revolution a scallop of 0.05 mm is left, at the ends up to 0.2 mm.
        let highest = found.highest().expect("some");
        assert!(highest.deviation < 0.03 + 0.21, "{highest:?}");
    }

    #[test]
    fn rays_are_bounded() {
        let long = Interval {
            low: 0.0,
            high: 1.0e6,
        };
        assert!(matches!(
            Rays::over(long, 0.001, 360),
            Err(Error::TooManyRays { .. })
        ));
        assert!(Rays::over(long, f64::NAN, 360).is_err());
    }
}
