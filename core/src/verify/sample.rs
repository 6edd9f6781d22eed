//! Samples of the designed surface: where a path is verified.
//!
//! They lie at irregular offsets, so that no grid that was digitized hides its gaps between them,
//! and are the same for the same part and spacing: the irregularity is that of the golden ratio, not
//! of chance. This module knows neither cutters nor paths.

use rayon::prelude::*;

use crate::error::{Error, Result, bounded};
use crate::evaluate::Net;
use crate::part::{Mesh, Part, Shape};
use crate::surface::{Direction, Surface};
use crate::vector::{Point, add_scaled, cross, length, sub};

/// Samples that the default spacing aims at: half a millimetre on a shoe last 245 mm long.
const DEFAULT_SAMPLES: f64 = 240_000.0;

/// Most samples of a part.
const MAX_SAMPLES: f64 = 5.0e7;

/// Lines in either direction along which a surface is measured, if its pieces are no more.
const MEASURED: usize = 128;

/// How far a sample strays from its even place, of the spacing, both ways together.
const STRAY: f64 = 0.5;

/// Fractional parts of multiples of this spread most evenly; the pair does the same in the plane
/// (the plastic number's powers).
const GOLDEN: f64 = 0.618_033_988_749_894_9;
const PLASTIC: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Points on a part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Samples {
    /// In part coordinates, mm, body after body and row after row.
    pub points: Vec<Point>,
    /// Where each body's points end.
    pub ends: Vec<usize>,
    /// About how far neighbours are apart, mm.
    pub spacing: f64,
}

/// Samples every body about every `spacing` mm in both directions, its boundary, its creases and
/// a mesh's vertices included; by default as many samples as [`DEFAULT_SAMPLES`] says.
///
/// # Errors
/// [`Error::OutOfBounds`] for a spacing that is not positive, [`Error::TooManySamples`].
pub(super) fn sample(part: &Part, spacing: Option<f64>) -> Result<Samples> {
    let bodies: Vec<Measured> = part
        .bodies
        .iter()
        .map(|b| Measured::new(&b.shape))
        .collect();
    let [area, line, count] = bodies.iter().fold([0.0; 3], |sum, body| {
        let size = body.size();
        std::array::from_fn(|k| sum[k] + size[k])
    });
    let spacing = match spacing {
        Some(s) => {
            let ok = s > 0.0 && s.is_finite();
            bounded("spacing", s, ok, "greater than 0 mm and finite")?;
            s
        }
        // Where there is next to no area, its lines are what counts.
        None if area > 0.0 => (area / DEFAULT_SAMPLES).sqrt().max(line / DEFAULT_SAMPLES),
        None => 1.0,
    };
    let expected = area / (spacing * spacing) + line / spacing + count;
    if expected > MAX_SAMPLES {
        return Err(Error::TooManySamples {
            samples: expected,
            spacing,
            limit: MAX_SAMPLES,
        });
    }
    let mut points = Vec::with_capacity(expected as usize);
    let mut ends = Vec::with_capacity(bodies.len());
    for body in &bodies {
        match body {
            Measured::Surface(surface) => points.extend(surface.sample(spacing)),
            Measured::Mesh(mesh, _) => sample_mesh(mesh, spacing, &mut points),
        }
        ends.push(points.len());
    }
    Ok(Samples {
        points,
        ends,
        spacing,
    })
}

/// A body, measured.
enum Measured<'a> {
    Surface(MeasuredSurface<'a>),
    /// With its area, mm².
    Mesh(&'a Mesh, f64),
}

impl<'a> Measured<'a> {
    fn new(shape: &'a Shape) -> Self {
        match shape {
            Shape::Surface(surface) => Self::Surface(MeasuredSurface::new(surface)),
            Shape::Mesh(mesh) => Self::Mesh(mesh, areas(mesh).sum()),
        }
    }

    /// What asks for samples: an area (mm²), counted as often as rows of even spacing pass over it;
    /// lines (mm) that are sampled in any case; and points likewise.
    fn size(&self) -> [f64; 3] {
        match self {
            Self::Surface(surface) => {
                let MeasuredSurface {
                    u, forced_v, area, ..
                } = surface;
                let (rows, columns) = (u.forced.len() as f64, forced_v.len() as f64);
                let lines = rows * surface.widest + columns * u.total();
                [*area, lines, rows * columns]
            }
            Self::Mesh(mesh, area) => [*area, 0.0, mesh.vertices().len() as f64],
        }
    }
}

/// A surface with what its parameters mean in millimetres.
struct MeasuredSurface<'a> {
    net: Net<'a>,
    /// Along u; each interval as long as the longest isoline makes it.
    u: Scale,
    vs: Vec<f64>,
    forced_v: Vec<f64>,
    area: f64,
    /// Length of the longest row, mm.
    widest: f64,
}

impl<'a> MeasuredSurface<'a> {
    fn new(surface: &'a Surface) -> Self {
        let (us, vs) = (measured(surface.u()), measured(surface.v()));
        let net = Net::new(surface);
        let points = net.grid(&us, &vs);
        let rows: Vec<&[Point]> = points.chunks_exact(vs.len()).collect();
        let steps: Vec<f64> = rows
            .windows(2)
            .map(|w| {
                let pairs = w[0].iter().zip(w[1]);
                pairs.map(|(a, b)| length(sub(*b, *a))).fold(0.0, f64::max)
            })
            .collect();
        let girths: Vec<f64> = rows.iter().map(|r| chords(r).sum()).collect();
        let between = girths.windows(2).map(|g| 0.5 * (g[0] + g[1]));
        Self {
            net,
            area: steps.iter().zip(between).map(|(s, g)| s * g).sum(),
            widest: girths.iter().copied().fold(0.0, f64::max),
            u: Scale::new(us, steps, creases(surface.u())),
            vs,
            forced_v: creases(surface.v()),
        }
    }

    fn sample(&self, spacing: f64) -> Vec<Point> {
        let rows: Vec<(usize, f64)> = self
            .u
            .places(spacing, 0.0)
            .into_iter()
            .enumerate()
            .collect();
        let sampled: Vec<Vec<Point>> = rows
            .into_par_iter()
            .map(|(row, u)| {
                let isoline = self.net.grid(&[u], &self.vs);
                let lengths = chords(&isoline).collect();
                let v = Scale::new(self.vs.clone(), lengths, self.forced_v.clone());
                // Each row begins its own run of offsets.
                let phase = (row as f64 * PLASTIC[0]).fract();
                self.net.grid(&[u], &v.places(spacing, phase))
            })
            .collect();
        sampled.concat()
    }
}

/// Lines of a direction along which the surface is measured.
fn measured(direction: &Direction) -> Vec<f64> {
    let breaks = direction.breaks();
    let density = (MEASURED / (breaks.len() - 1)).max(1);
    let mut lines = vec![breaks[0]];
    for piece in breaks.windows(2) {
        let inner =
            (1..density).map(|i| piece[0] + (piece[1] - piece[0]) * (i as f64 / density as f64));
        lines.extend(inner.chain([piece[1]]));
    }
    lines
}

/// The ends of a direction, and the knots at which the surface may have an edge.
fn creases(direction: &Direction) -> Vec<f64> {
    let (low, high) = direction.domain();
    let sharp = |k: &f64| {
        let times = direction.knots.iter().filter(|&other| other == k).count();
        times >= direction.degree
    };
    let breaks = direction.breaks();
    let inner = &breaks[1..breaks.len() - 1];
    let mut all = vec![low];
    all.extend(inner.iter().copied().filter(sharp));
    all.push(high);
    all
}

fn chords(points: &[Point]) -> impl Iterator<Item = f64> {
    points.windows(2).map(|w| length(sub(w[1], w[0])))
}

/// Parameters with the length from the first to each of them, mm.
struct Scale {
    parameters: Vec<f64>,
    lengths: Vec<f64>,
    /// Parameters that are sampled in any case, both ends among them.
    forced: Vec<f64>,
}

impl Scale {
    fn new(parameters: Vec<f64>, steps: Vec<f64>, forced: Vec<f64>) -> Self {
        let mut lengths = Vec::with_capacity(parameters.len());
        let mut total = 0.0;
        lengths.push(total);
        for step in steps {
            total += step;
            lengths.push(total);
        }
        Self {
            parameters,
            lengths,
            forced,
        }
    }

    fn total(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// Parameters about every `spacing`, at offsets that start at `phase`, and the forced ones.
    fn places(&self, spacing: f64, phase: f64) -> Vec<f64> {
        let count = (self.total() / spacing).ceil();
        let step = self.total() / count;
        let mut places = self.forced.clone();
        let mut at = 0;
        for k in 0..count as usize {
            let offset = (phase + k as f64 * GOLDEN).fract() - 0.5;
            let target = step * (k as f64 + 0.5 + STRAY * offset);
            while at + 2 < self.lengths.len() && self.lengths[at + 1] < target {
                at += 1;
            }
            let (low, high) = (self.parameters[at], self.parameters[at + 1]);
            let share = (target - self.lengths[at]) / (self.lengths[at + 1] - self.lengths[at]);
            places.push((low + (high - low) * share).clamp(low, high));
        }
        places.sort_unstable_by(f64::total_cmp);
        places.dedup();
        places
    }
}

/// The area of each triangle, mm².
fn areas(mesh: &Mesh) -> impl Iterator<Item = f64> {
    mesh.triangles().iter().map(|t| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
        0.5 * length(cross(sub(b, a), sub(c, a)))
    })
}

/// The vertices that triangles use, and points over the triangles, as many as their areas ask for:
/// what is too small for a point of its own shares one with the triangles after it.
fn sample_mesh(mesh: &Mesh, spacing: f64, points: &mut Vec<Point>) {
    let mut seen = vec![false; mesh.vertices().len()];
    let mut due = 0.5;
    let mut drawn = 0.0;
    for (triangle, area) in mesh.triangles().iter().zip(areas(mesh)) {
        let corners = triangle.map(|v| mesh.vertices()[v as usize]);
        for (v, corner) in triangle.iter().zip(corners) {
            if !std::mem::replace(&mut seen[*v as usize], true) {
                points.push(corner);
            }
        }
        due += area / (spacing * spacing);
        let [a, b, c] = corners;
        while due >= 1.0 {
            due -= 1.0;
            drawn += 1.0;
            let [s, t] = PLASTIC.map(|p| (drawn * p).fract());
            let (s, t) = if s + t > 1.0 {
                (1.0 - s, 1.0 - t)
            } else {
                (s, t)
            };
            points.push(add_scaled(add_scaled(a, s, sub(b, a)), t, sub(c, a)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::Body;
    use crate::surface::tests::quarter_cylinder;

    fn part(shapes: Vec<Shape>) -> Part {
        let body = |shape| Body {
            name: "body".to_owned(),
            shape,
        };
        Part {
            bodies: shapes.into_iter().map(body).collect(),
        }
    }

    fn square() -> Mesh {
        let corners = [
            [0.0, 0.0],
            [30.0, 0.0],
            [30.0, 20.0],
            [0.0, 20.0],
            [99.0, 99.0],
        ];
        let vertices = corners.map(|[x, y]| [x, y, 5.0]).to_vec();
        Mesh::new("square", vertices, vec![[0, 1, 2], [0, 2, 3]]).expect("valid")
    }

    /// How far the worst of many places on the quarter cylinder is from the next sample.
    fn gap(points: &[Point]) -> f64 {
        let mut worst = 0.0_f64;
        for i in 0..=60 {
            for j in 0..=40 {
                let angle = std::f64::consts::FRAC_PI_2 * f64::from(j) / 40.0;
                let p = [
                    f64::from(i) * 0.5,
                    10.0 * libm::cos(angle),
                    10.0 * libm::sin(angle),
                ];
                let near = points.iter().map(|&q| length(sub(p, q)));
                worst = worst.max(near.fold(f64::INFINITY, f64::min));
            }
        }
        worst
    }

    #[test]
    fn a_surface_is_covered_to_its_boundary() {
        for transposed in [false, true] {
            let surface = quarter_cylinder(10.0, 30.0);
            let surface = if transposed {
                surface.transposed()
            } else {
                surface
            };
            let part = part(vec![Shape::Surface(surface)]);
            let samples = sample(&part, Some(1.0)).expect("valid");
            let area = 30.0 * 5.0 * std::f64::consts::PI;
            let count = samples.points.len() as f64;
            assert!(
                count > area && count < 1.4 * area,
                "{count} over {area} mm²"
            );
            assert!(gap(&samples.points) < 1.0, "{}", gap(&samples.points));
            let near = |p: Point| samples.points.iter().any(|&q| length(sub(p, q)) < 1e-12);
            for corner in [
                [0.0, 10.0, 0.0],
                [30.0, 10.0, 0.0],
                [0.0, 0.0, 10.0],
                [30.0, 0.0, 10.0],
            ] {
                assert!(near(corner), "{corner:?}");
            }
            // At irregular offsets: hardly two rows at the same distance.
            let mut xs: Vec<f64> = samples.points.iter().map(|p| p[0]).collect();
            xs.sort_by(f64::total_cmp);
            xs.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
            let mut steps: Vec<f64> = xs.windows(2).map(|w| w[1] - w[0]).collect();
            steps.sort_by(f64::total_cmp);
            assert!(steps[steps.len() - 2] > 1.2 * steps[2], "{steps:?}");
        }
    }

    #[test]
    fn the_default_is_so_many_samples_whatever_the_size() {
        for scale in [0.1, 1.0, 1000.0] {
            let part = part(vec![Shape::Surface(quarter_cylinder(
                10.0 * scale,
                30.0 * scale,
            ))]);
            let count = sample(&part, None).expect("valid").points.len();
            assert!((200_000..300_000).contains(&count), "{count}");
        }
    }

    #[test]
    fn a_mesh_is_sampled_by_area_and_at_the_vertices_it_uses() {
        let part = part(vec![Shape::Mesh(square()), Shape::Mesh(square())]);
        let samples = sample(&part, Some(1.0)).expect("valid");
        let [first, second] = [samples.ends[0], samples.ends[1] - samples.ends[0]];
        assert_eq!((first, second), (604, 604));
        assert_eq!(samples.points.len(), 1208);
        assert!(samples.points.contains(&[30.0, 20.0, 5.0]));
        assert!(!samples.points.contains(&[99.0, 99.0, 5.0]));
        let on = |p: &Point| (0.0..=30.0).contains(&p[0]) && (0.0..=20.0).contains(&p[1]);
        assert!(samples.points.iter().all(on));
        let quarter = samples.points[..first]
            .iter()
            .filter(|p| p[0] < 15.0 && p[1] < 10.0);
        let count = quarter.count();
        assert!((140..=162).contains(&count), "{count}");
    }

    #[test]
    fn a_surface_without_extent_still_has_its_ends() {
        let part = part(vec![Shape::Surface(quarter_cylinder(10.0, 0.0))]);
        let count = |spacing| sample(&part, spacing).expect("valid").points.len();
        assert!(count(None) > 0);
        assert!(count(Some(1.0)) >= 2 * 16);
    }
}
